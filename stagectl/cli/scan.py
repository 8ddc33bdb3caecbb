"""`stagectl scan`: the nodes on the bus."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.bus_access import Bench
from stagectl.cli.options import JSON_OUT, NumberRange, takes
from stagectl.cli.terminal import make_table, show_result

if TYPE_CHECKING:
    from rich.console import RenderableType

    from drivers.commissioning import Found


@click.command
@takes(Bench)
@click.option("--passive", is_flag=True, help="Only listen; send nothing.")
@click.option("--listen", type=NumberRange(0.01, 60), default=0.25,
              help="Wait this long for heartbeats and answers [s].")  # fmt: skip
@JSON_OUT
def command(bench: Bench, passive: bool, listen: float, json_out: Path | None) -> None:
    """List the nodes on the bus with identity, NMT state and, for drives, CiA 402 state.

    Nodes are found by boot-up message, by heartbeat, and by an SDO read of the device type
    (0x1000) from every node id. Nothing is written and nothing moves.

    Exit code 1 if two devices have one node id, or a node of the machine file does not answer,
    asked twice; with --passive, nothing is asked and nobody has to answer.
    """
    from drivers.commissioning import scan

    with bench.observer() as network:
        axes = {axis.node: axis.name for axis in bench.axes}
        found = scan(network, ask=not passive, listen=listen, expected=axes)
        label, host = network.label, network.other_host.found
    missing = [node for node in axes if all(one.node != node for one in found)]
    show_result([_entry(node, axes) for node in found], json_out, _table(found, axes, label))
    if host is not None:
        click.echo(f"another host is active on this bus: {host} was heard", err=True)
    how = "was not heard" if passive else "was not heard, asked twice"
    for node in missing:
        text = f"axis {axes[node]}: node {node} of {bench.machine.source} {how}"
        click.echo(text, err=True)
    doubled = [node.node for node in found if node.doubled]
    for node in doubled:
        click.echo(f"node {node}: two devices have this id; no drive can be told from the other",
                   err=True)  # fmt: skip
    if doubled or (missing and not passive):
        raise click.exceptions.Exit(1)


def _entry(node: Found, axes: dict[int, str]) -> dict[str, Any]:
    return {
        "node": node.node, "axis": axes.get(node.node), **asdict(node),
        "profile": node.profile, "state": node.state,
    }  # fmt: skip


def _table(found: list[Found], axes: dict[int, str], label: str) -> RenderableType:
    from drivers.canopen import error_text

    if not found:
        return f"no node was heard on {label}: check power, wiring, termination and bit rate"
    rows = []
    for n in found:
        state = n.state or "-"
        if n.error_code:
            state += f", {error_text(n.error_code)}"
        if n.doubled:
            state = "TWO DEVICES ON THIS NODE ID"
        heard = ", ".join(n.heard)
        rows.append((str(n.node), axes.get(n.node, "-"), heard, n.nmt or "-", _device(n), state))
    titles = ("node", "axis", "heard", "NMT", "device", "state")
    return make_table(f"Nodes on {label}", titles, rows, ("node",))


def _device(node: Found) -> str:
    """Name, profile and identity object, on lines short enough for 80 columns."""
    if node.name is None and node.profile is None and node.vendor is None:
        return "-"
    serial = "-" if node.serial is None else str(node.serial)
    return "\n".join(
        [
            node.name or "no name",
            "no profile" if node.profile is None else f"CiA {node.profile}",
            f"vendor {_hex(node.vendor)}",
            f"product {_hex(node.product)}",
            f"revision {_hex(node.revision)}",
            f"serial {serial}",
        ]
    )


def _hex(value: int | None) -> str:
    return "-" if value is None else f"0x{value:X}"
