"""Which effects explain the gap of an axis, judged in the free loop.

In the free loop the closed loop is simulated from its demands alone, and nothing is corrected by
the recording. Where a model is incomplete, values that fit one-step innovations may widen this gap.
`loop` runs the axis under models, `fit` fits them to the free run's residual, `candidates` proposes
where to start each effect, and `search` selects up to six, judged on held-out moves.
"""

from sim2real.free_loop.fit import FreeFit, move_covariance
from sim2real.free_loop.loop import FreeLoop
from sim2real.free_loop.search import FreeSearch, fit_figures, search_free

__all__ = ["FreeFit", "FreeLoop", "FreeSearch", "fit_figures", "move_covariance", "search_free"]
