"""`stagectl identify`: friction parameters, Stribeck curve and hysteresis shape from recordings."""

from __future__ import annotations

import math
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.options import FILE, JSON_OUT, RECORDING
from stagectl.cli.terminal import make_console, show_result
from stagectl.diagnosis import machine_of
from stagectl.errors import UnusableInput

if TYPE_CHECKING:
    from estimation.offline import Figure, Identification

ESTIMATED = ("estimated", "with its neighbours")
"""Verdicts on parameters that the recordings determine."""
FORMAT, VERSION = "stagectl-friction", 1


@click.command
@click.argument("recordings", type=RECORDING, nargs=-1, required=True)
@click.option(
    "--machine",
    type=FILE,
    help="Machine file with the prior values.  [default: that in the first recording]",
)
@click.option("--axis", "only", multiple=True, help="Only this axis; repeat for several.")
@click.option(
    "--elements",
    type=click.IntRange(1, 64),
    help="Maxwell-slip elements.  [default: the machine file's]",
)
@click.option(
    "--shape/--no-shape", default=True, show_default=False, help="Also print every k_i and nu_i."
)
@JSON_OUT
def command(
    recordings: tuple[Path, ...],
    machine: Path | None,
    only: tuple[str, ...],
    elements: int | None,
    shape: bool,
    json_out: Path | None,
) -> None:
    """Estimate the complete friction model from all moves in RECORDINGS of one stage.

    Per axis: Coulomb force, viscous friction, presliding stiffness, relaxation rate, Stribeck
    curve, direction asymmetry and the shape of the hysteresis (k_i, nu_i), together with mass,
    force offset and lag. A parameter about which the recordings say less than its prior keeps the
    prior and is marked. Recordings with many micro-moves in both directions are most informative.

    Forces of the machine file's effects, such as cogging, are subtracted first; effects that scale
    the Coulomb force over place or time are not taken into account.

    "For the machine file" has only values that predict moves better than the machine file's do,
    moves that they were not estimated from. "held out" says for every value whether it does.

    How to read sigma and gain: docs/how-to/identify.md.
    """
    from rich.text import Text

    from stagectl.calibration import identify_axis
    from stagectl.store import read_recording

    read = [read_recording(path) for path in recordings]
    model = machine_of(machine, read[0])
    for name in only:
        if name not in model.axes:
            raise UnusableInput(f"{model.source}: no axis {name!r}, it has {', '.join(model.axes)}")
    console = make_console(stderr=True)
    found: dict[str, Identification] = {}
    for name in only or tuple(model.axes):
        with console.status(Text(f"axis {name}")):
            found[name] = identify_axis(read, model, name, elements)
    lines = (line for name, answer in found.items() for line in _lines(name, answer, shape))
    show_result(_report(found, recordings, model.name), json_out, *lines)


def _report(
    found: dict[str, Identification], recordings: tuple[Path, ...], machine: str
) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "version": VERSION,
        "machine": machine,
        "recordings": [str(path) for path in recordings],
        "axes": {
            name: {
                "refused": answer.reason,
                "misfit": {
                    "before": _finite(answer.before),
                    "after": _finite(answer.misfit),
                    "held_out": _finite(answer.held_out),
                },
                "samples": answer.samples,
                "blocks": answer.blocks,
                "recommended": _machine_values(answer),
                "figures": {
                    f.name: {
                        "unit": f.unit, "prior": f.prior, "prior_sigma": f.prior_sigma,
                        "value": f.value, "sigma": f.sigma, "gain": f.gain, "verdict": f.verdict,
                        "held_out": f.held_out,
                    }
                    for f in answer.figures
                },
            }
            for name, answer in found.items()
        },
    }  # fmt: skip


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _lines(name: str, answer: Identification, shape: bool) -> list[str]:
    """The tables of one axis and their data basis, 80 columns wide."""
    lines = [
        f"Axis {name}",
        f"  {'parameter':23s} {'prior':>15s} {'estimate':>20s} {'gain':>6s}  verdict",
    ]
    springs = [f for f in answer.figures if f.name.startswith("k_")]
    shares = [f for f in answer.figures if f.name.startswith("nu_")]
    for f in answer.figures:
        if f not in springs and f not in shares:
            label = f"{f.name} [{f.unit}]" if f.unit else f.name
            value, gain = _estimate(f)
            lines.append(f"  {label:23s} {_prior(f):>15s} {value:>20s} {gain:>6s}  {f.verdict}")
    if shape:
        head = f"  {'i':>2s} {'k_i prior':>15s} {'k_i':>18s} {'nu_i prior':>17s} {'nu_i':>18s}"
        lines += ["", head]
        for i, (k, nu) in enumerate(zip(springs, shares, strict=True), 1):
            first, second = _estimate(k)[0] or "prior", _estimate(nu)[0] or "prior"
            lines.append(f"  {i:>2d} {_prior(k):>15s} {first:>18s} {_prior(nu):>17s} {second:>18s}")
    return [*lines, "", *_summary(answer), ""]


