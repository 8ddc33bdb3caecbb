"""How an axis answers to force offsets and to its demand, measured.

`excitation` makes the multisines, `frequency_response` evaluates the record, `sampled_loop` says in
closed form what an axis with given figures would answer, and `fit` finds the figures.
"""

from estimation.response.excitation import Excitation as Excitation
from estimation.response.excitation import Shaken as Shaken
from estimation.response.excitation import make_excitation as make_excitation
from estimation.response.fit import Fitted as Fitted
from estimation.response.fit import fit as fit
from estimation.response.frequency_response import AxisResponse as AxisResponse
from estimation.response.frequency_response import FrequencyResponse as FrequencyResponse
from estimation.response.frequency_response import evaluate as evaluate
from estimation.response.sampled_loop import Clocking as Clocking
from estimation.response.sampled_loop import Figures as Figures
from estimation.response.sampled_loop import Lines as Lines
from estimation.response.sampled_loop import Resonance as Resonance
