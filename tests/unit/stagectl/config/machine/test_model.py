"""The machine of a machine file."""

from __future__ import annotations

import pickle

from stagectl.config import load_machine, parse_machine

GOOD = load_machine().text


def changed(old: str, new: str) -> str:
    """The packaged machine with the first `old` (that of axis x) replaced."""
    assert old in GOOD
    return GOOD.replace(old, new, 1)


def test_units_mean_the_same_as_si_figures() -> None:
    text = changed("stiffness: 6.0e5", "stiffness: 0.6 N/um").replace(
        "sync_period: 0.001", "sync_period: 1 ms"
    )
    assert parse_machine(text, "m").axes == load_machine().axes


def test_a_machine_survives_pickling() -> None:
    machine = load_machine()
    assert pickle.loads(pickle.dumps(machine)).text == machine.text  # noqa: S301 - our own
    assert pickle.loads(pickle.dumps(machine)) == machine  # noqa: S301 - our own
