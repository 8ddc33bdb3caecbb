"""From a recipe file to a `Recipe` that the machine can run, or to all reasons why it cannot.

Checked before anything moves: each value by itself (schema), sites and moves against the travel
(micro-moves included), profiles against the axis limits, and files that the recipe names.
"""

from __future__ import annotations

from pathlib import Path

from stagectl.config import Machine
from stagectl.config.parsing.validation import sort_problems, validate
from stagectl.config.parsing.yaml_nodes import Document, load_document, parse_document
from stagectl.errors import ConfigError
from stagectl.recipe.checks import Check
from stagectl.recipe.duration_limit import MAX_MOVE, why_too_long
from stagectl.recipe.model import Recipe
from stagectl.recipe.moves import check_path, read_moves
from stagectl.recipe.schema import RecipeFile, Settle, SiteLimits
from stagectl.recipe.sites import check_travel, read_fiducial, read_sites


def load_recipe(path: Path | str, machine: Machine) -> Recipe:
    """The recipe of a file, checked against the machine.

    Raises:
        ConfigError: the recipe cannot be run on this machine; one line per problem.
    """
    return _recipe(load_document(path), machine)


def parse_recipe(text: str, name: str, machine: Machine) -> Recipe:
    """The recipe of a text; the files it names are relative to `name`.

    Raises:
        ConfigError: as `load_recipe`.
    """
    return _recipe(parse_document(text, name), machine)


def _recipe(document: Document, machine: Machine) -> Recipe:
    check = Check(document, machine)
    file = validate(document, RecipeFile)
    check.check_limits(file.macro, ("macro",))
    check.check_limits(file.micro, ("micro",))
    sites, places = read_sites(check, file.sites)
    fiducial = read_fiducial(check, file.fiducial, len(sites))
    _check_keys(check, file)
    _check_settle(check, file.settle)
    if (reason := check.why_never_exceeded(file.settle.window)) is not None:
        check.refuse(("settle", "window"), reason)
    check_travel(check, sites, places, fiducial)
    moves = read_moves(check, file.moves or [], file.macro, file.micro, ("moves",))
    check_path(check, moves)
    if check.problems:
        raise ConfigError(sort_problems(check.problems))
    first, second = machine.axes
    unused = [k for k in ("expose", "fiducial") if moves and getattr(file, k) is not None]
    if moves and file.limits != SiteLimits():
        unused.append("limits")
    notes = [f"{key} has no effect with moves" for key in unused]
    if (reason := check.why_never_exceeded(file.limits.peak_error)) is not None:
        notes.append(f"limits.peak_error: {reason}")
    recipe = Recipe(
        name=file.recipe,
        axes=(first, second),
        macro=file.macro,
        micro=file.micro,
        settle=file.settle,
        expose=file.expose or 0.0,
        sites=sites,
        fiducial=fiducial,
        moves=moves,
        lot=file.lot,
        wafer=file.wafer,
        limits=file.limits,
        text=document.text,
        source=document.name,
        notes=tuple(notes),
    )
    if (reason := why_too_long(recipe)) is not None:
        raise ConfigError(document.problem(("moves",) if moves else ("sites",), reason))
    return recipe


def _check_keys(check: Check, file: RecipeFile) -> None:
    """Check which keys require or exclude each other."""
    if file.sites is None and file.moves is None:
        check.refuse(("sites",), "is missing (or a list of moves instead)")
    elif file.sites is not None and file.moves is not None:
        check.refuse(("moves",), "cannot be combined with sites: only one of them")
    elif file.sites is not None:
        for key in ("expose", "fiducial"):
            if getattr(file, key) is None:
                check.refuse((key,), "is missing")


def _check_settle(check: Check, settle: Settle) -> None:
    """Refuse a window below the encoder's increment and a hold beyond the timeout."""
    coarse = max(axis.encoder.increment for _, axis in check.axes)
    if settle.window < coarse:
        check.refuse(("settle", "window"), f"is below the encoder increment, {coarse:g} m")
    if settle.timeout < settle.hold:
        check.refuse(("settle", "timeout"), f"is shorter than hold, {settle.hold:g} s")
    elif settle.timeout > MAX_MOVE:
        reason = f"{settle.timeout:g} s is longer than the longest move, {MAX_MOVE:g} s"
        check.refuse(("settle", "timeout"), reason)
