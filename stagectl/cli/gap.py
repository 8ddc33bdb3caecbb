"""`stagectl gap`: the difference between simulation and recording, and its causes."""

from __future__ import annotations

import click

from stagectl.cli.lazy import LazyGroup

COMMANDS = {
    "measure": ("stagectl.cli.gap_measure:measure", "Measure the gap of a machine file."),
    "compare": ("stagectl.cli.gap_compare:compare", "Compare two machine files, or two runs."),
    "diagnose": ("stagectl.cli.gap_diagnose:diagnose", "Find the physical causes of the gap."),
    "excite": ("stagectl.cli.gap_excite:excite", "Write a recipe that tells effects apart."),
    "blind": ("stagectl.cli.gap_blind:blind", "Test the diagnosis on simulated stages."),
    "import": (
        "stagectl.cli.gap_import:import_data",
        "Convert data of another program to a recording.",
    ),
}


@click.group(cls=LazyGroup, lazy=COMMANDS)
def command() -> None:
    """Compare what a stage recorded with what its machine file's simulation predicts.

    The gap is the rms of recorded minus simulated position and force. Its floor is the part that
    even a perfect model leaves: encoder noise and the friction's own scatter.

    \b
    How large is it?
      stagectl gap measure REC.h5
    Which moves show most? Record what this recipe runs:
      stagectl gap excite --out EXCITE.yaml
    What causes it? Write an improved machine file (a twin), too:
      stagectl gap diagnose REC.h5 --twin TWIN.yaml
    How much closer is the twin, on a recording that it was not fitted to?
      stagectl gap compare MACHINE.yaml TWIN.yaml OTHER.h5
    Does the stage settle faster, now that its host has the twin?
      stagectl run RECIPE.yaml --machine TWIN.yaml --out AFTER
      stagectl gap compare REC.h5 AFTER/recording.h5
    """  # noqa: D301  (\b keeps click from wrapping what follows)
