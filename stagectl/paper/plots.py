"""The paper's figures 3 and 4: the move, and measured against predicted force in both zones."""

from __future__ import annotations

from stagectl.paper.study import Study
from stagectl.report import Line, Panel, Span, draw

_ZONE_A, _ZONE_B = "#e8f1e4", "#fbeede"
_MEASURED, _PREDICTED, _DEMAND = "#1f5fa8", "#c8452b", "#777777"


def move(study: Study) -> str:
    """Position, velocity and force of the move, zones shaded (figure 3)."""
    m = study.move
    shown = slice(0, min(m.end + round(0.02 / m.period), len(m.time)))
    time = 1e3 * m.time[shown]
    demand = study.record.demand[1:-1][shown]
    border = 1e3 * float(m.time[m.turn])
    spans = (
        Span(1e3 * float(m.time[m.slide]), border, "zone A", _ZONE_A),
        Span(border, 1e3 * float(m.time[m.end - 1]), "zone B", _ZONE_B),
    )
    panels = {
        "position [mm]": (
            Line(time, 1e3 * m.position[shown], colour=_MEASURED),
            Line(time, 1e3 * demand, colour=_DEMAND, dashed=True),
        ),
        "velocity [mm/s]": (Line(time, 1e3 * m.velocity[shown], colour=_MEASURED),),
        "force [N]": (Line(time, m.force[shown], colour=_MEASURED),),
    }
    rows = [[Panel("time [ms]", label, lines, spans)] for label, lines in panels.items()]
    return draw(rows, 720, 210, "Position, velocity and force of the move, with both zones")


def zones(study: Study) -> str:
    """Measured and predicted force in zones A and B, and their difference (figure 4)."""
    m = study.move
    fit = study.tables["two_windows"]["aligned"]
    above, below = [], []
    offset = 0
    for name, (first, last) in zip(("zone A", "zone B"), fit.windows, strict=True):
        time = 1e3 * m.time[first:last]
        predicted = fit.predicted[offset : offset + last - first]
        offset += last - first
        measured = m.force[first:last]
        above.append(
            Panel(
                "time [ms]",
                "force [N]",
                (
                    Line(time, measured, "measured", _MEASURED),
                    Line(time, predicted, "predicted", _PREDICTED, dashed=True),
                ),
                title=name,
            )
        )
        difference = 1e3 * (measured - predicted)
        below.append(
            Panel(
                "time [ms]",
                "difference [mN]",
                (Line(time, difference, "", _MEASURED),),
            )
        )
    return draw([above, below], 860, 240, "Measured and predicted force in zones A and B")
