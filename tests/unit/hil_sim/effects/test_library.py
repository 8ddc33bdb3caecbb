"""The library's effects as the format names them, and effects of other packages."""

import math
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hil_sim.effects.library import EffectError, library, possible_on
from hil_sim.effects.ports import EffectPorts

DOCS = Path(__file__).parents[4] / "docs"
FORMAT = DOCS / "formats" / "effects.md"
TIMES = "\N{MULTIPLICATION SIGN}"


PACKAGE = '''
from hil_sim.effects import Effect, Parameter


class Draught(Effect):
    """Moving air."""

    name = "draught"
    group = "force"
    parameters = (Parameter("force", "N", "of the air", (0.1, 0.2), neutral=0.0),)
    equation = "F_d += force"
    enters = "A constant disturbance force."
    remedy = "Close the door."

    def apply(self, ports, parameters):
        ports.force += parameters["force"]


class Twin(Draught):
    name = "cogging"


NOTHING = 3
'''


def table_under(heading):
    """Cells of the rows of the table under a heading of the format."""
    section = FORMAT.read_text(encoding="utf-8").partition(f"\n## {heading}\n")[2]
    lines = [line for line in section.partition("\n## ")[0].splitlines() if line.startswith("|")]
    return [tuple(cell.strip() for cell in line.strip("|").split("|")) for line in lines[2:]]


def typical(parameter):
    if parameter.role == "table":
        return "list"
    if parameter.plausible is None:
        return "travel" if parameter.role == "place" else "0…2π"
    low, high = parameter.plausible
    scale = {
        "mass": f" {TIMES} m",
        "travel": f" {TIMES} travel",
        "velocity limit": f" {TIMES} velocity limit",
        "rated force": f" {TIMES} rated force",
        "Coulomb force": f" {TIMES} Fc",
        "Coulomb force over the travel": f" {TIMES} Fc/travel",
        None: "",
    }
    turning = ""
    if parameter.plausible_turning is not None:
        turning = "; turning {:g}…{:.3g}".format(*parameter.plausible_turning)
    sign = "±" if parameter.signed else ""
    return f"{sign}{low:g}…{high:g}{scale[parameter.relative_to]}{turning}"


def allowed(parameter):
    limits = (("> ", parameter.above), ("≥ ", parameter.least), ("< ", parameter.below))
    return ", ".join(f"{sign}{limit:g}" for sign, limit in limits if math.isfinite(limit))


def neutral(parameter):
    names = {"static_ratio": "alpha", "current_bandwidth": "nominal", None: "", math.inf: "∞"}
    return names.get(parameter.neutral) if parameter.neutral in names else f"{parameter.neutral:g}"


def test_equations_are_those_of_the_format(effects):
    ours = [(e.name, e.equation.replace("*", TIMES).replace("+-", "±")) for e in effects.values()]
    assert table_under("Equations") == ours


def test_keys_units_and_ranges_are_those_of_the_format(effects):
    ours = [
        (e.name, p.key, p.unit, typical(p), allowed(p), neutral(p), p.meaning)
        for e in effects.values()
        for p in e.parameters
    ]
    assert table_under("Keys") == ours


def test_every_effect_describes_itself_within_its_limits(effects, nominal):
    for name, effect in effects.items():
        assert effect.name == name
        for text in (effect.origin(), effect.remedy, effect.enters):
            assert text.endswith("."), (name, text)
        assert len(effect.origin()) > 80, name
        assert any(p.neutral is not None or p.role == "table" for p in effect.parameters), name
        for parameter in effect.parameters:
            for axis in nominal.axes:
                for low, high in parameter.ranges(axis):
                    assert low < high
                    assert parameter.refusal(low) is None, (name, parameter.key)
                    assert parameter.refusal(high) is None, (name, parameter.key)
            assert parameter.refusal((1.0, math.nan) if parameter.role == "table" else math.nan)
            neutral = parameter.neutral_on(nominal.axes[0])
            assert (neutral is None) == (parameter.role != "size"), (name, parameter.key)


