"""`stagectl gap import`: data of other programs as a recording."""

from __future__ import annotations

from pathlib import Path

import click

from stagectl.cli.file_kinds import RECORDING
from stagectl.cli.files import Output, check_output
from stagectl.cli.options import FILE


@click.command("import")
@click.argument("data", type=FILE)
@click.option("--map", "how", type=FILE, required=True, help="Map of columns to channels (YAML).")
@click.option(
    "--out", type=Output(RECORDING), help="Recording to write.  [default: DATA.h5 in this folder]"
)
def import_data(data: Path, how: Path, out: Path | None) -> None:
    """Convert data of another program into a recording that the other gap commands read.

    DATA is a .mat, .npz or HDF5 file, a CODESYS trace (.trace, .xml) or text (.csv, ...). The map
    names the column, unit, factor and delay of each channel, and the machine file of the stage; its
    drives may have a PID or a cascaded position loop. All keys: docs/sim-to-real.md; example:
    examples/emps.
    """
    from stagectl.importing import doubtful_positions, import_recording, load_map, unlike_rotary
    from stagectl.store import write_recording

    target = Path(f"{data.stem}.h5") if out is None else out
    check_output(target, RECORDING)
    columns, machine = load_map(how)
    recording = import_recording(data, columns, machine)
    write_recording(recording, target)
    for name in unlike_rotary(columns, machine):
        click.echo(
            f"axis {name}: units of a rotary axis, but no `rotary: true` in {machine.source}: a "
            "diagnosis will not look for the weight of what it carries (unbalance)",
            err=True,
        )
    for text in doubtful_positions(recording):
        click.echo(f"axis {text}, measured by position_demand: check the map", err=True)
    seconds = recording.time[-1]
    click.echo(
        f"{target}: {len(recording)} samples, {seconds:.4g} s, {len(recording.moves)} moves, "
        f"axes {', '.join(recording.axes)}"
    )
