"""`stagectl gap blind`: test the diagnosis on simulated stages with sealed causes."""

from __future__ import annotations

import json
import os
import platform
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.file_kinds import PAGE
from stagectl.cli.files import Output
from stagectl.cli.options import FILE, JSON_OUT, is_json_on_stdout, option, takes, write_json
from stagectl.cli.terminal import console_for, join_phases, progress_bar
from stagectl.errors import UnusableInput, unusable

if TYPE_CHECKING:
    from rich.console import Console

    from sim2real.blind import Outcome, Setup


@dataclass(frozen=True)
class _BlindOptions:
    """What is drawn, and where the outcomes go."""

    trials: int = option("Stages to diagnose.", click.IntRange(1), 20)
    seed: int = option("Seed of the random stages and effects.", click.IntRange(0), 1)
    leave_out: bool = option("Remove the true effects from the library first.", default=False)
    only: str | None = option("Draw only this effect, in every trial.", metavar="EFFECT")
    effects: int | None = option("Effects on one axis in every trial.", click.IntRange(3, 6))
    machine: Path | None = option("Machine file of the stage.  [default: wafer-xy]", FILE)
    elements: int | None = option(
        "Friction elements of the stage.  [default: the machine file's]", click.IntRange(1, 64)
    )
    substeps: int | None = option(
        "Plant steps per control tick of the stage.  [default: drawn]", click.IntRange(5, 1000)
    )
    jobs: int = option("Threads to fit with.", click.IntRange(1), 2)
    lines: Path | None = option("Append each trial here; skip trials it already holds.", Output())
    label: str = option(
        "Version that is tested, as --lines and --docs name it.", default="", show_default=False
    )

    def about(self) -> dict[str, Any]:
        """What tells this check from others in one file of trials, beside its seed."""
        keys = ("label", "only", "elements", "substeps", "effects")
        return {key: getattr(self, key) for key in keys}


@click.command("blind")
@takes(_BlindOptions)
@JSON_OUT
@click.option("--docs", type=Output(PAGE), help="Write a Markdown page on all trials in --lines.")
def blind(asked: _BlindOptions, json_out: Path | None, docs: Path | None) -> None:
    """Test the diagnosis: draw hidden effects, simulate, diagnose the recording, score the result.

    For each trial, the SHA-256 of the true answer is printed before the diagnosis starts and the
    answer itself after it. Ctrl-C ends with the scores so far; with --lines, the next call
    continues from there.
    """
    setup = _setup(asked)
    console = console_for(json_out)
    everything = _read(asked.lines)
    outcomes = _earlier(everything, asked)
    try:
        for number in range(asked.trials):
            if number in outcomes:
                continue
            outcome = _run_one(setup, number, asked.trials, console)
            outcomes[number] = outcome
            if asked.lines is not None:
                line = {**asked.about(), **outcome.to_json()}
                everything.append((line, outcome))
                with asked.lines.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(line, allow_nan=False) + "\n")
    except KeyboardInterrupt:
        console.print(f"stopped after {len(outcomes)} of {asked.trials} trials", style="yellow")
        raise
    except ValueError as error:
        raise UnusableInput(str(error)) from error
    finally:
        if outcomes:
            _conclude(list(outcomes.values()), console, json_out)
            if docs is not None:
                _write_page(docs, everything, list(outcomes.values()), asked.label)


def _setup(asked: _BlindOptions) -> Setup:
    from hil_sim.effects.library import EffectError, library
    from sim2real.blind import Setup, find_pool
    from stagectl.config import load_machine, stage_settings

    model = load_machine(asked.machine)
    with unusable(EffectError, about="effects: "):
        effects = library()
    if asked.only is not None:
        with unusable(ValueError, about="--only: "):
            find_pool(asked.only, effects)
    return Setup(
        stage_settings(model),
        {name: axis.plant.tolerance for name, axis in model.axes.items()},
        effects,
        model.document.text,
        asked.seed,
        asked.leave_out,
        asked.only,
        elements=asked.elements,
        substeps=asked.substeps,
        jobs=asked.jobs,
        effects=asked.effects,
    )


def _read(lines: Path | None) -> list[tuple[dict[str, Any], Outcome]]:
    from sim2real.blind import Outcome

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
    lines: list[tuple[dict[str, Any], Outcome]], asked: _BlindOptions
) -> dict[int, Outcome]:
    """Outcomes of this check that the lines hold already, by number."""
    return {
        outcome.number: outcome
        for line, outcome in lines
        if all(line.get(key) == value for key, value in asked.about().items())
        and (outcome.seed, outcome.leave_out) == (asked.seed, asked.leave_out)
        and outcome.number < asked.trials
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


def _conclude(outcomes: list[Outcome], console: Console, json_out: Path | None) -> None:
    """Print and write the scores of this check."""
    from sim2real.blind import score_outcomes, table_rows

    counted = score_outcomes(outcomes)
    if not is_json_on_stdout(json_out):
        for row in table_rows(counted):
            console.print(row, highlight=False, soft_wrap=True)
    values = asdict(counted)
    values["confusion"] = [[*pair, count] for pair, count in counted.confusion.items()]
    write_json({**values, "outcomes": [outcome.to_json() for outcome in outcomes]}, json_out)


def _write_page(
    path: Path, lines: list[tuple[dict[str, Any], Outcome]], outcomes: list[Outcome], label: str
) -> None:
    """A page on all lines; where there are none, on the outcomes of this check."""
    from sim2real.blind import write_page
    from stagectl.store import write_atomically

    everything = [outcome for _, outcome in lines] or outcomes
    labels = sorted({str(line.get("label", "")) for line, _ in lines} - {""}) or [label]
    facts = {
        "version checked": ", ".join(labels) or "not stated",
        "measured on": f"{os.cpu_count()} cores ({platform.machine()}), "
        f"CPython {platform.python_version()}",
    }
    for name in ("only", "elements", "substeps", "effects"):
        given = sorted({f"{line[name]}" for line, _ in lines if line.get(name)})
        if given:
            count = sum(bool(line.get(name)) for line, _ in lines)
            facts[f"with --{name} {', '.join(given)}"] = f"{count} of the trials"
    write_atomically(path, write_page(everything, facts), "page")
