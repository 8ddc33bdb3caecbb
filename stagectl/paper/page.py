"""The study as tables, and the page docs/paper.md: tables, claims, plots and sensitivity."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from stagectl.paper import published, simulate
from stagectl.paper.published import PARAMETERS, SYMBOLS, TABLES, Printed
from stagectl.paper.simulate import Move, prepare
from stagectl.paper.study import NOISY_RUNS, Study
from stagectl.paper.tables import (
    ALIGNMENTS,
    CONDITIONS,
    INITIAL_NAMES,
    error,
    one_window_ends,
    times_fewer,
)
from stagectl.report import Line, Panel, Span, draw, render_template
from stagectl.store.atomic import write_atomically

MOVE_PLOT, ZONES_PLOT = "images/paper-move.svg", "images/paper-zones.svg"
_ZONE_A, _ZONE_B = "#e8f1e4", "#fbeede"
_MEASURED, _PREDICTED, _DEMAND = "#1f5fa8", "#c8452b", "#777777"
_METHODS = {"one_window": "one window", "two_windows": "two windows"}
_FIGURES = (
    *("Fc [N]", "C [N/s]", "sigma_v [N s/m]", "sigma0 [kN/m]"),
    *("MSE(u) [N²]", "iterations", "evaluations"),
)


class Table(NamedTuple):
    """A table of texts."""

    title: str
    head: tuple[str, ...]
    rows: list[list[str]]


def write(study: Study, path: Path) -> None:
    """Write the page, and its plots into `images/` beside it."""
    write_atomically(path, render(study), "page")
    (path.parent / "images").mkdir(exist_ok=True)
    write_atomically(path.parent / MOVE_PLOT, plot_move(study), "plot")
    write_atomically(path.parent / ZONES_PLOT, plot_zones(study), "plot")


def render(study: Study) -> str:
    """The page's text."""
    estimates, fixed, *varied = tables(study)
    case = study.case
    verdicts = [claim.verdict for claim in study.claims]
    return render_template(
        "paper.md.j2",
        published=published,
        simulate=simulate,
        case=case,
        duration=simulate.duration(case.profile),
        gains=simulate.gains(case.bandwidth),
        estimates=estimates,
        smaller=_smaller_deviations(study),
        fixed=fixed,
        stuck=_stuck(study),
        claims=study.claims,
        counts=[verdicts.count(verdict) for verdict in ("reproduced", "not reproduced")],
        plots=(MOVE_PLOT, ZONES_PLOT),
        varied=varied[0] if varied else None,
        runs=NOISY_RUNS,
    )


def tables(study: Study) -> list[Table]:
    """Tables I and II; with zone A's initial force fixed; and the sensitivity, if there is one."""
    return [_estimates(study), _fixed(study), *([_varied(study)] if study.sensitivity else [])]


def _estimates(study: Study) -> Table:
    """Tables I and II: reference, start, the paper's columns and ours, as rows."""
    starts = {"reference": published.REFERENCE.values(), "start": study.case.start}
    rows = [
        [name, *(f"{v * _unit(p):g}" for p, v in zip(PARAMETERS, values, strict=True)), "", "", ""]
        for name, values in starts.items()
    ]
    for method, words in _METHODS.items():
        rows.append([f"paper, {words}", *_figures(TABLES[method], None)])
    for force in ALIGNMENTS:
        for method, words in _METHODS.items():
            rows.append([f"{force}, {words}", *_figures(study.tables[method][force], 5)])
    return Table("Tables I and II", ("", *_FIGURES), rows)


def _smaller_deviations(study: Study) -> tuple[str, str]:
    """How many times smaller MSE (J'J)^-1 at the printed MSE is than what is printed, range."""
    paper, fit = TABLES["one_window"], study.tables["one_window"]["logged"]
    shares = [
        paper.sigma[name] / (fit.sigma[name] * math.sqrt(paper.mse / fit.mse))
        for name in PARAMETERS
        if fit.sigma[name] > 0
    ]
    return f"{min(shares):.0f}", f"{max(shares):.0f}"


def _fixed(study: Study) -> Table:
    """With zone A's initial force fixed: a row per choice, alignment and method."""
    rows = []
    for (bounds, initial), found in study.fixed.items():
        fewer = times_fewer(found)
        for force in ALIGNMENTS:
            for method, words in _METHODS.items():
                choice = [bounds, INITIAL_NAMES[initial], force, words]
                gain = f"{fewer[force]:.1f}" if method == "two_windows" else ""
                rows.append([*choice, *_figures(found[method][force], 3), gain])
    head = ("steps", "zone A begins at", "force", "", *_FIGURES, "times fewer")
    return Table("Zone A's initial force fixed", head, rows)


