"""The gap between a stage and its model: free-run simulation against a recording.

`replay` runs the recorded demands through the model's closed loop, `floor` estimates what noise and
friction wander alone would leave, `measure` computes the gap from both, and `location` finds the
conditions of motion that hold most of it. Nothing is fitted here.
"""

from sim2real.gap.floor import DRAWS as DRAWS
from sim2real.gap.floor import LARGEST_OF_PERFECT as LARGEST_OF_PERFECT
from sim2real.gap.floor import PERFECT_MODEL as PERFECT_MODEL
from sim2real.gap.floor import Floor as Floor
from sim2real.gap.floor import RepeatCheck as RepeatCheck
from sim2real.gap.location import Located as Located
from sim2real.gap.location import locate_gap as locate_gap
from sim2real.gap.measure import NO_GAP_BELOW as NO_GAP_BELOW
from sim2real.gap.measure import Gap as Gap
from sim2real.gap.measure import GapMeter as GapMeter
from sim2real.gap.measure import Measured as Measured
from sim2real.gap.measure import combined_floors as combined_floors
from sim2real.gap.measure import combined_gap as combined_gap
from sim2real.gap.measure import compare_with_model as compare_with_model
from sim2real.gap.measure import gap_closed as gap_closed
from sim2real.gap.measure import measure_gap as measure_gap
from sim2real.gap.measure import pool_gaps as pool_gaps
from sim2real.gap.quantisation import coarse_steps as coarse_steps
from sim2real.gap.quantisation import quantisation_step as quantisation_step
from sim2real.gap.quantisation import stated_step as stated_step
from sim2real.gap.replay import Replay as Replay
from sim2real.gap.replay import Signals as Signals
from sim2real.gap.replay import prepare_replay as prepare_replay
from sim2real.gap.replay import rms as rms
from sim2real.gap.replay import run_by_model as run_by_model
from sim2real.gap.replay import subtract_signals as subtract_signals
from sim2real.gap.sync_grid import match_periods as match_periods
from sim2real.gap.sync_grid import number_periods as number_periods
