"""Writes docs/paper.md: tables, claims and sensitivity in Markdown, with plots."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

from stagectl.paper import plots, published, simulate
from stagectl.paper.fit import Fit
from stagectl.paper.fixed_force import BOUNDS_NAMES, INITIAL_NAMES, on_bound, times_fewer
from stagectl.paper.published import PARAMETERS, TABLES, Printed
from stagectl.paper.sensitivity import Row
from stagectl.paper.study import NOISY_RUNS, Study
from stagectl.paper.tables import ALIGNMENTS, Case, error
from stagectl.store.atomic import write_atomically

MOVE_PLOT, ZONES_PLOT = "images/paper-move.svg", "images/paper-zones.svg"
_INITIAL = {
    "tied": "S(v)",
    "reference": "S(v) under the reference values",
    "measured": "(u - m a - sigma_v v)",
}
METHOD_NAMES = {"one_window": "one window", "two_windows": "two windows"}


def write(study: Study, path: Path) -> None:
    """Write the page, and its plots into `images/` beside it."""
    write_atomically(path, render(study), "page")
    (path.parent / "images").mkdir(exist_ok=True)
    write_atomically(path.parent / MOVE_PLOT, plots.move(study), "plot")
    write_atomically(path.parent / ZONES_PLOT, plots.zones(study), "plot")


def render(study: Study) -> str:
    """The page's text."""
    parts = [
        _head(study.case), _tables(study), _fixed_force(study), _claims(study), _plots(),
        _sensitivity(study),
    ]  # fmt: skip
    return "\n\n".join(part for part in parts if part) + "\n"


def choices(case: Case) -> list[tuple[str, str]]:
    """What the paper leaves open, and our choice."""
    setup, processing, borders, options = (
        case.setup,
        case.processing,
        case.borders,
        case.options,
    )
    kp, ki, kd = simulate.gains(setup.bandwidth)
    profile = {
        "sine": "one period of a sine as acceleration",
        "jerk-limited": f"jerk-limited, {simulate.JERK:g} m/s³",
    }[setup.profile]
    cut_off = (
        "none"
        if processing.cut_off is None or processing.cut_off >= setup.rate / 2
        else f"Butterworth of order {processing.order}, {processing.cut_off:g} Hz, forward and "
        "backward, over velocity, acceleration"
        + (" and force" if processing.filter_force else ", not force")
    )
    onset = (
        "where all elements of the plant slip" if borders.onset is None else f"{borders.onset:g} m"
    )
    return [
        (
            "sample rate",
            f"{setup.rate / 1e3:g} kHz, controller and samples; "
            f"the mass at {simulate.PLANT_RATE / 1e3:g} kHz",
        ),
        (
            "profile",
            f"{profile}; {1e3 * simulate.duration(setup.profile):.0f} ms. 0.5 m/s is never "
            "reached within 25 mm at 3 m/s²",
        ),
        (
            "gains",
            f"kp {kp:.0f} N/m, ki {ki:.3g} N/(m s), kd {kd:.0f} N s/m: three equal poles, "
            f"-3 dB at {setup.bandwidth:g} Hz; "
            + ("acceleration feedforward" if setup.feedforward else "no feedforward"),
        ),
        ("derivatives", "central differences of the position"),
        ("filter", cut_off),
        ("zone A", f"from {onset} to the first velocity that is not positive"),
        ("zone B", f"the {borders.stick * 1e3:g} ms behind that"),
        (
            "initial element forces",
            "the window's initial total is an unknown"
            if options.initial == "free"
            else f"nu_i {_INITIAL[options.initial]} in zone A, nu_i times zone A's final total in "
            "zone B",
        ),
        (
            "p >= 0",
            "each step minimises within the bounds"
            if options.bounds == "bounded"
            else "a step that would leave the bounds is halved as a whole until it does not",
        ),
        ("Jacobian", f"forward {options.jacobian}" if options.jacobian == "differences"
         else "the model's own sensitivities"),
    ]  # fmt: skip


def pair(value: float, sigma: float, name: str, decimals: int = 5) -> str:
    """Value and deviation as the paper prints them, sigma0 in kN/m."""
    unit = 1e-3 if name == "stiffness" else 1.0
    return f"{value * unit:.{decimals}f} ± {_small(sigma * unit)}"


def percent(share: float) -> str:
    """A relative error in %; below 0.0005 % it is 0."""
    value = 100 * share
    if abs(value) < 5e-4:
        return "0"
    return f"{value:+.0f}" if abs(value) >= 99.5 else f"{value:+.2g}"


