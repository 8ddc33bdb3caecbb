"""`stagectl effects`: the physical effects that the simulator has."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.options import JSON_OUT
from stagectl.cli.terminal import show_result
from stagectl.errors import UnusableInput, unusable

if TYPE_CHECKING:
    from hil_sim.effects import Effect, Parameter

WIDTH = 96


@click.command
@click.argument("names", nargs=-1, metavar="[EFFECT]...")
@JSON_OUT
@click.option("--markdown", is_flag=True, help="Print the table in docs/sim-to-real.md.")
def command(names: tuple[str, ...], json_out: Path | None, markdown: bool) -> None:
    """List the simulator's physical effects; for each EFFECT named, origin, remedy, compensation.

    A machine file switches them on: axes.NAME.effects: [{effect: cogging, amplitude: 1.2,
    pitch: 0.03, phase: 0}]. Effects of installed plug-ins are included.
    """
    from hil_sim.effects.library import EffectError, library
    from stagectl.config.parsing.validation import suggest

    with unusable(EffectError):
        known = library()
    for name in names:
        if name not in known:
            raise UnusableInput(f"unknown effect '{name}'{suggest(name, list(known))}")
    chosen = [known[name] for name in names] if names else list(known.values())
    if markdown:
        lines = markdown_table(chosen)
    elif names:
        lines = ["\n\n".join(map(_details, chosen))]
    else:
        lines = [line for effect in chosen for line in _listed(effect)] if json_out is None else []
    show_result([_as_dict(effect) for effect in chosen], json_out, *lines)


def plausible(parameter: Parameter) -> str:
    """The range found on real stages as text: `0.4…2 N`, `±0.03…0.15 times the mass`."""
    if parameter.role == "table":
        return "a list"
    if parameter.plausible is None:
        return "on the travel" if parameter.role == "place" else "0…2 pi rad"
    low, high = parameter.plausible
    text = f"{'±' if parameter.signed else ''}{low:.3g}…{high:.3g}"
    if parameter.relative_to is not None:
        return f"{text} times the {parameter.relative_to}"
    text = f"{text} {parameter.unit}".rstrip()
    if parameter.plausible_turning is None:
        return text
    low, high = parameter.plausible_turning
    return f"{text}, {low:.3g}…{high:.3g} rad where the axis turns"


def markdown_table(effects: list[Effect]) -> list[str]:
    """Lines of a Markdown table of effects."""
    rows = [
        "| effect | keys: unit, usual range | enters | usual remedy | a host that knows it |",
        "| --- | --- | --- | --- | --- |",
    ]
    for effect in effects:
        keys = "; ".join(
            f"`{p.key}`{f' [{p.unit}]' if p.unit else ''} {plausible(p)}" for p in effect.parameters
        )
        cells = (f"`{effect.name}`", keys, effect.enters, effect.remedy, _compensation(effect))
        rows.append(f"| {' | '.join(cells)} |")
    return rows


def _compensation(effect: Effect) -> str:
    """What a host does that has the effect in its machine file, in a sentence."""
    text = effect.compensation.text
    if effect.compensation.inverse is None:
        return f"Does not compensate it: {text}."
    return f"Compensates it: {text}."


def _describe(parameter: Parameter) -> str:
    unit = f" [{parameter.unit}]" if parameter.unit else ""
    meaning = parameter.meaning or parameter.key
    usually = "" if parameter.role == "table" else "usually "
    return f"{meaning}{unit}, {usually}{plausible(parameter)}"


def _listed(effect: Effect) -> list[str]:
    parameters = (f"    {p.key:<18}{_describe(p)}" for p in effect.parameters)
    return [f"{effect.name:<22}{effect.equation}", *parameters]


def _details(effect: Effect) -> str:
    lines = [effect.name, f"  {effect.equation}", ""]
    lines += [f"  {p.key:<14}{_describe(p)}" for p in effect.parameters]
    for title, text in (
        ("origin", effect.origin()),
        ("enters", effect.enters),
        ("usual remedy", effect.remedy),
        ("a host that has it in its machine file", _compensation(effect)),
    ):
        lines += ["", f"  {title}"]
        lines += textwrap.wrap(text, WIDTH, initial_indent="    ", subsequent_indent="    ")
    return "\n".join(lines)


def _as_dict(effect: Effect) -> dict[str, Any]:
    return {
        "effect": effect.name,
        "group": effect.group,
        "equation": effect.equation,
        "enters": effect.enters,
        "origin": effect.origin(),
        "remedy": effect.remedy,
        "compensated": effect.compensation.inverse is not None,
        "compensation": effect.compensation.text,
        "parameters": [
            {
                "key": p.key,
                "unit": p.unit,
                "meaning": p.meaning,
                "role": p.role,
                "usual": None if p.plausible is None else list(p.plausible),
                "usual_turning": None if p.plausible_turning is None else list(p.plausible_turning),
                "signed": p.signed,
                "relative_to": p.relative_to,
            }
            for p in effect.parameters
        ],
    }
