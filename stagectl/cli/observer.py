"""`stagectl observer`: the observer of each axis, and the measurement it is designed by."""

from __future__ import annotations

from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.console import console_for, make_console
from stagectl.cli.file_kinds import HTML, JSON
from stagectl.cli.files import Output, check_output
from stagectl.cli.options import FILE, JSON_OUT, NumberRange, is_json_on_stdout, write_json
from stagectl.cli.signals import interruptible
from stagectl.cli.stage_options import load_machines, stage_options

if TYPE_CHECKING:
    from estimation.observer import Design
    from stagectl.config import Machine
    from stagectl.measurement import AxisFindings, Measurement


@click.command
@stage_options
@click.option("--measure", is_flag=True, help="Measure the stage: it moves, after a question.")
@click.option("--yes", is_flag=True, help="Measure without asking.")
@click.option(
    "--out",
    type=Output(JSON),
    help="File of the measurement.  [default: MACHINE.response.json beside the machine file; none "
    "with --simulate]",
)
@click.option(
    "--measurement",
    type=FILE,
    help="Design by this measurement.  [default: the one beside the machine file, if any]",
)
@click.option(
    "--friction-scale",
    type=NumberRange(0.01, 100.0),
    default=1.0,
    show_default=True,
    help="Machine file's friction parameters times this factor, as in a run.",
)
@click.option("--html", "html_out", type=Output(HTML), help="Write Bode and Nyquist plots.")
@JSON_OUT
def command(
    machine: Path | None,
    simulate: Path | None,
    bus: tuple[str, str] | None,
    seed: int,
    measure: bool,
    yes: bool,
    out: Path | None,
    measurement: Path | None,
    friction_scale: float,
    html_out: Path | None,
    json_out: Path | None,
) -> None:
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
    from stagectl.measurement import load_measurement, parse_measurement, response_path

    if measure and measurement is not None:
        raise click.UsageError("--measurement is for a design without --measure")
    if not measure and (out is not None or yes or simulate is not None or bus is not None):
        raise click.UsageError("--out, --yes, --simulate and --bus need --measure")
    stage, truth = load_machines(machine, simulate, bus, moves=measure)
    used: Measurement | None = None
    if measure:
        where = out
        if where is None and truth is None:
            where = response_path(stage, machine)
            check_output(where, JSON)
        text = _measure(stage, truth, bus, seed, yes).as_text()
        used = parse_measurement(text, "the measurement")  # as a run will read it
        if where is not None:
            from stagectl.store import write_atomically

            write_atomically(where, text, "measurement")
            click.echo(f"measurement written to {where}", err=True)
    elif measurement is not None:
        used = load_measurement(measurement)
    else:
        beside = response_path(stage, machine)
        used = load_measurement(beside) if beside.exists() else None
    if html_out is not None and used is None:
        raise click.UsageError("--html draws a measurement: use --measure, or --measurement")
    _show(stage, used, friction_scale, html_out, json_out)


def _measure(
    machine: Machine,
    truth: Machine | None,
    bus: tuple[str, str] | None,
    seed: int,
    yes: bool,
) -> Measurement:
    from stagectl.measurement import measure_on_bus, measure_simulated

    if truth is not None:
        return measure_simulated(machine, truth, seed)

    def agreed(lines: list[str]) -> bool:
        click.echo("The measurement shakes and slides the axes:", err=True)
        for line in lines:
            click.echo(f"  {line}", err=True)
        return yes or click.confirm("Is the stage free to move?", err=True)

    from rich.progress import Progress

    bar = Progress(console=make_console(stderr=True))
    task = bar.add_task("measuring", total=1.0)

    def progress(share: float) -> None:
        bar.start()  # not before the question
        bar.update(task, completed=share)

    now = datetime.now(UTC).astimezone()
    try:
        with interruptible() as stopped:
            return measure_on_bus(machine, bus, agreed, now, stopped, progress)
    finally:
        bar.stop()


def _show(
    machine: Machine,
    measurement: Measurement | None,
    friction_scale: float,
    html_out: Path | None,
    json_out: Path | None,
) -> None:
    """Print the designs and what the measurement contradicts."""
    from estimation.response import AxisResponse
    from stagectl.config.settings.observer import design_observers
    from stagectl.measurement import find_contradictions

    friction = {
        name: axis.plant.friction.figures.scaled(friction_scale)
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
    if html_out is not None and measurement is not None:
        from stagectl.report.response import write_response_page

        write_response_page(html_out, machine, measurement, designs, findings)
        click.echo(f"plots written to {html_out}", err=True)
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


def _table(designs: dict[str, Design | str], name: str, measurement: Measurement | None) -> Any:
    from rich.table import Table

    how = "from the machine file" if measurement is None else "as measured"
    if measurement is not None and measurement.measured is not None:
        how += f" on {measurement.measured[:16].replace('T', ' ')}"
    table = Table(title=f"{name}: settling observer, {how}", title_justify="left")
    table.add_column("")
    for axis in designs:
        table.add_column(axis, justify="right")
    rows = [_figures(found) for found in designs.values()]
    table.add_row("observer", *("on" if r["on"] else r["reason"] for r in rows))

    def add(label: str, *keys: str, scale: float = 1.0, form: str = ".3g") -> None:
        cells = []
        for figures in rows:
            value: Any = figures
            for key in keys:
                value = value.get(key) if value is not None else None
            cells.append("" if value is None else format(value * scale, form))
        table.add_row(label, *cells)

    add("gain per SYNC", "gain")
    add("time constant, ms", "time_constant", scale=1e3)
    add("limit of the correction, N", "limit")
    add("assumed stiffness, N/m", "assumed_stiffness")
    table.add_section()
    peak = "sensitivity_peak"
    add("peak sensitivity: drive alone", peak, "drive_alone", form=".2f")
    add("  offset 1 SYNC after the sample", peak, "latency_1", form=".2f")
    add("  offset 2 SYNCs after the sample", peak, "latency_2", form=".2f")
    if measurement is None:
        add("  worst, with figures off", peak, "worst", form=".2f")
    else:
        add("  worst, by the measured response", "measured", "peak", form=".2f")
        add("gain margin by the measured response", "measured", "gain", form=".2f")
    return table
