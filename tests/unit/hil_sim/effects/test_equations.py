"""Every effect, alone and all at once, against the equations written out step by step.

The other side is docs/reference/reference-stage.md and docs/formats/effects.md in plain Python: no
tables, no ports, dead time as a queue of substeps, the coupled axes by a linear system at every
step.
"""

import functools
import math

import numpy as np
import pytest

from hil_sim.plant import simulate
from tests.unit.hil_sim.inputs import change_axes

VALUES = {
    "payload_mass": {"mass": 0.5},
    "force_constant": {"ratio": 1.05},
    "coulomb_level": {"ratio": 1.2},
    "viscous_damping": {"ratio": 1.5},
    "presliding_stiffness": {"ratio": 0.7},
    "stribeck": {"static_ratio": 0.8},
    "friction_asymmetry": {"ratio": 0.1},
    "friction_position": {"amplitude": 0.4, "center": 1e-3, "width": 6e-3},
    "thermal_drift": {"amplitude": 0.3, "time_constant": 0.2},
    "force_offset": {"force": -0.7},
    "cogging": {"amplitude": 1.3, "pitch": 0.024, "phase": 0.5},
    "force_ripple": {"ratio": 0.06, "pitch": 9e-3, "phase": 2.0},
    "cable_stiffness": {"stiffness": 30.0, "center": -0.01},
    "cable_hysteresis": {"force": 0.8, "stiffness": 3000.0},
    "current_bandwidth": {"bandwidth": 400.0},
    "dead_time": {"delay": 0.00036},  # 18 substeps
    "resonance": {"frequency": 90.0, "damping": 0.03, "mass_ratio": 0.2},
    "base_motion": {"frequency": 9.0, "damping": 0.05, "mass_ratio": 0.04},
    "cross_coupling": {"mass": 0.5},
    "floor_vibration": {"amplitude": 0.6, "frequency": 60.0, "phase": 1.0},
    "force_saturation": {"force": 45.0},
    "viscous_asymmetry": {"ratio": 0.2},
    "low_speed_friction": {"ratio": -0.3, "speed": 0.01},
    "transmission_ripple": {"amplitude": 0.7, "pitch": 2.5e-3, "phase": 1.0},
    "torque_ripple": {"ratio": 0.03, "pitch": 4e-3, "phase": 0.3},
    "unbalance": {"torque": 0.9, "phase": 0.4},
    "load_friction": {"ratio": 0.08, "motor_share": 0.3},
}

PERIOD, SUBSTEPS, STEP = 1e-4, 5, 2e-5


