"""The observer's place between driver and mathematics: samples in, offsets out, nothing else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stagectl.config.machine.file import load_machine
from stagectl.config.settings.observer import design_observers, make_observer
from stagectl.sequencer import ObservedOffsets


@dataclass
class Channel:
    position: int = 0
    force: int = 0
    valid: bool = True
    arrival: int = 100_000


def test_each_axis_gets_what_its_own_sample_says():
    machine = load_machine()
    observer = make_observer(machine, design_observers(machine), [120.0, 200.0])
    observed = ObservedOffsets(observer)
    rows = 40
    observed.begin(np.zeros((rows, 2), np.int64), np.zeros((rows, 2)), [0, 0], False)
    channels = [Channel(), Channel()]
    for row in range(rows):
        channels[1].position = -min(row * 50, 500)
        sent = observed.offsets(row, 1, 0.0, channels)
    assert observer.sample.tolist() == [[0, 0, 1, 100_000], [-500, 0, 1, 100_000]]
    assert all(type(offset) is int for offset in sent)
    assert sent[0] == 0
    assert sent[1] > 2  # pushed back: the offset has to push forward


def test_an_axis_whose_drive_has_no_offset_is_left_alone():
    machine = load_machine()
    observer = make_observer(machine, design_observers(machine), [None, 200.0])
    assert observer.is_on == (False, True)
