"""Physical effects beyond the plain model, which a machine file can add to an axis.

One module per effect: `Effect` is what it implements, `EffectPorts` where it enters the plant,
`parameter` makes its parameters, `library` lists those installed. How to add one:
docs/how-to/add-an-effect.md.
"""

from hil_sim.effects.effect import FED_FORWARD as FED_FORWARD
from hil_sim.effects.effect import FRICTION_FACTOR as FRICTION_FACTOR
from hil_sim.effects.effect import HOST as HOST
from hil_sim.effects.effect import STARTED_WITH as STARTED_WITH
from hil_sim.effects.effect import AppliedEffect as AppliedEffect
from hil_sim.effects.effect import Compensation as Compensation
from hil_sim.effects.effect import Effect as Effect
from hil_sim.effects.effect import Values as Values
from hil_sim.effects.parameter import Parameter as Parameter
from hil_sim.effects.parameter import Value as Value
from hil_sim.effects.parameter import asymmetry as asymmetry
from hil_sim.effects.parameter import factor as factor
from hil_sim.effects.parameter import force as force
from hil_sim.effects.parameter import mass as mass
from hil_sim.effects.parameter import oscillator as oscillator
from hil_sim.effects.parameter import phase as phase
from hil_sim.effects.parameter import pitch as pitch
from hil_sim.effects.parameter import place as place
from hil_sim.effects.parameter import shape as shape
from hil_sim.effects.parameter import share as share
from hil_sim.effects.parameter import size as size
from hil_sim.effects.ports import EffectPorts as EffectPorts