def errors(row: Row) -> list[str]:
    """Errors of a choice in %, in the order of the parameters; or the reason for having none."""
    if row.fit is None:
        return [row.problem, "", "", ""]
    return [percent(error(row.fit, name)) for name in PARAMETERS]


def table_rows(study: Study) -> list[list[str]]:
    """Tables I and II: name, reference, start, the paper's columns, then ours."""
    ours = [study.tables[method][force] for force in ALIGNMENTS for method in TABLES]
    papers = list(TABLES.values())
    start = study.case.options.start
    rows = []
    for name in PARAMETERS:
        unit = 1e-3 if name == "stiffness" else 1.0
        symbol = "sigma0 [kN/m]" if name == "stiffness" else published.SYMBOLS[name]
        rows.append(
            [
                symbol,
                f"{published.REFERENCE[name] * unit:g}",
                f"{start[name] * unit:g}",
                *(f"{p.value[name] * unit:g} ± {p.sigma[name] * unit:g}" for p in papers),
                *(pair(fit.value[name], fit.sigma[name], name) for fit in ours),
            ]
        )
    columns: list[Printed | Fit] = [*papers, *ours]
    rows.append(["MSE(u) [N²]", "", "", *(_small(c.mse, 2) for c in columns)])
    for kind in ("iterations", "evaluations"):
        counts = (" + ".join(map(str, getattr(c, kind))) for c in columns)
        rows.append([kind, "", "", *counts])
    return rows


def table_head() -> list[str]:
    """The head of `table_rows`."""
    ours = [f"{force}, {METHOD_NAMES[m]}" for force in ALIGNMENTS for m in TABLES]
    return ["", "reference", "start", *(f"paper, {METHOD_NAMES[m]}" for m in TABLES), *ours]


def _head(case: Case) -> str:
    rows = [[f"{name}", text] for name, text in choices(case)]
    return "\n\n".join(
        [
            "# The source paper's section IV, simulated again",
            "<!-- Made by `stagectl paper --out docs/paper.md`. Don't edit. -->",
            "M. Boegli, T. De Laet, J. De Schutter, J. Swevers: *A Split-Horizon Scheme for "
            "On-line Friction Parameter Estimation*. This page compares its tables and claims "
            "with a simulation of the same experiment: "
            f"{published.DISTANCE * 1e3:g} mm under a PID of 100 Hz, "
            f"N = {published.PLANT_ELEMENTS} elements in the plant and "
            f"N = {published.MODEL_ELEMENTS} in the model, no noise, first iterate at half the "
            "reference values. The fit is the paper's: unweighted, no prior, deviations from "
            "MSE (J'J)^-1. Plant and model share no code.",
            "`stagectl paper --out docs/paper.md` writes this page and its plots; the options of "
            "`stagectl paper` change what the paper leaves open:",
            _markdown(["left open", "here"], rows),
        ]
    )


def _tables(study: Study) -> str:
    return "\n\n".join(
        [
            "## Tables I and II",
            _markdown(table_head(), table_rows(study)),
            "*Logged*: force as commanded at the sample. It is held until the next sample, so on "
            "average it acts half a period later than the position was measured. *Aligned*: mean "
            "of the commands before and after the sample. ± is one standard deviation. Counts of "
            "two windows: zone A + zone B. An evaluation is one pass of the model over a window, "
            "those for the differences included.",
            _deviations(study),
        ]
    )


def _deviations(study: Study) -> str:
    """How the printed deviations compare with MSE (J'J)^-1 at the printed MSE."""
    paper, fit = TABLES["one_window"], study.tables["one_window"]["logged"]
    shares = [
        paper.sigma[name] / (fit.sigma[name] * math.sqrt(paper.mse / fit.mse))
        for name in PARAMETERS
        if fit.sigma[name] > 0
    ]
    return (
        "The paper's deviations do not follow from its MSE: with this Jacobian, MSE (J'J)^-1 at "
        f"the MSE printed for one window gives deviations that are {min(shares):.0f} to "
        f"{max(shares):.0f} times smaller than those printed."
    )