def _stuck(study: Study) -> str:
    """How many fits of one window stop on a bound, by the way in which bounds are kept."""
    words = []
    for bounds in CONDITIONS:
        ends = one_window_ends(study.fixed, bounds)
        names = sorted({SYMBOLS[name] for end in ends for name in end})
        where = f" ({' and '.join(names)} at 0)" if names else ""
        words.append(f"{bounds} {sum(map(bool, ends))} of {len(ends)}{where}")
    return ", ".join(words)


def _varied(study: Study) -> Table:
    rows = []
    last = ""
    for row in study.sensitivity:
        if isinstance(row.fit, str):
            figures = [row.fit, "", "", "", ""]
        else:
            errors = [_percent(error(row.fit, name)) for name in PARAMETERS]
            figures = [*errors, _small(row.fit.mse, 2)]
        rows.append([row.group if row.group != last else "", row.choice, *figures])
        last = row.group
    head = ("choice", "", "Fc", "C", "sigma_v", "sigma0", _FIGURES[4])
    return Table("What the paper leaves open, varied", head, rows)


def plot_move(study: Study) -> str:
    """Position, velocity and force of the move, zones shaded (figure 3)."""
    m = _aligned_move(study)
    shown = slice(0, min(m.end + round(0.02 / m.period), len(m.time)))
    time = 1e3 * m.time
    spans = (
        Span(float(time[m.slide]), float(time[m.turn]), "zone A", _ZONE_A),
        Span(float(time[m.turn]), float(time[m.end - 1]), "zone B", _ZONE_B),
    )
    time = time[shown]
    panels = {
        "position [mm]": (
            Line(time, 1e3 * m.position[shown], colour=_MEASURED),
            Line(time, 1e3 * m.demand[shown], colour=_DEMAND, dashed=True),
        ),
        "velocity [mm/s]": (Line(time, 1e3 * m.velocity[shown], colour=_MEASURED),),
        "force [N]": (Line(time, m.force[shown], colour=_MEASURED),),
    }
    rows = [[Panel("time [ms]", label, lines, spans)] for label, lines in panels.items()]
    return draw(rows, 720, 210, "Position, velocity and force of the move, with both zones")


def plot_zones(study: Study) -> str:
    """Measured and predicted force in zones A and B, and their difference (figure 4)."""
    m = _aligned_move(study)
    fit = study.tables["two_windows"]["aligned"]
    above, below = [], []
    offset = 0
    for name, (first, last) in zip(("zone A", "zone B"), fit.windows, strict=True):
        time, measured = 1e3 * m.time[first:last], m.force[first:last]
        predicted = fit.predicted[offset : offset + last - first]
        offset += last - first
        lines = (
            Line(time, measured, "measured", _MEASURED),
            Line(time, predicted, "predicted", _PREDICTED, dashed=True),
        )
        above.append(Panel("time [ms]", "force [N]", lines, title=name))
        difference = Line(time, 1e3 * (measured - predicted), "", _MEASURED)
        below.append(Panel("time [ms]", "difference [mN]", (difference,)))
    return draw([above, below], 860, 240, "Measured and predicted force in zones A and B")


def _aligned_move(study: Study) -> Move:
    return prepare(replace(study.case, force="aligned"))


def _figures(fit: Printed, decimals: int | None) -> list[str]:
    """Values with deviations as the paper prints them, sigma0 in kN/m; then MSE and counts."""
    pairs = []
    for name in PARAMETERS:
        value, sigma = fit.value[name] * _unit(name), fit.sigma[name] * _unit(name)
        printed = f"{value:g} ± {sigma:g}"
        pairs.append(printed if decimals is None else f"{value:.{decimals}f} ± {_small(sigma)}")
    counts = (" + ".join(map(str, each)) for each in (fit.iterations, fit.evaluations))
    return [*pairs, _small(fit.mse, 2), *counts]


def _unit(name: str) -> float:
    return 1e-3 if name == "stiffness" else 1.0


def _percent(share: float) -> str:
    """A relative error in %; below 0.0005 % it is 0."""
    value = 100 * share
    if abs(value) < 5e-4:
        return "0"
    return f"{value:+.0f}" if abs(value) >= 99.5 else f"{value:+.2g}"


def _small(value: float, digits: int = 1) -> str:
    """Below 0.001 as 1e-4."""
    if value == 0 or abs(value) >= 1e-3:
        return f"{value:.{digits}g}"
    mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
    return f"{mantissa}e{int(exponent)}"
