"""Which axes get an observer, and what is said of one that ends early."""

from types import SimpleNamespace

import numpy as np
import pytest

from stagectl.measurement import Measurement, measure_virtual_stage
from stagectl.measurement.document import Identity, MeasuredAxis
from stagectl.run.observers import Observers
from stagectl.sequencer import Mode, make_compensation
from tests.unit.stagectl.machines import with_axes


@pytest.fixture(scope="session")
def measured(machine):
    return measure_virtual_stage(machine, machine)


@pytest.fixture
def compensation(machine):
    return make_compensation(machine, Mode.ESTIMATED)


class Enabled:
    """A stage as far as observers see it."""

    def __init__(self, machine, accepts=(True, True)):
        self.axes = [
            SimpleNamespace(
                settings=SimpleNamespace(peak_force=axis.drive.peak_force),
                accepts_force_offset=accepted,
            )
            for axis, accepted in zip(machine.axes.values(), accepts, strict=True)
        ]
        self.correction = None

    def correct_offsets(self, correction):
        self.correction = correction


class Noted:
    """Keeps what a record is given."""

    def note_observer(self, designs, is_on):
        self.designs, self.is_on = designs, is_on


@pytest.fixture
def attach(machine, compensation, measured):
    """Observers of an enabled stage, with the stage and what was noted."""

    def made(accepts=(True, True), **out):
        stage, record = Enabled(machine, accepts), Noted()
        observers = Observers(machine, compensation, measured, simulated=True, **out)
        observers.restart()
        assert observers.failures() == [], "there is nothing to forget yet"
        observers.attach(stage, record)
        return observers, stage, record

    return made


@pytest.mark.parametrize("accepts", [(True, False), (False, False)])
def test_an_axis_has_one_where_its_drive_takes_force_offsets(attach, compensation, accepts):
    observers, stage, record = attach(accepts)
    assert list(record.designs) == ["x", "y"]
    assert record.is_on == accepts
    assert tuple(axis.observed for axis in compensation) == accepts
    assert (stage.correction is not None) is any(accepts)
    observers.restart()
    assert observers.failures() == []


def test_an_estimate_that_is_not_finite_is_a_notice_that_names_its_axis(attach):
    observers, stage, _ = attach()
    planned = np.zeros((40, 2))
    planned[:, 1] = np.nan
    stage.correction.begin(np.zeros((40, 2), np.int64), planned, [0, 0], False)
    for row in range(40):
        answer = SimpleNamespace(position=0, force=0, valid=True, arrival=200_000)
        stage.correction.offsets(row, 1, 0.0, [answer, answer])
    (notice,) = observers.failures()
    assert notice.startswith("axis y: the observer's estimate was not finite")
    observers.restart()
    assert observers.failures() == []


def test_an_axis_that_is_out_since_an_earlier_run_goes_without(attach):
    _, _, record = attach(out={"y": "out since then"})
    assert record.is_on == (True, False)
    assert record.designs["y"] == "out since then"


def test_a_void_measurement_is_said_with_what_to_do(machine, compensation, measured):
    real = Measurement("2026-01-01T00:00:00+00:00", measured.machine, measured.axes, "m.json")
    pid = machine.axes["x"].drive.pid.model_copy(update={"kp": 300e3})
    changed = with_axes(machine, x={"drive": {"pid": pid}})
    (said,) = Observers(changed, compensation, real, simulated=False).without()
    assert said == (
        "axis x: no observer: drive.pid.kp is 300000; it was measured with 341000; "
        "measure with: stagectl observer --measure"
    )


def test_another_drive_is_said(machine, compensation, measured):
    """One that was measured as serial 5, in a stage whose drives state none."""
    drive = Identity(vendor=1, product=2, revision=3, serial=5)
    of = {n: MeasuredAxis(drive, a.settings, a.response) for n, a in measured.axes.items()}
    real = Measurement("2026-01-01T00:00:00+00:00", measured.machine, of, "m.json")
    stage, record = Enabled(machine), Noted()
    for axis in stage.axes:
        axis.name = "x" if axis is stage.axes[0] else "y"
        axis.node = SimpleNamespace(read=lambda entry: {1: 1, 2: 2, 3: 3, 4: 7}[entry.sub])
    observers = Observers(machine, compensation, real, simulated=False)
    assert observers.without() == []
    observers.attach(stage, record)
    assert record.is_on == (False, False)
    (said,) = observers.without()
    assert said.startswith("axes x, y: no observer: measured with another drive: serial 7, was 5;")