def fixed_rows(study: Study) -> list[list[str]]:
    """With zone A's initial force fixed: a row per choice, alignment and method."""
    rows = []
    for variant in study.fixed:
        fewer = times_fewer(variant.tables)
        for force in ALIGNMENTS:
            for method in TABLES:
                fit = variant.tables[method][force]
                rows.append(
                    [
                        BOUNDS_NAMES[variant.bounds],
                        INITIAL_NAMES[variant.initial],
                        force,
                        METHOD_NAMES[method],
                        *(pair(fit.value[n], fit.sigma[n], n, 3) for n in PARAMETERS),
                        _small(fit.mse, 2),
                        " + ".join(map(str, fit.iterations)),
                        " + ".join(map(str, fit.evaluations)),
                        f"{fewer[force]:.1f}" if method == "two_windows" else "",
                    ]
                )
    return rows


def fixed_head() -> list[str]:
    """The head of `fixed_rows`."""
    names = ["Fc [N]", "C [N/s]", "sigma_v [N s/m]", "sigma0 [kN/m]", "MSE(u) [N²]"]
    counts = ["iterations", "evaluations", "times fewer"]
    return ["steps", "zone A begins at", "force", "", *names, *counts]


def _fixed_force(study: Study) -> str:
    stuck = []
    for bounds, words in BOUNDS_NAMES.items():
        fits = [
            v.tables["one_window"][f] for v in study.fixed if v.bounds == bounds for f in ALIGNMENTS
        ]
        ends = [on_bound(fit) for fit in fits]
        names = sorted({published.SYMBOLS[name].split(" ")[0] for end in ends for name in end})
        where = f" ({' and '.join(names)} at 0)" if names else ""
        stuck.append(f"{words} {sum(map(bool, ends))} of {len(ends)}{where}")
    return "\n\n".join(
        [
            "## Zone A's initial force fixed",
            "Above, zone A's initial force is S(v) of the iterate: it follows Fc. The paper's "
            "counts, parameters + 2 evaluations per iteration, say that it was no unknown, not "
            "what it was. Here it does not follow Fc: it is S(v) under the reference values, or "
            "what the first sample measures. *Bounded*: each step minimises within p >= 0. "
            "*Shortened*: the Gauss-Newton step is halved as a whole until it stays within; "
            "where one parameter is at 0, the others stop with it.",
            _markdown(fixed_head(), fixed_rows(study)),
            f"Fits of one window that stop on a bound: {', '.join(stuck)}.",
        ]
    )


def _claims(study: Study) -> str:
    kinds = [claim.verdict for claim in study.claims]
    whole, none = kinds.count("reproduced"), kinds.count("not reproduced")
    parts = [
        "## The claims",
        f"Of {len(kinds)} claims {whole} are reproduced, {len(kinds) - whole - none} under a "
        f"condition, {none} not. *Nearer* and *surer* mean by a tenth at least.",
    ]
    for number, claim in enumerate(study.claims, 1):
        verdict = claim.verdict[:1].upper() + claim.verdict[1:]
        parts.append(f"{number}. {claim.claim}\n\n   **{verdict}.** {claim.figure}")
    return "\n\n".join(parts)


def _plots() -> str:
    return "\n\n".join(
        [
            "## The move and the fit",
            f"![Position, velocity and force of the move over time]({MOVE_PLOT})",
            "*As the paper's figure 3. Dashed: the demand. Shaded: zones A and B.*",
            f"![Measured and predicted force in zones A and B]({ZONES_PLOT})",
            "*As the paper's figure 4: measured force and the one predicted with the two-window "
            "estimate, force aligned; below, their difference. It peaks where a zone begins: the "
            "filter rounds the kink in the measured force, the model's keeps it.*",
        ]
    )


def _sensitivity(study: Study) -> str:
    if not study.sensitivity:
        return ""
    rows = []
    last = ""
    for row in study.sensitivity:
        name = row.group if row.group != last else ""
        last = row.group
        mse = "" if row.fit is None else _small(row.fit.mse, 2)
        rows.append([name, row.choice, *errors(row), mse])
    return "\n\n".join(
        [
            "## What the paper leaves open, varied",
            "Two windows; one choice at a time is changed, the rest is as in the table at the top, "
            "force aligned unless said. Errors in % of the reference value; -100 is the bound "
            "0; below 0.0005 % stands 0. "
            f"The fourth claim's spread is over {NOISY_RUNS} runs.",
            _markdown(["choice", "", "Fc", "C", "sigma_v", "sigma0", "MSE(u) [N²]"], rows),
        ]
    )


def _markdown(head: list[str], rows: Iterable[list[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _small(value: float, digits: int = 1) -> str:
    """Below 0.001 as 1e-4."""
    if value == 0 or abs(value) >= 1e-3:
        return f"{value:.{digits}g}"
    mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
    return f"{mantissa}e{int(exponent)}"
