"""`stagectl observer`: the observer of each axis, and the measurement it is designed by."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.file_kinds import HTML, JSON
from stagectl.cli.files import Output, check_output
from stagectl.cli.options import (
    FILE,
    JSON_OUT,
    NumberRange,
    is_json_on_stdout,
    option,
    takes,
    write_json,
)
from stagectl.cli.signals import interruptible
from stagectl.cli.stage_options import ServerOption, StageOptions
from stagectl.cli.terminal import console_for, make_console, make_table

if TYPE_CHECKING:
    from rich.table import Table

    from estimation.observer import Design
    from stagectl.client import Client
    from stagectl.config import Machine
    from stagectl.measurement import AxisFindings, Measurement


@dataclass(frozen=True)
class _MeasureOptions:
    """Of a measurement."""

    measure: bool = option("Measure the stage: it moves, after a question.", default=False)
    yes: bool = option("Measure without asking.", default=False)
    out: Path | None = option(
        "File of the measurement.  [default: MACHINE.response.json beside the machine file; none "
        "with --simulate]",
        Output(JSON),
    )


@dataclass(frozen=True)
class _DesignOptions:
    """Of what is made of a measurement."""

    measurement: Path | None = option(
        "Design by this measurement.  [default: the one beside the machine file, if any]", FILE
    )
    friction_scale: float = option(
        "Machine file's friction parameters times this factor, as in a run.",
        NumberRange(0.01, 100.0),
        1.0,
    )
    html: Path | None = option("Write Bode and Nyquist plots.", Output(HTML))


@click.command
@takes(StageOptions)
@takes(_MeasureOptions)
@takes(_DesignOptions)
@takes(ServerOption)
@JSON_OUT
def command(
    stage: StageOptions, how: _MeasureOptions, design: _DesignOptions, on: ServerOption,
    json_out: Path | None,
) -> None:  # fmt: skip
    """Measure how the axes respond, design their settling observers, and print the margins.

    Between two SYNCs the observer estimates, from the position, the force that the axis lacks, and
    moves the force offset towards it by the share GAIN per SYNC. The gain is the largest that keeps
    the peak sensitivity of the whole loop at or below 2, or 1.1 times that of the drive alone if
    that is more, and a gain margin of 2: by the measured response, at rest and while sliding.

    \b
    Measure a stage (20 s; it slides by 31 mm and back) and write wafer.response.json:
      stagectl observer --measure --machine wafer.yaml --bus socketcan:can0
    The same on a virtual stage, TRUTH.yaml, as the host of wafer.yaml sees it:
      stagectl observer --measure --machine wafer.yaml --simulate TRUTH.yaml

    A run uses the measurement beside its machine file, and no observer without one, or after a
    change of gains, SYNC period or drive. `observer: trust` in the machine file has an axis'
    observer designed from the file, unmeasured; `observer: none` has it off.
    """  # noqa: D301  (\b keeps click from wrapping what follows)
    from stagectl.cli.served import stage_for
    from stagectl.measurement import load_measurement, response_path

    if how.measure and design.measurement is not None:
        raise click.UsageError("--measurement is for a design without --measure")
    asks = how.out is not None or how.yes or stage.simulate is not None or stage.bus is not None
    if (asks or on.server is not None) and not how.measure:
        raise click.UsageError("--out, --yes, --simulate, --bus and --server need --measure")
    used: Measurement | None = None
    with stage_for(stage, on.server, moves=how.measure) as (machine, truth, client):
        if how.measure:
            used = _measured(machine, truth, client, stage, how)
    if design.measurement is not None:
        used = load_measurement(design.measurement)
    elif used is None:
        beside = response_path(machine, stage.machine)
        used = load_measurement(beside) if beside.exists() else None
    if design.html is not None and used is None:
        raise click.UsageError("--html draws a measurement: use --measure, or --measurement")
    _show(machine, used, design, json_out)


def _measured(
    machine: Machine, truth: Machine | None, client: Client | None, stage: StageOptions,
    how: _MeasureOptions,
) -> Measurement:  # fmt: skip
    """A new measurement, written to its file."""
    from stagectl.measurement import parse_measurement, response_path

    where = how.out
    if where is None and truth is None:
        where = response_path(machine, stage.machine)
        check_output(where, JSON)
    if client is not None:
        text = _measure_on_server(client, how.yes)
    else:
        text = _measure(machine, truth, stage, how.yes).as_text()
    used = parse_measurement(text, "the measurement")  # as a run will read it
    if where is not None:
        from stagectl.store import write_atomically

        write_atomically(where, text, "measurement")
        click.echo(f"measurement written to {where}", err=True)
    return used


def _measure(
    machine: Machine, truth: Machine | None, stage: StageOptions, yes: bool
) -> Measurement:
    from stagectl.measurement import measure_on_bus, measure_simulated

    if truth is not None:
        return measure_simulated(machine, truth, stage.seed)

    from rich.progress import Progress

    bar = Progress(console=make_console(stderr=True))
    task = bar.add_task("measuring", total=1.0)

    def progress(share: float) -> None:
        bar.start()  # not before the question
        bar.update(task, completed=share)

    now = datetime.now(UTC).astimezone()
    try:
        with interruptible() as stopped:
            return measure_on_bus(
                machine, stage.bus, lambda lines: _agreed(lines, yes), now, stopped, progress
            )
    finally:
        bar.stop()


def _measure_on_server(client: Client, yes: bool) -> str:
    """A measurement of the stage that a server holds, as text."""
    from stagectl.cli.served import do
    from stagectl.errors import Aborted
    from stagectl.protocol.requests import Measure

    planned = do(client, Measure()).result or {}
    if not _agreed(planned["does"], yes):
        raise Aborted("not measured")
    click.echo("measuring", err=True)
    measured = do(client, Measure(agreed=True)).result or {}
    return str(measured["measurement"])


def _agreed(lines: list[str], yes: bool) -> bool:
    click.echo("The measurement shakes and slides the axes:", err=True)
    for line in lines:
        click.echo(f"  {line}", err=True)
    return yes or click.confirm("Is the stage free to move?", err=True)


def _show(
    machine: Machine,
    measurement: Measurement | None,
    asked: _DesignOptions,
    json_out: Path | None,
) -> None:
    """Print the designs and what the measurement contradicts."""
    from estimation.response import AxisResponse
    from stagectl.config.settings.observer import design_observers
    from stagectl.measurement import find_contradictions

    friction = {
        name: axis.plant.friction.figures.scaled(asked.friction_scale)
        for name, axis in machine.axes.items()
    }
    period = machine.bus.sync_period
    responses: dict[str, AxisResponse | str] | None = None
    findings: dict[str, AxisFindings] = {}
    if measurement is not None:
        responses = {}
        for name, axis in machine.axes.items():
            objection = measurement.objection(machine, name, simulated=True)
            responses[name] = objection or measurement.axes[name].response
            if name in measurement.axes:
                findings[name] = find_contradictions(
                    axis, friction[name], period, measurement.axes[name].response
                )
    designs = design_observers(machine, friction, responses)
    axes = {name: {**_figures(d), **_found(findings.get(name))} for name, d in designs.items()}
    write_json(
        {"measured": None if measurement is None else measurement.measured, "axes": axes}, json_out
    )
    if asked.html is not None and measurement is not None:
        from stagectl.report.response import write_response_page

        write_response_page(asked.html, machine, measurement, designs, findings)
        click.echo(f"plots written to {asked.html}", err=True)
    if is_json_on_stdout(json_out):
        return
    console = console_for(json_out)
    console.print(_table(designs, machine.name, measurement))
    if measurement is not None and measurement.machine != machine.name:
        console.print(f"{measurement.source} is of {measurement.machine}, not of {machine.name}")
    for name, found in findings.items():
        for clause in found.contradictions:
            console.print(f"axis {name}: {clause}")
        if not found.contradictions:
            console.print(f"axis {name}: the response agrees with the machine file")
    if measurement is None:
        console.print(
            "From the machine file, not measured. A run has no observer until it is: "
            "stagectl observer --measure"
        )


def _found(found: AxisFindings | None) -> dict[str, Any]:
    if found is None:
        return {}
    figures = found.fitted.figures
    return {
        "response": {
            **{k: v for k, v in figures._asdict().items() if k != "resonances"},
            "resonances": [mode._asdict() for mode in figures.resonances],
            "offset_step": found.step,
            "sigma": found.fitted.sigma,
            "misfit": found.fitted.misfit,
        },
        "contradictions": list(found.contradictions),
    }


def _figures(found: Design | str) -> dict[str, Any]:
    if isinstance(found, str):
        return {"on": False, "reason": found}
    first, second = found.peaks
    return {
        "on": True,
        "gain": found.gain,
        "time_constant": found.time_constant,
        "limit": found.figures.limit,
        "assumed_stiffness": found.assumed_stiffness,
        "sensitivity_peak": {
            "drive_alone": found.drive_peak,
            "latency_1": first,
            "latency_2": second,
            "worst": found.worst_peak,
        },
        "measured": None if found.margins is None else asdict(found.margins),
    }


def _table(designs: dict[str, Design | str], name: str, measurement: Measurement | None) -> Table:
    how = "from the machine file" if measurement is None else "as measured"
    if measurement is not None and measurement.measured is not None:
        how += f" on {measurement.measured[:16].replace('T', ' ')}"
    axes = [_figures(found) for found in designs.values()]

    def row(label: str, *keys: str, scale: float = 1.0, form: str = ".3g") -> list[str]:
        cells = []
        for figures in axes:
            value: Any = figures
            for key in keys:
                value = value.get(key) if value is not None else None
            cells.append("" if value is None else format(value * scale, form))
        return [label, *cells]

    peak = "sensitivity_peak"
    rows = [
        ["observer", *("on" if of["on"] else of["reason"] for of in axes)],
        row("gain per SYNC", "gain"),
        row("time constant, ms", "time_constant", scale=1e3),
        row("limit of the correction, N", "limit"),
        row("assumed stiffness, N/m", "assumed_stiffness"),
        None,
        row("peak sensitivity: drive alone", peak, "drive_alone", form=".2f"),
        row("  offset 1 SYNC after the sample", peak, "latency_1", form=".2f"),
        row("  offset 2 SYNCs after the sample", peak, "latency_2", form=".2f"),
    ]
    if measurement is None:
        rows.append(row("  worst, with figures off", peak, "worst", form=".2f"))
    else:
        rows.append(row("  worst, by the measured response", "measured", "peak", form=".2f"))
        rows.append(row("gain margin by the measured response", "measured", "gain", form=".2f"))
    return make_table(f"{name}: settling observer, {how}", ["", *designs], rows, designs)
