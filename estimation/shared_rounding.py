"""Where a rounded force hardly changes, its samples share one rounding error.

Taken for white noise, a hundred equal codes of a stage at constant speed would tell its force to a
thirtieth of a step; they tell it to a third, however many there are. How much of the error is
shared, codes and model say: all of it where there is one code and the force stays in its place, the
less the farther it runs through the code, or the more evenly two of them take turns.
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

    L samples whose common error has the variance c are as good as L apart with a variance of L c.
    Of a force that stays anywhere in a code, c is 1/12 of step^2; on the border of two that come as
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
        if abs(force[k + 1 + LONG] - first) > step + near or not use[k]:
            k += STRIDE
            continue
        while k > done and use[k - 1] and abs(force[k] - first) <= near:
            k -= 1
        end, number, others, other = k, 0, 0, first
        while end < count:
            code = force[end + 1]
            if use[end]:
                if abs(code - first) > near:
                    if others == 0 and abs(abs(code - first) - step) <= near:
                        other = code
                    if abs(code - other) > near:
                        break
                    others += 1
                number += 1
            end += 1
        if number > (LONG if others == 0 else LONGER):
            stays = max(1.0 - _run(force, residual, jitter, k, end) / step, 0.0)
            apart = others / number - 0.5
            common = (stays * step) ** 2 * (apart * apart if others > 0 else 1.0 / 12.0)
            for j in range(k, end):
                variance[j] += common * number
        k = done = end


@kernel()
def _run(force, residual, jitter, begin, end):  # type: ignore[no-untyped-def]
    """How far the predicted force runs from one row to another, by the means of both halves [N].

    At least, for what the positions' noise makes of these (of second differences' sums little is
    left: three first differences, the one in the middle twice).
    """
    half = (end - begin) // 2
    before = after = 0.0
    for j in range(half):
        before += residual[begin + j] + force[begin + j + 1]
        after += residual[end - 1 - j] + force[end - j]
    return max(2.0 * (abs(after - before) - math.sqrt(12.0) * jitter) / half, 0.0)
