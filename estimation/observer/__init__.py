"""The settling observer: estimates an axis' disturbance force from its position at every SYNC.

`loop` (the axis in its drive, linear), `model` (what the observer assumes, with its Kalman gain),
`sensitivity` (of the whole loop), `measured` (its margins by a measured response), `design` (the
largest gain that is safe), `filter`, `kernel` and `observer` (what happens between two SYNCs),
`watch` (whether it feeds an oscillation), `feedforward_error` (what a whole move lacked),
`lacking_force` (its least squares), `learned_feedforward` (what moves have in common), `sticking`
(friction without presliding).
"""

from estimation.observer.design import AxisFigures as AxisFigures
from estimation.observer.design import Design as Design
from estimation.observer.design import design_observer as design_observer
from estimation.observer.feedforward_error import COUPLING as COUPLING
from estimation.observer.feedforward_error import LEAD as LEAD
from estimation.observer.feedforward_error import MASS as MASS
from estimation.observer.feedforward_error import FeedforwardErrors as FeedforwardErrors
from estimation.observer.lacking_force import Course as Course
from estimation.observer.learned_feedforward import LearnedFeedforward as LearnedFeedforward
from estimation.observer.loop import Carriage as Carriage
from estimation.observer.loop import DriveLoop as DriveLoop
from estimation.observer.loop import Mode as Mode
from estimation.observer.measured import MeasuredLoop as MeasuredLoop
from estimation.observer.observer import BusUnits as BusUnits
from estimation.observer.observer import Finding as Finding
from estimation.observer.observer import Kind as Kind
from estimation.observer.observer import StageObserver as StageObserver
from estimation.observer.sticking import sticks as sticks
from estimation.observer.sticking import without_presliding as without_presliding