class PlainAxis:
    """One axis with effects `on` (name -> values)."""

    def __init__(self, axis, on, start):
        self.axis, self.on = axis, on
        friction = axis.friction
        self.mass = axis.mass + self.of("payload_mass", "mass", 0.0)
        self.hung = self.of("resonance", "mass_ratio", 0.0) * self.mass
        self.carriage = self.mass - self.hung
        self.x, self.v, self.motor, self.h = start, 0.0, 0.0, 0.0
        self.q = self.w = self.xb = self.vb = 0.0
        count = friction.elements
        self.share = [2.0 * i / (count * (count + 1)) for i in range(1, count + 1)]
        self.f, self.slips, self.side = [0.0] * count, [False] * count, 0.0
        self.demand = self.last = start
        self.r, self.f0 = start, 0.0
        self.integral = self.derivative = self.e = 0.0
        self.queue = [0.0] * round(self.of("dead_time", "delay", 0.0) / STEP)
        self.u = 0.0
        self.factor = 1.0

    def of(self, effect, key, default):
        return self.on.get(effect, {}).get(key, default)

    def control(self, target, force, tick):
        c = self.axis.control
        demand = self.r + (target - self.r) * tick / 10
        offset = self.f0 + (force - self.f0) * tick / 10
        error = demand - self.x
        rate = (error - self.e) / PERIOD
        self.e = error
        self.derivative += PERIOD / (c.derivative_time + PERIOD) * (rate - self.derivative)
        raw = c.kp * error + self.integral + c.kd * self.derivative + offset
        self.u = min(max(raw, -c.peak_force), c.peak_force)
        if raw == self.u or (raw > self.u) != (error > 0.0):
            self.integral += c.ki * error * PERIOD
        if tick == 10:
            self.r, self.f0 = target, force

    def net(self, t):
        """Force on the carriage but for coupling and what hangs from it."""
        on, x = self.on, self.x
        self.queue.append(self.u)
        gain = 1.0 - math.exp(
            -2.0 * math.pi * STEP * self.of("current_bandwidth", "bandwidth", 1500.0)
        )
        self.motor += gain * (self.queue.pop(0) - self.motor)
        force = self.motor * self.of("force_constant", "ratio", 1.0)
        if "force_saturation" in on:
            limit = on["force_saturation"]["force"]
            force = limit * math.tanh(force / limit)
        if "force_ripple" in on:
            o = on["force_ripple"]
            force *= 1.0 + o["ratio"] * math.sin(2.0 * math.pi * x / o["pitch"] + o["phase"])
        if "torque_ripple" in on:
            o = on["torque_ripple"]
            force *= 1.0 + o["ratio"] * math.sin(2.0 * math.pi * x / o["pitch"] + o["phase"])
        against, rubbing = self.of("force_offset", "force", 0.0) + self.h, 0.0
        if "cogging" in on:
            o = on["cogging"]
            against += o["amplitude"] * math.sin(2.0 * math.pi * x / o["pitch"] + o["phase"])
        if "transmission_ripple" in on:
            o = on["transmission_ripple"]
            against += o["amplitude"] * math.sin(2.0 * math.pi * x / o["pitch"] + o["phase"])
        if "unbalance" in on:
            against += on["unbalance"]["torque"] * math.sin(x + on["unbalance"]["phase"])
        if "low_speed_friction" in on:
            o, share = on["low_speed_friction"], self.v / on["low_speed_friction"]["speed"]
            level = self.axis.friction.coulomb * o["ratio"]
            rubbing += level * math.tanh(5.0 * share) * math.exp(-abs(share))
        if "cable_stiffness" in on:
            against += on["cable_stiffness"]["stiffness"] * (x - on["cable_stiffness"]["center"])
        if "floor_vibration" in on:
            o = on["floor_vibration"]
            against += o["amplitude"] * math.sin(2.0 * math.pi * o["frequency"] * t + o["phase"])
        viscous = self.axis.friction.viscous * self.of("viscous_damping", "ratio", 1.0)
        viscous *= 1.0 + math.copysign(self.of("viscous_asymmetry", "ratio", 0.0), self.v)
        net = force - sum(self.f) - viscous * self.v - rubbing - against
        inertia = (1.0 - self.of("load_friction", "motor_share", 0.0)) * net
        self.transmitted = inertia + against
        return net

    def springs(self):
        """Force of the hanging mass on the carriage, and of the isolators on the base."""
        hung = base = 0.0
        if self.hung:
            w = 2.0 * math.pi * self.on["resonance"]["frequency"]
            reduced = self.hung * self.carriage / self.mass
            hung = reduced * (w * w * self.q + 2.0 * self.on["resonance"]["damping"] * w * self.w)
        if "base_motion" in self.on:
            w = 2.0 * math.pi * self.on["base_motion"]["frequency"]
            mass = self.mass / self.on["base_motion"]["mass_ratio"]
            damping = self.on["base_motion"]["damping"]
            base = -mass * (w * w * self.xb + 2.0 * damping * w * self.vb)
        return hung, base

    def move(self, acceleration, net, hung, base, t):
        if "base_motion" in self.on:
            mass = self.mass / self.on["base_motion"]["mass_ratio"]
            self.vb += STEP * (base - net) / mass
            self.xb += STEP * self.vb
        if self.hung:
            self.w += STEP * (-hung / self.hung - (net + hung) / self.carriage)
            self.q += STEP * self.w
        self.v += STEP * acceleration
        dx = STEP * self.v
        self.x += dx
        if "cable_hysteresis" in self.on:
            o = self.on["cable_hysteresis"]
            self.h = min(max(self.h + o["stiffness"] * dx, -o["force"]), o["force"])
        self.rub(dx, t)

    def rub(self, dx, t):
        friction, side = self.axis.friction, math.copysign(1.0, self.v)
        if side != self.side:
            self.side, self.slips = side, [False] * len(self.f)
        alpha = self.of("stribeck", "static_ratio", friction.static_ratio)
        s = 1.0 + alpha * math.exp(-abs(self.v) / friction.stribeck_velocity)
        level = friction.coulomb * s * self.of("coulomb_level", "ratio", 1.0)
        level *= 1.0 + side * self.of("friction_asymmetry", "ratio", 0.0)
        if "friction_position" in self.on:
            o = self.on["friction_position"]
            level *= 1.0 + o["amplitude"] * math.exp(
                -0.5 * ((self.x - o["center"]) / o["width"]) ** 2
            )
        if "thermal_drift" in self.on:
            o = self.on["thermal_drift"]
            level *= 1.0 + o["amplitude"] * math.exp(-t / o["time_constant"])
        level += s * self.of("load_friction", "ratio", 0.0) * abs(self.transmitted)
        stiffness = friction.stiffness * self.of("presliding_stiffness", "ratio", 1.0)
        decay = math.exp(-friction.attraction / friction.coulomb * STEP / s)
        for i, share in enumerate(self.share):
            goal = side * share * level
            if not self.slips[i]:
                self.f[i] += stiffness / len(self.f) * dx
                if self.f[i] * side >= share * level:
                    self.slips[i] = True
                    self.f[i] = goal
            if self.slips[i]:
                self.f[i] = goal + (self.f[i] - goal) * decay


