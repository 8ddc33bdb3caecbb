"""`stagectl gap blind`: test the diagnosis on simulated stages with sealed causes."""

from __future__ import annotations

import json
import os
import platform
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.console import console_for, join_phases, progress_bar
from stagectl.cli.file_kinds import PAGE
from stagectl.cli.files import Output
from stagectl.cli.options import FILE, JSON_OUT, is_json_on_stdout, write_json

if TYPE_CHECKING:
    from rich.console import Console

    from sim2real.blind import Outcome, Setup


@click.command("blind")
@click.option(
    "--trials", type=click.IntRange(1), default=20, show_default=True, help="Stages to diagnose."
)
@click.option(
    "--seed",
    type=click.IntRange(0),
    default=1,
    show_default=True,
    help="Seed of the random stages and effects.",
)
@click.option("--leave-out", is_flag=True, help="Remove the true effects from the library first.")
@click.option("--only", metavar="EFFECT", help="Draw only this effect, in every trial.")
@click.option("--effects", type=click.IntRange(3, 6), help="Effects on one axis in every trial.")
@click.option("--machine", type=FILE, help="Machine file of the stage.  [default: wafer-xy]")
@click.option(
    "--elements",
    type=click.IntRange(1, 64),
    help="Friction elements of the stage.  [default: the machine file's]",
)
@click.option(
    "--substeps",
    type=click.IntRange(5, 1000),
    help="Plant steps per control tick of the stage.  [default: drawn]",
)
@click.option(
    "--jobs", type=click.IntRange(1), default=2, show_default=True, help="Threads to fit with."
)
@click.option(
    "--lines", type=Output(), help="Append each trial here; skip trials it already holds."
)
@click.option("--label", default="", help="Version that is tested, as --lines and --docs name it.")
@JSON_OUT
@click.option("--docs", type=Output(PAGE), help="Write a Markdown page on all trials in --lines.")
def blind(
    trials: int,
    seed: int,
    leave_out: bool,
    only: str | None,
    effects: int | None,
    machine: Path | None,
    elements: int | None,
    substeps: int | None,
    jobs: int,
    lines: Path | None,
    label: str,
    json_out: Path | None,
    docs: Path | None,
) -> None:
    """Test the diagnosis: draw hidden effects, simulate, diagnose the recording, score the result.

    For each trial, the SHA-256 of the true answer is printed before the diagnosis starts and the
    answer itself after it. Ctrl-C ends with the scores so far; with --lines, the next call
    continues from there.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from stagectl.errors import UnusableInput

    setup = replace(
        _setup(machine, seed, leave_out, only),
        elements=elements,
        substeps=substeps,
        jobs=jobs,
        effects=effects,
    )
    about = {
        "label": label, "only": only, "elements": elements, "substeps": substeps, "effects": effects
    }  # fmt: skip
    console = console_for(json_out)
    everything = _read(lines)
    outcomes = _earlier(everything, about, setup, trials)
    try:
        for number in range(trials):
            if number in outcomes:
                continue
            outcome = _run_one(setup, number, trials, console)
            outcomes[number] = outcome
            if lines is not None:
                line = {**about, **outcome.to_json()}
                everything.append((line, outcome))
                with lines.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(line, allow_nan=False) + "\n")
    except KeyboardInterrupt:
        console.print(f"stopped after {len(outcomes)} of {trials} trials", style="yellow")
        raise
    except ValueError as error:
        raise UnusableInput(str(error)) from error
    finally:
        if outcomes:
            _conclude(list(outcomes.values()), everything, console, json_out, docs, label)


def _setup(machine: Path | None, seed: int, leave_out: bool, only: str | None) -> Setup:
    from hil_sim.effects.library import EffectError, library
    from sim2real.blind import Setup, find_pool
    from stagectl.config import load_machine, stage_settings
    from stagectl.errors import ConfigError, UnusableInput

    model = load_machine(machine)
    try:
        effects = library()
    except EffectError as error:
        raise ConfigError(f"effects: {error}") from error
    if only is not None:
        try:
            find_pool(only, effects)
        except ValueError as error:
            raise UnusableInput(f"--only: {error}") from error
    tolerance = {name: axis.plant.tolerance for name, axis in model.axes.items()}
    return Setup(
        stage_settings(model), tolerance, effects, model.document.text, seed, leave_out, only
    )


def _read(lines: Path | None) -> list[tuple[dict[str, Any], Outcome]]:
    from sim2real.blind import Outcome
    from stagectl.errors import UnusableInput

    if lines is None or not lines.exists():
        return []
    found = []
    try:
        texts = lines.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError as error:
        raise UnusableInput(f"{lines}: is not a file of blind trials") from error
    for number, text in enumerate(texts, 1):
        try:
            line = dict(json.loads(text))
            found.append((line, Outcome.from_json(line)))
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise UnusableInput(f"{lines}:{number}: is not a blind trial") from error
    return found


def _earlier(
    lines: list[tuple[dict[str, Any], Outcome]], about: dict[str, Any], setup: Setup, trials: int
) -> dict[int, Outcome]:
    """Outcomes of this check that the lines hold already, by number."""
    return {
        outcome.number: outcome
        for line, outcome in lines
        if all(line.get(key) == value for key, value in about.items())
        and (outcome.seed, outcome.leave_out) == (setup.seed, setup.leave_out)
        and outcome.number < trials
    }


def _run_one(setup: Setup, number: int, trials: int, console: Console) -> Outcome:
    """Run one trial and print it."""
    from sim2real.blind import describe_reported, describe_truth, draw_trial, is_wrong, run_trial
    from sim2real.diagnosis import PHASES

    def say(text: str, style: str = "") -> None:
        console.print(text, highlight=False, soft_wrap=True, style=style)

    name = f"trial {number + 1}/{trials}"
    with progress_bar(console, f"{name}: drawing") as update:
        trial = draw_trial(setup, number)
        say(f"trial {number}  sealed {trial.sealed.digest}")
        named = join_phases(
            PHASES, lambda what, done, total: update(f"{name}: {what}", done, total)
        )
        outcome = run_trial(setup, trial, time.perf_counter, time.process_time, named)
    say(f"  key {trial.sealed.text}\n  nonce {trial.sealed.nonce}")
    missed = is_wrong(outcome)
    say(
        f"  {describe_truth(outcome)} -> {describe_reported(outcome)}: "
        f"{outcome.error or outcome.verdict}, {outcome.seconds:.0f} s"
        f" ({outcome.processor:.0f} s processor time)",
        "red" if missed else "green",
    )
    return outcome


def _conclude(
    outcomes: list[Outcome],
    lines: list[tuple[dict[str, Any], Outcome]],
    console: Console,
    json_out: Path | None,
    docs: Path | None,
    label: str,
) -> None:
    """Print and write the scores of this check; the page covers all lines."""
    from sim2real.blind import score_outcomes, table_rows, write_page
    from stagectl.store import write_atomically

    counted = score_outcomes(outcomes)
    if not is_json_on_stdout(json_out):
        for row in table_rows(counted):
            console.print(row, highlight=False, soft_wrap=True)
    if json_out is not None:
        values = asdict(counted)
        values["confusion"] = [[*pair, count] for pair, count in counted.confusion.items()]
        write_json({**values, "outcomes": [outcome.to_json() for outcome in outcomes]}, json_out)
    if docs is not None:
        everything = [outcome for _, outcome in lines] or outcomes
        labels = sorted({str(line.get("label", "")) for line, _ in lines} - {""}) or [label]
        facts = {
            "version checked": ", ".join(labels) or "not stated",
            "measured on": f"{os.cpu_count()} cores ({platform.machine()}), "
            f"CPython {platform.python_version()}",
        }
        for option in ("only", "elements", "substeps", "effects"):
            given = sorted({f"{line[option]}" for line, _ in lines if line.get(option)})
            if given:
                count = sum(bool(line.get(option)) for line, _ in lines)
                facts[f"with --{option} {', '.join(given)}"] = f"{count} of the trials"
        write_atomically(docs, write_page(everything, facts), "page")