def test_ranges_are_those_of_the_axis(effects, nominal):
    x, y = nominal.axes
    (mass,) = effects["payload_mass"].parameters
    assert mass.ranges(y) == (pytest.approx((-2.1, -0.42)), pytest.approx((0.42, 2.1)))
    (force,) = effects["force_saturation"].parameters
    assert force.ranges(x) == (pytest.approx((40.0, 72.0)),)
    _, center, _ = effects["friction_position"].parameters
    assert center.ranges(x) == (x.travel,)
    _, speed = effects["low_speed_friction"].parameters
    assert speed.ranges(replace(x, velocity=3.0)) == ((6e-3, 0.12),)


@pytest.mark.parametrize(
    ("name", "turning"),
    [
        ("cogging", (0.07, 1.6)),
        ("force_ripple", (0.02, 0.5)),
        ("torque_ripple", (0.01, 2.0 * math.pi)),
        ("transmission_ripple", (0.01, 2.0 * math.pi)),
    ],
)
def test_pitches_of_an_axis_that_turns_are_angles(effects, nominal, name, turning):
    x = nominal.axes[0]
    pitch = effects[name].parameters[1]
    assert pitch.ranges(x) == (pitch.plausible,)
    assert pitch.ranges(replace(x, rotary=True)) == (turning,)
    assert effects["stribeck"].parameters[0].neutral_on(x) == x.friction.static_ratio


def test_an_axis_can_have_all_but_what_needs_an_angle_or_a_table(effects, nominal):
    axis = nominal.axes[0]
    tables = {name for name in effects if name.endswith("_table")}
    assert len(tables) == 5
    assert set(effects) - set(possible_on(axis, effects)) == {"unbalance", *tables}
    assert set(effects) - set(possible_on(replace(axis, rotary=True), effects)) == tables


def test_every_effect_enters_the_ports(effects, nominal):
    axis = replace(nominal.axes[0], rotary=True)
    plain = vars(EffectPorts(axis, 1e-3, 0.1))
    for effect in effects.values():
        if any(p.role == "table" for p in effect.parameters):
            continue  # a test of its own
        values = {p.key: p.ranges(axis)[-1][1] for p in effect.parameters}
        ports = EffectPorts(axis, 1e-3, 0.1)
        effect.at(**values).apply(ports)
        ports.check(2)
        changed = [
            k for k, v in vars(ports).items() if v is not plain[k] and str(v) != str(plain[k])
        ]
        assert changed, effect.name


def test_the_example_of_the_docs_is_an_effect(nominal):
    page = (DOCS / "how-to" / "add-an-effect.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.S)
    space: dict[str, object] = {}
    exec(code, space)  # noqa: S102 - our own page
    ports = EffectPorts(nominal.axes[0], 1e-3, 0.1)
    space["CoverDrag"]().at(drag=50.0).apply(ports)
    speed = ports.velocities
    np.testing.assert_allclose(ports.velocity_force, 50.0 * speed * np.abs(speed))


@pytest.fixture
def package(tmp_path, monkeypatch):
    """An installed distribution with these entry points, until the test ends."""

    def install(points):
        (tmp_path / "breeze.py").write_text(PACKAGE)
        info = tmp_path / "breeze-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: breeze\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[stagectl.effects]\n{points}\n")
        monkeypatch.syspath_prepend(str(tmp_path))

    yield install
    sys.modules.pop("breeze", None)


def test_another_package_brings_an_effect(package, effects, nominal):
    package("draught = breeze:Draught")
    known = library()
    assert set(known) == {*effects, "draught"}
    ports = EffectPorts(nominal.axes[0], 1e-3, 0.1)
    known["draught"].at(force=0.2).apply(ports)
    assert ports.force == 0.2


@pytest.mark.parametrize(
    ("point", "reason"),
    [
        (
            "x = breeze:Twin",
            "breeze: entry point 'x' in stagectl.effects: .*'cogging' exists already",
        ),
        ("x = breeze:NOTHING", "is not a hil_sim.effects.Effect"),
        ("x = breeze:Gone", "AttributeError"),
        ("x = breze:Draught", "ModuleNotFoundError"),
    ],
)
def test_another_packages_mistake_is_named(package, point, reason):
    package(point)
    with pytest.raises(EffectError, match=reason):
        library()
