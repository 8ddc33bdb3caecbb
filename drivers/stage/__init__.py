"""The stage as the application sees it, from the opening of its bus to its closing.

`session` opens and closes, `watching` shows the state, `power` boots, homes, enables and stops,
`streams` (csp, csv, cst) and `profiles` (pp) move; `Stage` is all of them.
"""

from drivers.stage.stage import Stage as Stage
