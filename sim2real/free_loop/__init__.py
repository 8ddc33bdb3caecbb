"""Which effects explain the gap of an axis, judged in the free loop.

In the free loop the closed loop is simulated from its demands alone, and nothing is corrected by
the recording. Where a model is incomplete, values that fit one-step innovations may widen this gap.
`loop` runs the axis under models, `fit` fits them to the free run's residual, `candidates` proposes
where to start each effect, and `search` selects up to six, judged on held-out moves.
"""

from sim2real.free_loop.fit import derivatives as derivatives
from sim2real.free_loop.fit import fit_free as fit_free
from sim2real.free_loop.fit import move_covariance as move_covariance
from sim2real.free_loop.loop import FreeLoop as FreeLoop
from sim2real.free_loop.search import FreeSearch as FreeSearch
from sim2real.free_loop.search import fit_alone as fit_alone
from sim2real.free_loop.search import fit_figures as fit_figures
from sim2real.free_loop.search import is_certain as is_certain
from sim2real.free_loop.search import refit_without as refit_without
from sim2real.free_loop.search import search_free as search_free
