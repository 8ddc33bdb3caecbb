"""A run with another machine file than the server's, such as a twin: only the model may differ."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace
from typing import Any

from stagectl.config import driver_settings, parse_machine
from stagectl.errors import UnusableInput
from stagectl.protocol.requests import QueueAdd
from stagectl.server.setup import Setup

_OF_THE_PLACE = ("eds", "note", "interface", "channel")
"""Settings that may differ: where a file is, how the bus is reached, remarks."""


def setup_for(setup: Setup, asked: QueueAdd) -> Setup:
    """The setup that a run believes: the server's, or with the machine file that the run names.

    Raises:
        ConfigError: the machine file cannot be used; one line per problem.
        UnusableInput: it asks for another bus or other drives than the server has set up.
    """
    if asked.machine is None:
        return setup
    machine = parse_machine(asked.machine.text, asked.machine.source)
    name = machine.source
    if setup.machine_file is not None:  # files that it names are where the server's are
        machine = parse_machine(asked.machine.text, setup.machine.source)
    bus, axes = driver_settings(machine, setup.named_bus)
    names, here = [axis.name for axis in axes], [axis.name for axis in setup.axes]
    if names != here:
        raise UnusableInput(f"{name}: axes {', '.join(names)}; the server has {', '.join(here)}")
    differing = [*_differences("bus", bus, setup.bus)]
    for asks, has in zip(axes, setup.axes, strict=True):
        differing += _differences(f"axis {has.name}", asks, has)
    if differing:
        raise UnusableInput(
            f"{name}: {'; '.join(differing)}: a run may believe another model, not other "
            "drives; start a server with this file"
        )
    return replace(setup, machine=machine)


def _differences(what: str, asks: Any, has: Any) -> Iterator[str]:
    for field in fields(asks):
        values = getattr(asks, field.name), getattr(has, field.name)
        if field.name not in _OF_THE_PLACE and values[0] != values[1]:
            yield f"{what}: {field.name} {values[0]}, the server has {values[1]}"
