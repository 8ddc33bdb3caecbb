"""Which effects cause a gap: the whole diagnosis on simulated stages."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from signal import SIGINT, pthread_kill
from types import SimpleNamespace

import numpy as np
import pytest

from hil_sim.effects.library import library
from sim2real.diagnosis import PHASES, Diagnosis, diagnose, examine
from sim2real.diagnosis.procedure import _clearer, _StageSearch
from sim2real.fitting import NUISANCES, AxisModel, Term, Workers, compose_stage
from sim2real.gap import compare_with_model, gap_closed
from tests.signals import as_in_a_terminal
from tests.unit.sim2real.conftest import TOLERANCE, stage_with

ROUGH = {"amplitude": 0.5, "center": -0.005, "width": 0.012}


def diagnosed(recording, settings, *names):
    """The diagnosis with a library of these effects."""
    known = library()
    examined = examine([recording], settings)
    return diagnose(examined, TOLERANCE, {name: known[name] for name in names})


@dataclass(frozen=True)
class Told:
    """A diagnosis of 0.4 ms of dead time on y, and its progress: phase -> shares done."""

    found: Diagnosis
    progress: dict[str, list[float]]


@pytest.fixture(scope="module")
def late(nominal):
    recording, settings = stage_with(nominal, 11, y={"dead_time": {"delay": 4e-4}}), nominal[1]
    rivals = ("dead_time", "current_bandwidth", "payload_mass", "force_offset")
    told: dict[str, list[float]] = {}

    def progress(what, done, total):
        told.setdefault(what, []).append(done / total)

    examined = examine([recording], settings, progress=progress)
    known = {name: library()[name] for name in rivals}
    return Told(diagnose(examined, TOLERANCE, known, progress=progress), told)


@pytest.mark.slow
def test_a_pull_of_many_times_friction_is_found_beside_another_effect(nominal):
    """A vertical axis without a counterweight: to first order its pull is anything."""
    there = {"force_offset": {"force": 45.0}, "cogging": {"amplitude": 1.5, "pitch": 0.03}}
    there["cogging"]["phase"] = 1.0
    recording = stage_with(nominal, 36, seconds=8.0, x=there)
    rivals = ("friction_position", "presliding_stiffness", "coulomb_level", "force_constant")
    report = diagnosed(recording, nominal[1], *there, *rivals).report
    assert {(c.axis, c.effect) for c in report.causes} == {("x", name) for name in there}
    assert report.unlisted == ()
    (pull,) = (c.parameters["force"] for c in report.causes if c.effect == "force_offset")
    assert pull.value == pytest.approx(45.0, abs=3.0 * pull.sigma)


def test_an_effect_is_named_with_its_figures(late):
    report = late.found.report
    assert [(c.axis, c.effect) for c in report.causes] == [("y", "dead_time")]
    delay = report.causes[0].parameters["delay"]
    assert abs(delay.value - 4e-4) < 3.0 * delay.sigma
    assert report.gap_closed is not None
    assert report.gap_closed > 0.9


def test_progress_is_told_in_every_phase(late):
    told = late.progress
    assert tuple(told) == PHASES
    assert all(max(shares) <= 1.0 for shares in told.values())
    finished = {what for what, shares in told.items() if max(shares) == 1.0}
    assert finished >= {"channels", "floor and gap", "curves", "held-out moves"}
    assert any(0.0 < share < 0.1 for share in told["effects"]), "while the effects are scanned"


@pytest.mark.slow
def test_three_effects_of_one_axis_are_named(nominal):
    there = {
        "dead_time": {"delay": 4e-4},
        "payload_mass": {"mass": 0.8},
        "force_offset": {"force": 2.0},
    }
    recording = stage_with(nominal, 31, x=there)
    found = diagnosed(recording, nominal[1], *there, "cable_stiffness", "viscous_damping")
    assert {(c.axis, c.effect) for c in found.report.causes} == {("x", name) for name in there}
    assert found.report.verdict == "explained"
    for cause in found.report.causes:
        for key, value in there[cause.effect].items():
            assert abs(cause.parameters[key].value - value) < 3.0 * cause.parameters[key].sigma


@pytest.mark.slow
def test_a_mass_beside_a_force_on_no_list_keeps_its_name(nominal):
    """Along the motion it does not show: the closed loop knows it, with the curve as given."""
    there = {"payload_mass": {"mass": 0.8}, "rough_stretch": ROUGH}
    found = diagnosed(stage_with(nominal, 34, x=there), nominal[1], "payload_mass", "dead_time")
    assert [(c.axis, c.effect) for c in found.report.causes] == [("x", "payload_mass")]
    assert found.report.verdict == "partly_explained"
    assert found.report.causes[0].parameters["mass"].value == pytest.approx(0.8, abs=0.1)
    assert [(u.axis, u.over) for u in found.report.unlisted] == [("x", "position_direction")]
    assert found.report.steps == (), "of the whole gap, and the search saw what the curve leaves"


@pytest.mark.slow
def test_what_is_promised_holds_for_what_is_named(nominal):
    """A Coulomb force beyond its usual range is needed beside the mass, and promised with it."""
    there = {"coulomb_level": {"ratio": 1.55}, "payload_mass": {"mass": 0.8}}
    recording = stage_with(nominal, 32, y=there)
    found = diagnosed(recording, nominal[1], *there, "force_offset", "viscous_damping")
    assert {c.effect for c in found.report.causes} == set(there)
    twin = compose_stage(nominal[1], found.twin())
    other = stage_with(nominal, 33, y=there)
    before, after = (compare_with_model(other, s, 1).gap for s in (nominal[1], twin))
    assert found.report.gap_closed is not None
    assert abs(gap_closed(before, after) - found.report.gap_closed) < 0.08


@pytest.mark.slow
def test_an_effect_named_too_early_is_replaced(nominal):
    """Alone, force_constant fits better than the mass; beside the Coulomb force the mass does."""
    there = {"payload_mass": {"mass": -0.6}, "coulomb_level": {"ratio": 0.8}}
    recording = stage_with(nominal, 2, y=there)
    rivals = ("force_constant", "viscous_damping", "presliding_stiffness")
    found = diagnosed(recording, nominal[1], *there, *rivals)
    assert {(c.axis, c.effect) for c in found.report.causes} == {("y", name) for name in there}


@pytest.mark.slow
def test_a_factor_on_the_force_is_not_mass_friction_and_stiffness(nominal):
    """By itself it is all of these; another level of friction hides one of them."""
    there = {
        "force_constant": {"ratio": 1.1},
        "coulomb_level": {"ratio": 1.09},
        "cross_coupling": {"mass": -0.58},
    }
    recording = stage_with(nominal, 32, y=there)
    rivals = ("payload_mass", "viscous_damping", "presliding_stiffness", "friction_asymmetry")
    found = diagnosed(recording, nominal[1], *there, *rivals)
    assert {(c.axis, c.effect) for c in found.report.causes} == {("y", name) for name in there}


@pytest.mark.slow
def test_figures_far_off_do_not_stand_in_for_an_effect(nominal):
    """Mass, friction and stiffness five tolerances off each imitate a factor on the force."""
    there = {
        "cable_hysteresis": {"force": 1.0, "stiffness": 1380.0},
        "force_constant": {"ratio": 0.985},
    }
    recording = stage_with(nominal, 40, y=there)
    found = diagnosed(recording, nominal[1], *there, "payload_mass", "viscous_damping")
    assert {(c.axis, c.effect) for c in found.report.causes} == {("y", name) for name in there}


def test_ctrl_c_ends_the_searches(nominal):
    recording = stage_with(nominal, 11, y={"dead_time": {"delay": 4e-4}})
    examined = examine([recording], nominal[1])
    known = {name: library()[name] for name in ("dead_time", "payload_mass")}
    done: list[int] = []

    def interrupt(what, steps, total):
        done.append(steps)
        if steps and not any(done[:-1]):
            pthread_kill(threading.main_thread().ident or 0, SIGINT)

    with as_in_a_terminal(), pytest.raises(KeyboardInterrupt):
        diagnose(examined, TOLERANCE, known, progress=interrupt)
    assert 0 < max(done) <= 40, "no axis went on to fit what it had scanned"


def test_a_stage_within_tolerance_has_no_gap(nominal):
    recording = stage_with(nominal, 12)
    found = diagnosed(
        recording, nominal[1], "payload_mass", "coulomb_level", "force_offset", "cogging"
    )
    assert found.report.verdict == "no_gap"
    assert found.report.causes == ()


def test_an_effect_outside_the_library_is_not_explained(nominal):
    recording = stage_with(
        nominal, 13, x={"cogging": {"amplitude": 1.5, "pitch": 0.03, "phase": 0.5}}
    )
    found = diagnosed(recording, nominal[1], "force_constant", "dead_time", "cross_coupling")
    assert found.report.verdict in ("unexplained", "partly_explained")


@pytest.mark.slow
def test_what_the_filter_follows_is_found_in_the_closed_loop(nominal):
    """Innovations hardly see another friction level: it is a state of the filter."""
    recording = stage_with(nominal, 14, x={"coulomb_level": {"ratio": 0.87}})
    found = diagnosed(recording, nominal[1], "coulomb_level", "dead_time", "force_constant")
    assert [(c.axis, c.effect) for c in found.report.causes] == [("x", "coulomb_level")]
    assert found.report.gap_closed is not None
    assert found.report.gap_closed > 0.9
    ranked = {c.effect: c.gap_closed for c in found.report.candidates if c.axis == "x"}
    assert ranked["coulomb_level"] == pytest.approx(found.report.causes[0].gap_closed)


@pytest.mark.slow
def test_a_spring_with_a_far_center_is_no_offset(nominal):
    spring = {"stiffness": 12.0, "center": -0.09}
    recording = stage_with(nominal, 15, y={"cable_stiffness": spring})
    found = diagnosed(recording, nominal[1], "cable_stiffness", "force_offset")
    assert [(c.axis, c.effect) for c in found.report.causes] == [("y", "cable_stiffness")]
    for key, true in spring.items():
        parameter = found.report.causes[0].parameters[key]
        assert abs(parameter.value - true) < 3.0 * parameter.sigma


def test_an_effect_in_another_shape_loses_its_name_to_its_coordinate(nominal):
    harmonics = {"amplitude": 1.5, "pitch": 0.03, "phase": 0.7, "second": 0.4, "third": 0.2}
    recording = stage_with(nominal, 16, seconds=8.0, y={"cogging_harmonics": harmonics})
    found = diagnosed(recording, nominal[1], "cogging", "payload_mass")
    assert found.report.verdict == "unexplained"
    assert not found.report.causes
    (over,) = found.report.unlisted
    assert found.report.next_experiment is None, "no two effects are in question"
    assert (over.axis, over.over) == ("y", "position")
    assert over.gap_closed > 0.5
    assert over.period == pytest.approx(harmonics["pitch"], rel=0.02)
    (force,) = found.report.empirical
    assert (
        force.table()["position"][0] < min(recording.axes["y"].position_actual) - harmonics["pitch"]
    )


@pytest.mark.slow
def test_a_warm_up_of_two_stages_is_no_level_beside_another_warm_up(nominal):
    stages = {"amplitude": 0.4, "fast": 1.2, "slow": 95.0, "share": 0.5}
    recording = stage_with(nominal, 16, x={"two_stage_warm_up": stages})
    found = diagnosed(recording, nominal[1], "coulomb_level", "thermal_drift", "cogging")
    assert [c.effect for c in found.report.causes] in ([], ["thermal_drift"])
    assert [u.over for u in found.report.unlisted] == ["time"] or found.report.causes


@pytest.mark.slow
def test_a_level_in_the_place_of_a_missing_warm_up_is_not_named(nominal):
    """What is named beside it stays."""
    effects = {
        "cogging": {"amplitude": 2.0, "pitch": 0.03, "phase": 1.0},
        "thermal_drift": {"amplitude": 0.35, "time_constant": 6.0},
    }
    recording = stage_with(nominal, 16, x=effects)
    found = diagnosed(recording, nominal[1], "coulomb_level", "cogging", "force_offset")
    assert [(c.axis, c.effect) for c in found.report.causes] == [("x", "cogging")]
    assert [(u.axis, u.over) for u in found.report.unlisted] == [("x", "time")]


@pytest.mark.slow
def test_two_strands_are_a_cable_in_another_shape(nominal):
    """Fits of two strands to find them may end with one of them much too stiff."""
    strands = {"two_strand_cable": {"force": 0.77, "stiffness": 5700.0}}
    recording = stage_with(nominal, 10, y=strands)
    found = diagnosed(recording, nominal[1], "cable_hysteresis", "payload_mass", "force_constant")
    named = [(c.axis, c.effect) for c in found.report.causes]
    over = [(u.axis, u.over) for u in found.report.unlisted]
    assert (named, over) in (
        ([("y", "cable_hysteresis")], []),
        ([], [("y", "reversal_path")]),
    )
    assert found.report.verdict in ("partly_explained", "unexplained")


@pytest.mark.slow
def test_what_innovations_do_not_explain_is_sought_in_the_free_loop(nominal):
    """Effects of transmissions are, however little structure they leave."""
    recording = stage_with(nominal, 18, x={"viscous_asymmetry": {"ratio": 0.2}})
    found = diagnosed(
        recording, nominal[1],
        "viscous_asymmetry", "viscous_damping", "friction_asymmetry", "cogging", "force_offset",
    )  # fmt: skip
    assert [(c.axis, c.effect) for c in found.report.causes] == [("x", "viscous_asymmetry")]
    ratio = found.report.causes[0].parameters["ratio"]
    assert abs(ratio.value - 0.2) < 3.0 * ratio.sigma


@pytest.mark.slow
def test_the_flank_of_a_bump_beyond_the_path_is_named(nominal):
    """How high the bump is nobody knows; that it is there is certain."""
    end = float(nominal[0].axes["x"].position_demand[:3000].max())
    bump = {"amplitude": 0.5, "center": end + 0.03, "width": 0.02}
    recording = stage_with(nominal, 71, x={"friction_position": bump})
    found = diagnosed(recording, nominal[1], "friction_position", "force_offset", "coulomb_level")
    (cause,) = found.report.causes
    assert (cause.axis, cause.effect) == ("x", "friction_position")
    assert cause.parameters["amplitude"].sigma > abs(cause.parameters["amplitude"].value)


@pytest.mark.slow
def test_a_narrow_bump_is_found_where_the_curve_has_it(nominal):
    """Between the places of any grid over the travel."""
    there = {"friction_position": {"amplitude": 0.8, "center": 0.0113, "width": 4e-4}}
    recording, settings = stage_with(nominal, 12, seconds=8.0, x=there), nominal[1]
    found = diagnosed(recording, settings, *there, "force_offset", "coulomb_level")
    (cause,) = found.report.causes
    assert found.report.verdict == "explained"
    for key, value in there["friction_position"].items():
        assert abs(cause.parameters[key].value - value) < 3.0 * cause.parameters[key].sigma, key


def test_a_force_constant_beside_what_it_scales_is_no_curve(nominal):
    """A mass is found first, and a curve over velocity explains nearly all of the rest."""
    known = library()
    there = {"force_constant": {"ratio": 0.85}, "viscous_damping": {"ratio": 0.4}}
    recording = stage_with(nominal, 23, x=there)
    with Workers() as workers:
        stage = _StageSearch(
            examine([recording], nominal[1]), TOLERANCE, known, workers, lambda *_: None
        )
        found = (("payload_mass", 1.5), ("viscous_damping", 0.6))
        model = AxisModel(
            np.zeros(NUISANCES), tuple(Term(known[name], (value,)) for name, value in found)
        )
        assert stage.curves("x")[0].gap_closed > 0.8
        assert not stage.is_curve("x", [model], is_complete=True)


@pytest.mark.parametrize(
    ("along", "other", "shown"),
    [
        (None, ("force", 0.8), "force"),
        (("force", 0.4), ("force", 0.8), "force along"),
        (("time", 0.4), ("force", 0.8), "force"),
        (("time", 0.9), ("force", 0.6), "time along"),
    ],
)
def test_innovations_give_the_coordinate_where_they_show_it_more_clearly(along, other, shown):
    def found(over, closed, where=""):
        return (SimpleNamespace(over=over, gap_closed=closed, text=f"{over} {where}".strip()),)

    (clearer,) = _clearer(found(*along, "along") if along else (), found(*other))
    assert clearer.text == shown
