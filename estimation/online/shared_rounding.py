"""Where a rounded force changes evenly, its samples share one rounding error.

Taken for white noise, a hundred equal codes of a stage at constant speed would tell its force to a
thirtieth of a step; they tell it to a third, however many there are. The same where it changes by
whole steps from sample to sample, as viscous friction can at constant acceleration. How much of the
error is shared, codes and model say: all of it where there is one code (on a line of whole steps)
and the force stays in its place, the less the farther it runs through the code, or the more evenly
two of them take turns.
"""

from __future__ import annotations

import math

from estimation.compiled import kernel

LONG, LONGER, STRIDE = 8, 24, 4
"""More samples than that in one code are no chance, nor so many in two; looked for at every so many
of them."""
NEAR = 1e-3
"""So close to whole steps are differences of codes [steps]."""


@kernel()
def share_rounding(force, residual, use, step, jitter, variance):  # type: ignore[no-untyped-def]
    """Let the variance of rows grow where they share an error, until together they say what is so.

    L samples whose mean error has the variance c are as good as L apart with a variance of L c. Of
    a force that stays anywhere in a code, c is 1/12 of step^2; on the border of two that come as
    often as s and 1 - s, the mean is s - 1/2 off. Both are less by the share D of a code that it
    runs through: (1 - D)^2.

    Args:
        force: measured [N], shape (K + 2,).
        residual: predicted minus measured force of the inner samples [N], shape (>= K,).
        use: which of these count, shape (K,).
        step: between codes, if the force has any [N].
        jitter: of the residual, by one position's noise in the acceleration [N].
        variance: of the rows [N^2], shape (K,); grows.
    """
    count = use.shape[0]
    near = NEAR * step
    k = done = 0
    while k + LONG < count:
        first = force[k + 1]
        rise = step * math.floor((force[k + 1 + LONG] - first) / (LONG * step) + 0.5)
        ahead = force[k + 2] - first - rise
        if abs(ahead) > step + near or abs(ahead + rise - force[k + 3] + force[k + 2]) > 2.1 * step:
            k += STRIDE
            continue
        begin = k
        while (
            begin > done
            and use[begin - 1]
            and abs(force[begin] + rise * (k + 1 - begin) - first) <= near
        ):
            begin -= 1
        end, number, others, other = begin, 0, 0, 0.0
        while end < count:
            off = force[end + 1] - first - rise * (end - k)
            if use[end]:
                if abs(off) > near:
                    if others == 0 and abs(abs(off) - step) <= near:
                        other = off
                    if abs(off - other) > near or number == 0:
                        break
                    others += 1
                number += 1
            end += 1
        if number > (LONG if others == 0 else LONGER):
            stays = max(1.0 - _run(force, residual, rise, jitter, begin, end) / step, 0.0)
            apart = others / number - 0.5
            common = (stays * step) ** 2 * (apart * apart if others > 0 else 1.0 / 12.0)
            grows = common * number - step * step / 12.0
            for j in range(begin, end if grows > 0.0 else begin):
                variance[j] += grows
        k = done = max(end, k + 1)


@kernel()
def _run(force, residual, rise, jitter, begin, end):  # type: ignore[no-untyped-def]
    """How far the predicted force runs from a line with the slope `rise`, by the means of halves.

    At least [N], for what the positions' noise makes of these: of second differences' sums three
    first differences are left, the one in the middle twice.
    """
    half = (end - begin) // 2
    total = 0.0
    for j in range(half):
        total += residual[end - 1 - j] + force[end - j] - residual[begin + j] - force[begin + j + 1]
    total -= rise * half * (end - begin - half)
    return max(2.0 * (abs(total) - math.sqrt(12.0) * jitter) / half, 0.0)