def plainly(stage, on, demand, offset):
    axes = [PlainAxis(a, on[i], demand[0, i]) for i, a in enumerate(stage.axes)]
    position, force = np.empty_like(demand), np.empty_like(demand)
    coupled = [a.of("cross_coupling", "mass", 0.0) for a in axes]
    t = 0.0
    for k in range(len(demand)):
        position[k] = [a.x for a in axes]
        force[k] = [a.motor for a in axes]
        for tick in range(1, 11):
            for i, axis in enumerate(axes):
                axis.control(demand[k, i], offset[k, i], tick)
            for _ in range(SUBSTEPS):
                nets = np.array([a.net(t) for a in axes])
                springs = [a.springs() for a in axes]
                # Unknown: accelerations relative to the base, and the force left of `net`.
                matrix, right = np.eye(4), np.zeros(4)
                for i, axis in enumerate(axes):
                    base = axis.of("base_motion", "mass_ratio", 0.0) / axis.mass
                    matrix[i, 2 + i] = -(1.0 / axis.carriage + base)
                    right[i] = springs[i][0] / axis.carriage - base * springs[i][1]
                    matrix[2 + i, 1 - i] = coupled[i]
                    right[2 + i] = nets[i]
                solution = np.linalg.solve(matrix, right)
                for i, axis in enumerate(axes):
                    axis.move(solution[i], solution[2 + i], *springs[i], t)
                t += STEP
    return position, force


# The coarse step stays below what a recording can show, 50 nm and 70 mN, at every sample.
both_steps = pytest.mark.parametrize(
    ("substeps", "position_bound", "force_bound"), [(5, 3e-9, 3e-3), (1, 50e-9, 70e-3)]
)


@pytest.fixture(scope="module")
def run(nominal, with_effects, effects):
    """Both axes with these effects: stage, demand, offset, and what the plain equations make."""
    stage = change_axes(nominal, {"elements": 3}, increment=1e-13, rotary=True)
    # 1 mm there and back within 0.12 s, so that forces bend; then a rest.
    phase = np.clip(1e-3 * np.arange(150) / 0.12, 0.0, 1.0)
    smooth = phase - np.sin(2.0 * np.pi * phase) / (2.0 * np.pi)
    demand = np.column_stack(
        [1.0e-3 * np.sin(np.pi * smooth) ** 2, 0.01 - 1.5e-3 * np.sin(np.pi * smooth)]
    )
    offset = np.gradient(np.gradient(demand, 1e-3, axis=0), 1e-3, axis=0) * [8.0, 14.0]
    offset[0] = 0.0

    @functools.cache
    def make(*names):
        on = [{name: VALUES[name] for name in names}, {}]
        if len(names) > 1:
            on[1] = {"cross_coupling": {"mass": -0.3}, "base_motion": VALUES["base_motion"]}
        x, y = (tuple(effects[name].at(**values) for name, values in axis.items()) for axis in on)
        return with_effects(stage, *x, y=y), demand, offset, plainly(stage, on, demand, offset)

    return make


def assert_near(case, substeps, position_bound, force_bound):
    stage, demand, offset, (position, force) = case
    response = simulate(stage, demand, offset, None, substeps=substeps, rounded=False)
    off = np.abs(response.position - position).max(axis=0)
    assert (off < position_bound).all(), off
    off = np.abs(response.force - force).max(axis=0)
    assert (off < force_bound).all(), off


@both_steps
def test_every_effect_at_once(run, substeps, position_bound, force_bound):
    case = run(*VALUES)
    assert 25.0 < np.abs(case[3][1][:, 0]).max() < 110.0
    assert_near(case, substeps, position_bound, force_bound)


@both_steps
@pytest.mark.parametrize("name", VALUES)
def test_one_effect_alone(run, name, substeps, position_bound, force_bound):
    case = run(name)
    # above what the other bound forgives, and of the axis that has it
    shown = np.abs(case[3][1] - run()[3][1]).max(axis=0)
    assert shown[0] > 20 * 3e-3
    assert shown[1] < 1e-9
    assert_near(case, substeps, position_bound, force_bound)


def test_every_searched_effect_takes_part(effects):
    assert {name for name, effect in effects.items() if effect.searched} == set(VALUES)
