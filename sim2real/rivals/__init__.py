"""Rivals of the library's effects: curves of any shape over one coordinate of the motion.

`coordinates` makes what a curve is fitted with along a measured motion, `screen` fits curves and
library models to it and predicts moves that took no part, and `decision` lets a library effect keep
its name only where no curve over a coordinate predicts these moves better; `beside` has curves and
effects together. `innovations` fits curves to innovations, where the force does not decide.
`description` puts curves together to what a twin has of a force that no effect explains.
"""

from sim2real.rivals.beside import Beside as Beside
from sim2real.rivals.decision import Rivals as Rivals
from sim2real.rivals.decision import find_rivals as find_rivals
from sim2real.rivals.description import Description as Description
from sim2real.rivals.description import describe_force as describe_force
from sim2real.rivals.innovations import Innovations as Innovations
from sim2real.rivals.screen import GROUPS as GROUPS
from sim2real.rivals.screen import Curve as Curve
from sim2real.rivals.screen import Screen as Screen