def _prior(figure: Figure) -> str:
    return f"{figure.prior:.4g} ± {figure.prior_sigma:.2g}"


def _estimate(figure: Figure) -> tuple[str, str]:
    """Estimate with sigma, and gain; blank if there is no estimate."""
    if figure.verdict not in ESTIMATED:
        return "", ""
    digits = 2
    if figure.value != 0.0 and figure.sigma > 0.0:
        digits += max(0, round(math.log10(abs(figure.value) / figure.sigma)))
    return f"{figure.value:.{digits}g} ± {figure.sigma:.2g}", f"{figure.gain:.3g}"


MACHINE_KEYS = (
    "coulomb", "static_ratio", "stribeck_velocity", "stribeck_shape", "stiffness", "viscous",
)  # fmt: skip
_TESTED = (*MACHINE_KEYS, "relaxation_rate")
_HELD_OUT = {
    "better": "Each alone predicts held-out moves better, all together do not",
    "no better": "Held-out moves are predicted as well with the prior",
    "worse": "Held-out moves are predicted better with the prior",
    "untested": "Not tested, for too few moves to hold any out",
}
"""What held-out moves say of estimates that are not recommended."""
_ADVICE = (
    "  'stagectl gap diagnose --twin TWIN.yaml' may name what else acts; with",
    "  '--machine TWIN.yaml' it is subtracted here.",
)


def _machine_values(answer: Identification) -> dict[str, float]:
    """What is recommended, by the machine file's keys.

    It has C where the estimate is C/Fc; a new Fc alone keeps that ratio.
    """
    found = answer.recommended
    values = {name: found[name] for name in MACHINE_KEYS if name in found}
    if "coulomb" in found or "relaxation_rate" in found:
        rate, coulomb = (
            found.get(name, answer[name].prior) for name in ("relaxation_rate", "coulomb")
        )
        values["attraction"] = rate * coulomb
    return values


def _for_machine_file(answer: Identification) -> list[str]:
    """The recommended values in the machine file's syntax, and what held-out moves say of others.

    At most 80 columns.
    """
    pairs = [f"{name}: {value:.4g}" for name, value in _machine_values(answer).items()]
    rows = [f"    {', '.join(pairs[i : i + 3])}" for i in range(0, len(pairs), 3)]
    lines = ["  For the machine file:", *rows] if rows else ["  No value is worth changing."]
    for verdict, words in _HELD_OUT.items():
        names = [
            f.name
            for f in answer.figures
            if f.verdict == ESTIMATED[0] and f.held_out == verdict and f.name in _TESTED
            and f.name not in answer.recommended
        ]  # fmt: skip
        text = f"{words}: {', '.join(names)}"
        lines += wrap(text, 78, initial_indent="  ", subsequent_indent="    ") if names else []
    return lines


def _summary(answer: Identification) -> list[str]:
    """The data basis of the estimates, and how well the model fits."""
    if answer.reason is not None:
        return [
            f"  Nothing estimated: {answer.reason}.",
            *(_ADVICE * ("residual" in answer.reason)),
        ]
    held = f", {answer.held_out:.2f} on held-out moves" if math.isfinite(answer.held_out) else ""
    return [
        f"  {answer.samples} samples in motion, {answer.blocks} blocks. Residual over noise:",
        f"  {answer.before:.2f} with the priors, {answer.misfit:.2f} fitted{held}; 1 is ideal.",
        *_for_machine_file(answer),
    ]
