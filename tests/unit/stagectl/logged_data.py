"""What the machine of examples/emps would have logged, in files of another program."""

from pathlib import Path

from stagectl.importing import import_recording, load_map

EXAMPLE = Path(__file__).parents[3] / "examples" / "emps"
MACHINE = (EXAMPLE / "machine.yaml").read_text()
AXIS = """  slide:
    position_demand: {column: qg}
    position_actual: {column: qm}
    force_actual: {column: vir}
"""


def csv_of(columns, path, header=True, delimiter=","):
    lines = [delimiter.join(columns)] if header else []
    lines += [
        delimiter.join(f"{v:.17g}" for v in row) for row in zip(*columns.values(), strict=True)
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


def read(tmp_path, path, head="", axis=AXIS, machine=MACHINE):
    """A file by a map with this head and these columns of the axis."""
    (tmp_path / "machine.yaml").write_text(machine)
    (tmp_path / "map.yaml").write_text(f"machine: machine.yaml\n{head}axes:\n{axis}")
    return import_recording(path, *load_map(tmp_path / "map.yaml"))


def logged(tmp_path, columns, head="", **options):
    """These columns, from a file `a.csv`."""
    return read(tmp_path, csv_of(columns, tmp_path / "a.csv"), head, **options)
