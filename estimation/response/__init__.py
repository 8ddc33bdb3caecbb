"""How an axis answers to force offsets and to its demand, measured.

`excitation` makes the multisines, `frequency_response` evaluates the record, `sampled_loop` says in
closed form what an axis with given figures would answer, and `fit` finds the figures.
"""

from estimation.response.excitation import Excitation, Shaken, make_excitation
from estimation.response.fit import Fitted, fit
from estimation.response.frequency_response import AxisResponse, FrequencyResponse, evaluate
from estimation.response.sampled_loop import Clocking, Figures, Lines, Resonance

__all__ = [
    "AxisResponse",
    "Clocking",
    "Excitation",
    "Figures",
    "Fitted",
    "FrequencyResponse",
    "Lines",
    "Resonance",
    "Shaken",
    "evaluate",
    "fit",
    "make_excitation",
]
