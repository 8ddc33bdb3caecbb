"""Once around the loop of a diagnosis on the virtual stage: writes docs/loop.md.

    python -m benchmarks.gap.loop [--docs docs]

Runs the commands of the page in a folder of their own and writes them down with what they print.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
STAGE = "examples/loop/stage.yaml"

PAGE = """# Once around the loop

Written by `python -m benchmarks.gap.loop`; anyone can run these commands again from a clone.

The stage is virtual: the reference stage with cogging of 0.5 N and a pitch of 32 mm on x
([stage.yaml](../{stage})), of which the host knows nothing. The question is the usual one: the
stage does not follow as simulated, and why?

## An ordinary run says too little

Four sites, 20 mm apart:

{run}
{first}
There is a gap, but 20 mm are less than a pitch, and there a force that waves over position looks
like others. So the tool names no cause; it lists what is alike, and writes the moves that would
tell most into `next.yaml`. On the page, `short.html`, the force that the model lacks is drawn over
position and velocity: it changes with position, and alike in both directions.

## The proposed experiment

{next_run}
{both}
Both recordings are fitted together. The cause has a name now; but the proposed moves stay where the
first recording has been, so pitch and amplitude are known only roughly, and what is left still has
structure.

## An experiment over more of the stage

`gap excite` needs no recording, only the limits of the machine: slow sweeps, strokes at several
speeds, small reversals and chirps.

{excite}
{excited}
## The loop closed

The twin goes to the host, which makes up for what was found:

{after}
`compare` holds the machine file inside each recording against both recordings.
"""


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--docs", type=Path, default=ROOT / "docs")
    docs = parser.parse_args().docs
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree(ROOT / "examples" / "loop", folder / "examples" / "loop")

        def printed(*commands: str) -> str:
            blocks = []
            for command in commands:
                print(command, flush=True)
                blocks.append(f"```console\n$ {command}\n{_output(command, folder)}```\n")
            return "\n".join(blocks)

        sites, simulate = "examples/loop/four-sites.yaml", f"--simulate {STAGE}"
        text = PAGE.format(
            stage=STAGE,
            run=printed(f"stagectl run {sites} {simulate} --out short | tail -1"),
            first=printed(
                "stagectl gap diagnose short/recording.h5 --next next.yaml --html short.html"
            ),
            next_run=printed(f"stagectl run next.yaml {simulate} --out next | tail -1"),
            both=printed("stagectl gap diagnose short/recording.h5 next/recording.h5"),
            excite=printed(
                "stagectl gap excite --axis x --out excite.yaml",
                f"stagectl run excite.yaml {simulate} --out excite | tail -1",
            ),
            excited=printed(
                "stagectl gap diagnose short/recording.h5 excite/recording.h5 --twin twin.yaml"
            ),
            after=printed(
                f"stagectl run {sites} --machine twin.yaml {simulate} --out after | tail -1",
                "stagectl gap compare short/recording.h5 after/recording.h5",
            ),
        )
    (docs / "loop.md").write_text(text, encoding="utf-8")


def _output(command: str, folder: Path) -> str:
    """What a command prints, without spaces at the ends of lines."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "COLUMNS": "100", "NO_COLOR": "1"}
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", command],
        cwd=folder, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        sys.exit(f"{command}: {done.stderr or done.stdout}")
    return "".join(f"{line.rstrip()}\n" for line in done.stdout.rstrip().splitlines())


if __name__ == "__main__":
    main()
