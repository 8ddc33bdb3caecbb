"""Forces that no effect of the library has."""

import numpy as np

from hil_sim.effects import Parameter
from sim2real.blind.unlisted_effects import unlisted

SIZE = Parameter("size", "", "", (0.0, 1.0), neutral=0.0)


@unlisted(SIZE, over="")
def drag(ports, p):
    ports.add_velocity_force(p["size"] * ports.velocities * np.abs(ports.velocities))


@unlisted(SIZE, over="")
def eddies(ports, p):
    speed = ports.velocities / 0.04
    ports.add_velocity_force(2.0 * p["size"] * speed / (1.0 + speed**2))


@unlisted(SIZE, over="")
def dead_band(ports, p):
    ports.lose_motor_force(np.clip(ports.motor_forces, -p["size"], p["size"]))


@unlisted(SIZE, over="")
def square_loss(ports, p):
    ports.lose_motor_force(p["size"] * ports.motor_forces * np.abs(ports.motor_forces))


@unlisted(SIZE, over="")
def magnet(ports, p):
    for length in (5e-4, 2e-3, 8e-3):
        ports.add_hysteresis(p["size"] / 3.0, p["size"] / 3.0 / length)


@unlisted(SIZE, over="")
def splinter(ports, p):
    away = (ports.positions + 0.01) / 6e-4
    ports.add_position_force(p["size"] * np.exp(-0.5 * away**2))


@unlisted(SIZE, over="")
def dirt(ports, p):
    away = (ports.positions + 0.01) / 6e-4
    ports.scale_position_coulomb(1.0 + p["size"] * np.exp(-0.5 * away**2))


@unlisted(SIZE, over="")
def pulse(ports, p):
    ports.scale_time_coulomb(1.0 + p["size"] * np.sin(2.0 * np.pi * 1.3 * ports.times + 0.4))


@unlisted(SIZE, over="")
def slow_pulse(ports, p):
    ports.scale_time_coulomb(1.0 + p["size"] * np.sin(2.0 * np.pi * 0.4 * ports.times + 0.4))


@unlisted(SIZE, over="")
def running_up(ports, p):
    cycles = 15.0 * ports.times + 2.0 * ports.times**2
    ports.add_time_force(p["size"] * np.sin(2.0 * np.pi * cycles))


@unlisted(SIZE, over="")
def easing(ports, p):
    ports.scale_time_coulomb(1.0 + p["size"] * np.exp(-ports.times / 3.0))
