"""From a machine file to the observer: which axis has one, and what it has to know."""

import pytest

from estimation.observer import Mode
from stagectl.config.machine import Effect
from stagectl.config.machine.drive import Cascade
from stagectl.config.settings.observer import design_observers, observer_figures
from stagectl.errors import ConfigError
from tests.unit.stagectl.machines import with_axes


def figures(machine, *effects):
    axis = with_axes(machine, x={"effects": effects}).axes["x"]
    return observer_figures(axis, axis.plant.friction.figures, 1e-3)


def test_the_figures_are_those_of_the_file(machine):
    own = figures(machine)
    assert (own.drive.kp, own.drive.ki, own.drive.kd) == (341e3, 16.07e6, 2714.0)
    assert own.drive.control_period == 1e-4
    assert (own.carriage.mass, own.carriage.stiffness, own.carriage.viscous) == (8.0, 6e5, 20.0)
    assert own.coulomb == 6.0
    assert own.limit == 20.0
    assert own.limit > 3.0  # cogging of 2 N and friction off by 1 N are no rarity
    assert own.mass_doubt == pytest.approx(0.009)
    assert own.noise == pytest.approx(1.04e-9, rel=0.01)


def test_effects_of_the_hosts_file_change_the_loop(machine):
    own = figures(
        machine,
        Effect("payload_mass", {"mass": 1.0}),
        Effect("presliding_stiffness", {"ratio": 2.0}),
        Effect("viscous_damping", {"ratio": 0.5}),
        Effect("coulomb_level", {"ratio": 1.5}),
        Effect("current_bandwidth", {"bandwidth": 300.0}),
        Effect("dead_time", {"delay": 3e-4}),
        Effect("force_constant", {"ratio": 1.1}),
        Effect("motor_gain_table", {"position": (-0.1, 0.1), "factor": (0.9, 1.2)}),
        Effect("resonance", {"frequency": 110.0, "damping": 0.02, "mass_ratio": 0.2}),
        Effect("base_motion", {"frequency": 10.0, "damping": 0.1, "mass_ratio": 0.03}),
        Effect("cogging", {"amplitude": 1.0, "pitch": 0.03, "phase": 0.0}),
    )
    assert own.carriage.mass == 9.0
    assert own.carriage.stiffness == 1.2e6
    assert own.carriage.viscous == 10.0
    assert own.coulomb == 9.0
    assert own.drive.current_bandwidth == 300.0
    assert own.drive.delay == 3e-4
    assert own.drive.force_ratio == pytest.approx(1.1 * 1.2)
    assert own.carriage.hung == (Mode(0.2, 110.0, 0.02),)
    assert own.carriage.base == Mode(0.03, 10.0, 0.1)


def test_the_gain_heeds_them(machine):
    resonance = Effect("resonance", {"frequency": 110.0, "damping": 0.02, "mass_ratio": 0.2})
    plain = design_observers(machine)
    shaken = design_observers(with_axes(machine, x={"effects": (resonance,)}))
    assert shaken["x"].gain < plain["x"].gain
    assert shaken["y"] == plain["y"]


def test_effects_that_cannot_be_are_refused(machine):
    wrong = with_axes(machine, x={"effects": (Effect("dead_time", {"deley": 1e-3}),)})
    with pytest.raises(ConfigError, match="dead_time"):
        design_observers(wrong)


def test_axes_without_an_observer_say_why(machine):
    cascade = Cascade(position_gain=60.0, velocity_gain=1000.0)
    drive = {"pid": None, "cascade": cascade}
    off = design_observers(with_axes(machine, x={"drive": drive}, y={"observer": "none"}))
    assert "cascade" in off["x"]
    assert off["y"] == "switched off in the machine file"
