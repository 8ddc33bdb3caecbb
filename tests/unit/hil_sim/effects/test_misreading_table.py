"""An encoder's error as a table: what is read, and what is refused."""

import numpy as np
import pytest

from hil_sim.effects.misreading_table import MisreadingTable
from hil_sim.effects.ports import EffectPorts

WRONG = {"position": (-0.05, 0.0, 0.02, 0.05), "error": (0.0, 4e-5, -4e-5, 1e-5)}


def test_the_encoder_reads_what_the_table_adds(free, with_effects, pushed):
    """An axis starts where the encoder reads that it does."""
    time, right = pushed(free, 100.0)
    _, read = pushed(with_effects(free, MisreadingTable().at(**WRONG)), 100.0)
    at = int(np.argmax(right >= 0.02))
    assert 0 < at < len(time) - 1
    assert read[at] - right[at] == pytest.approx(-4e-5 - 4e-5, abs=2e-6)


def test_it_is_smooth_and_held_beyond_its_ends(nominal):
    ports = EffectPorts(nominal.axes[0], 1e-3, 0.1)
    MisreadingTable().at(**WRONG).apply(ports)
    slopes = np.diff(ports.misreading) / np.diff(ports.positions)
    assert np.abs(np.diff(slopes)).max() < 0.05 * np.abs(slopes).max()
    assert ports.misreading[[0, -1]] == pytest.approx([0.0, 1e-5])


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"error": (0.0, 1e-6)}, "error: must have 4 values like position, has 2"),
        ({"position": (0.0, 0.0, 1.0, 2.0)}, "position: must increase from node to node"),
        ({"error": (0.0, 1e-1, 0.0, 0.0)}, "error: changes by 5 m per m, at most 1"),
    ],
)
def test_tables_that_do_not_fit_are_refused(nominal, changed, reason):
    with pytest.raises(ValueError, match=reason):
        MisreadingTable().check(WRONG | changed, nominal.axes[0])
