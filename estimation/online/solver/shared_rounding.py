"""Where a rounded force changes uniformly, its samples share one rounding error.

Under white noise, a hundred equal codes at constant speed would determine the force to a thirtieth
of a step; they determine it to a third, however many there are. The same holds where it changes by
whole steps from sample to sample, as viscous friction can at constant acceleration. All of the
error is shared where there is one code (on a line of whole steps) and the force does not move; less
of it the farther the force runs through the code, or the more evenly two codes alternate.
"""

from __future__ import annotations

import math

from stagedata.compiled import kernel

LONG, LONGER, STRIDE = 8, 24, 4
"""More samples than LONG in one code are no coincidence, nor LONGER in two; searched every STRIDE
samples."""
NEAR = 1e-3
"""Tolerance of differences of codes from whole steps [steps]."""


@kernel()
def share_rounding(force, residual, use, step, jitter, variance):  # type: ignore[no-untyped-def]
    """Inflate the variance of rows that share a rounding error.

    L samples whose mean error has the variance c are worth L independent ones with a variance of
    L c. For a force that stays anywhere in a code, c is step^2/12; on the border of two codes with
    shares s and 1 - s, the mean is s - 1/2 off. Both are reduced by the share D of a code that the
    force runs through: (1 - D)^2.

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
    """Lower bound of how far the predicted force runs from a line with the slope `rise` [N].

    From the means of both halves, less what the positions' noise makes of them: of the sums of
    second differences three first differences are left, the middle one twice.
    """
    half = (end - begin) // 2
    total = 0.0
    for j in range(half):
        total += residual[end - 1 - j] + force[end - j] - residual[begin + j] - force[begin + j + 1]
    total -= rise * half * (end - begin - half)
    return max(2.0 * (abs(total) - math.sqrt(12.0) * jitter) / half, 0.0)
