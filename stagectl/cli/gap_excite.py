"""`stagectl gap excite`: a recipe whose recording tells effects apart."""

from __future__ import annotations

from pathlib import Path

import click

from stagectl.cli.file_kinds import RECIPE_FILE
from stagectl.cli.files import Output
from stagectl.cli.options import FILE
from stagectl.errors import UnusableInput


@click.command("excite")
@click.option("--machine", type=FILE, help="Machine file.  [default: the reference stage]")
@click.option("--axis", "axes", multiple=True, metavar="NAME", help="Only this axis; repeatable.")
@click.option("--out", type=Output(RECIPE_FILE), default=Path("excite.yaml"))
def excite(machine: Path | None, axes: tuple[str, ...], out: Path) -> None:
    """Write a recipe whose recording tells physical effects apart.

    Slow sweeps, strokes at several speeds, small reversals and chirps, within the machine's limits
    and travel. Record it with `stagectl run`, then `stagectl gap diagnose` the recording: it tells
    apart what an ordinary run confuses.
    """
    import yaml

    from sim2real.experiment import excite_axes
    from stagectl.config import load_machine, stage_settings
    from stagectl.recipe import dry_run, parse_recipe
    from stagectl.store import write_atomically

    model = load_machine(machine)
    for name in axes:
        if name not in model.axes:
            raise UnusableInput(f"--axis {name}: the machine has {', '.join(model.axes)}")
    recipe = excite_axes(stage_settings(model), axes).recipe(f"excite-{'-'.join(axes) or 'all'}")
    text = "# Made to tell effects apart: stagectl gap excite. SI units.\n" + yaml.safe_dump(
        recipe, sort_keys=False, default_flow_style=None
    )
    seconds = dry_run(parse_recipe(text, str(out), model), model).duration
    write_atomically(out, text, "recipe")
    click.echo(f"{out}: {len(recipe['moves'])} entries, at least {seconds:.0f} s")
