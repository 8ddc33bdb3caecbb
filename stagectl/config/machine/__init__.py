"""Machine files: what one holds (`model`, with `drive`, `plant` and `effect`), read by `file`.

`checks` and `plausible` refuse what cannot be. `unknown` is what a file leaves open for a diagnosis
to find; `twin` adds what one has found.
"""

from stagectl.config.machine.drive import Cascade, Drive, Quirks
from stagectl.config.machine.effect import Effect
from stagectl.config.machine.file import load_machine, parse_machine
from stagectl.config.machine.model import (
    Axis,
    AxisName,
    Label,
    LengthPair,
    Machine,
    Name,
)
from stagectl.config.machine.twin import render_twin

__all__ = [
    "Axis",
    "AxisName",
    "Cascade",
    "Drive",
    "Effect",
    "Label",
    "LengthPair",
    "Machine",
    "Name",
    "Quirks",
    "load_machine",
    "parse_machine",
    "render_twin",
]
