"""Diagnoses without a controller, on machines whose equations are not the simulator's."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from hil_sim.effects.library import library
from hil_sim.settings import CascadeSettings
from sim2real.attribution import AxisResult
from sim2real.diagnosis import diagnose, examine, examine_others, judge_elsewhere
from sim2real.diagnosis.along_motion import find_doubtful, named
from sim2real.diagnosis.clock import find_common_clock
from sim2real.findings import ForceCurve, Unlisted
from sim2real.fitting import Term, Workers
from sim2real.free_loop import fit_figures, move_covariance, refit_without, search_free
from sim2real.open_loop import MotionLoop
from stagectl.config import stage_settings
from stagectl.importing import import_recording, load_map
from tests.unit.sim2real.conftest import TOLERANCE, stage_with
from tests.unit.sim2real.other_machines import (
    ACTUATOR,
    BELT,
    ROBOT,
    SCREW,
    TOOL,
    sliding,
    strokes,
    swings,
)


def examined(machine, folder):
    data, how = machine.write(folder)
    columns, model = load_map(how)
    recording = import_recording(data, columns, model)
    return examine([recording], stage_settings(model), unknown=model.unknown)


def report_of(machine, folder, *rivals):
    """The diagnosis with these effects, else with the whole library."""
    known = library()
    tried = {name: known[name] for name in rivals} if rivals else known
    found = diagnose(examined(machine, folder), {"a": 0.02}, tried, jobs=2)
    assert found.report.mode == "open_loop"
    return found.report


@pytest.fixture(scope="module")
def tool(tmp_path_factory):
    """A machine tool as examined and its diagnosis with the whole library."""
    found = examined(TOOL, tmp_path_factory.mktemp("tool"))
    return found, diagnose(found, {"a": 0.02}, library(), jobs=2)


def figures(report):
    return {f.figure: f for f in report.fitted}


def test_a_machine_tool_with_a_counterweight(tool):
    report = tool[1].report
    assert (report.mode, report.verdict) == ("open_loop", "explained")
    assert [c.effect for c in report.causes] == ["force_offset"]
    assert report.causes[0].parameters["force"].value == pytest.approx(80.0, rel=0.05)
    assert report.gap_closed > 0.95
    mass = figures(report)["mass"]
    assert mass.value == pytest.approx(300.0, abs=3.0 * mass.sigma)
    assert mass.sigma < 10.0
    assert "no demand of a was logged" in report.reason
    assert report.channels == ()


@pytest.mark.parametrize("pull", [900.0, 20_000.0])
def test_a_pull_of_many_times_friction_is_no_spring(tmp_path, pull):
    """A vertical axis, whose friction wanders: a slope over position fits that a little better."""

    def force(t, x, v, a):
        level = 250.0 * (1.0 + 0.1 * np.sin(2 * np.pi * t / 17.0))
        return 300.0 * a + sliding(v, level, 400.0) + pull

    lift = replace(TOOL, force=force, duration=30.0, rated=max(1000.0, pull))
    report = report_of(lift, tmp_path, "force_offset", "cable_stiffness", "friction_asymmetry")
    assert [c.effect for c in report.causes] == ["force_offset"]
    assert report.causes[0].parameters["force"].value == pytest.approx(pull, rel=0.03)


def test_an_arm_that_hardly_turns_has_a_weight_rather_than_a_spring(tmp_path):
    """Over a third of a radian both are a slope; the report says so."""

    def force(t, q, v, a):
        wander = 0.3 * np.sin(2 * np.pi * t / 7.0)
        return 0.1 * a + sliding(v, 4.0, 3.0) + 8.0 * (q + 0.15) + wander

    joint = replace(
        ROBOT, motion=swings((0.15, 0.05), (0.3, 0.8)), force=force, noise=(1e-6, 0.5), rate=100.0
    )
    report = report_of(joint, tmp_path, "unbalance", "cable_stiffness", "friction_asymmetry")
    assert [c.effect for c in report.causes] == ["unbalance"]
    assert [set(c.effects) for c in report.confusable] == [{"unbalance", "cable_stiffness"}]


@pytest.fixture(scope="module")
def two_steps(tool):
    """A search whose first step is a constant force, and whose second one no machine needs."""
    loop = MotionLoop("a", tool[0].motions, tool[0].settings, 0.02, Workers(1))
    search = search_free(loop, {"force_offset": library()["force_offset"]})
    both = search.best.model.added(Term(library()["viscous_asymmetry"], (0.05,)))
    more = replace(search.steps[0], effects=both.names(), added=("viscous_asymmetry",), model=both)
    best, folds = fit_figures(loop, both)
    return replace(search, best=best, folds=folds, steps=[*search.steps, more])


class Curves:
    """Rivals that leave some sets of names, and beside which some effects are not needed."""

    def __init__(self, *left, needless=()):
        self.left, self.needless = left, needless

    def leave_names(self, models):
        return any(model.names() in self.left for model in models)

    def doubts(self, model, kept):
        return tuple(name for name in self.needless if name not in kept), ()


def test_what_several_effects_cannot_keep_the_first_may(two_steps):
    offset, both = ("force_offset",), ("force_offset", "viscous_asymmetry")
    for curves, names in [
        (Curves(both), both),
        (Curves(both, needless=offset), both),
        (Curves(both, needless=both), offset),
        (Curves(), offset),
        (Curves(offset), offset),
    ]:
        found, keeps, untaken = named(two_steps, curves, curves)
        assert (found.best.model.names(), keeps, untaken) == (names, True, offset)
        assert [step.effects for step in found.steps][-1] == names
    early = [replace(step, closed=0.8) for step in two_steps.steps]
    curves = Curves(offset)
    found, keeps, _ = named(replace(two_steps, steps=early), curves, curves)
    assert (found.best.model.names(), keeps) == (both, False)


@pytest.fixture(scope="module")
def pull_and_spring(two_steps):
    """A constant force beside a spring that may be centered anywhere: neither has a figure."""
    loop = two_steps.loop
    spring = Term(library()["cable_stiffness"], (150.0, 0.9))
    best, folds = fit_figures(loop, two_steps.steps[0].model.added(spring))
    return replace(two_steps, best=best, folds=folds)


def test_what_is_doubted_leaves_the_model_and_the_rest_is_fitted_anew(pull_and_spring):
    alone = refit_without(pull_and_spring, "cable_stiffness")
    assert alone.best.model.names() == ("force_offset",)
    assert [step.effects for step in alone.steps] == [("force_offset",)]
    assert alone.best.model.terms[0].values[0] == pytest.approx(80.0, rel=0.02)
    assert alone.closed > 0.95


def test_of_two_that_are_doubted_the_one_that_gives_back_less_leaves(pull_and_spring):
    loop, best = pull_and_spring.loop, pull_and_spring.best
    best = replace(best, covariance=move_covariance(loop, best))
    result = AxisResult(axis=loop.axis, spread=loop.spread, best=best, free=pull_and_spring)
    shares = {"force_offset": 0.9, "cable_stiffness": 0.001}

    def given_back(_, index):
        share = shares[best.model.names()[index]]
        return share, (share, share)

    held_out = SimpleNamespace(given_back=given_back)
    assert find_doubtful(result, held_out) == "cable_stiffness"
    curve = Unlisted("a", "position", (), 0.9, 0.9, (0.8, 1.0), ForceCurve((), (), ()))
    assert find_doubtful(replace(result, unlisted=[curve]), held_out) is None
    assert find_doubtful(replace(result, doubted=best.model.names()), held_out) is None


@pytest.mark.slow
def test_an_effect_beside_a_force_on_no_list_keeps_its_name(nominal):
    rough = {"amplitude": 0.5, "center": -0.005, "width": 0.012}
    there = {"viscous_damping": {"ratio": 1.6}, "rough_stretch": rough}
    recording = stage_with(nominal, 35, seconds=6.0, x=there)
    known = {name: library()[name] for name in ("viscous_damping", "force_offset")}
    report = diagnose(
        examine([recording], nominal[1], open_loop="asked for"), TOLERANCE, known
    ).report
    assert [(c.axis, c.effect) for c in report.causes] == [("x", "viscous_damping")]
    assert report.causes[0].probability <= 0.85
    assert report.causes[0].parameters["ratio"].value == pytest.approx(1.6, abs=0.05)
    assert [(u.axis, u.over) for u in report.unlisted] == [("x", "position_direction")]
    assert report.verdict == "partly_explained"
    assert report.steps == ()


@pytest.mark.slow
def test_a_robot_joint_that_never_rests(tmp_path):
    rivals = ("unbalance", "force_offset", "cable_stiffness", "cogging", "viscous_damping")
    report = report_of(replace(ROBOT, rate=500.0), tmp_path, *rivals)
    assert report.verdict == "explained"
    assert [c.effect for c in report.causes] == ["unbalance"]
    assert report.causes[0].parameters["torque"].value == pytest.approx(15.0, rel=0.05)
    assert report.causes[0].parameters["phase"].value == pytest.approx(0.3, abs=0.05)
    assert figures(report)["mass"].value == pytest.approx(1.2, rel=0.1)


@pytest.mark.slow
def test_a_belt_with_a_worn_place(tmp_path):
    rivals = ("friction_position", "thermal_drift", "coulomb_level", "cable_stiffness", "cogging")
    report = report_of(BELT, tmp_path, *rivals)
    assert [c.effect for c in report.causes] == ["friction_position"]
    assert report.causes[0].parameters["center"].value == pytest.approx(0.7, abs=0.02)
    assert figures(report)["coulomb"].value == pytest.approx(20.0, rel=0.05)


@pytest.mark.slow
def test_a_ball_screw_in_amperes_and_counts(tmp_path):
    rivals = ("transmission_ripple", "viscous_asymmetry", "friction_position", "force_ripple")
    report = report_of(SCREW, tmp_path, *rivals)
    assert report.causes[0].effect == "transmission_ripple"
    assert report.causes[0].parameters["pitch"].value == pytest.approx(0.01, rel=1e-3)


@pytest.mark.slow
def test_a_small_actuator_that_warms_up(tmp_path):
    report = report_of(ACTUATOR, tmp_path)
    assert [c.effect for c in report.causes] == ["thermal_drift"]
    assert report.gap_closed > 0.8


@pytest.mark.slow
def test_the_ripple_of_a_joint_with_a_gear(tmp_path):
    """One period per turn of the motor, behind 1:100."""
    joint = replace(
        ROBOT,
        force=lambda t, q, v, a: 1.2 * a + sliding(v, 4.0, 3.0) + 0.8 * np.sin(100.0 * q + 0.7),
        noise=(1e-6, 0.3),
        rate=500.0,
    )
    rivals = ("transmission_ripple", "cogging", "unbalance", "friction_position")
    report = report_of(joint, tmp_path, *rivals)
    (cause,) = report.causes
    assert cause.effect in ("transmission_ripple", "cogging")  # by one equation
    assert cause.parameters["pitch"].value == pytest.approx(0.02 * np.pi, rel=1e-3)


def test_what_was_found_is_judged_along_the_motion_of_other_recordings(tool, tmp_path):
    found, diagnosis = tool
    faster = replace(TOOL, motion=strokes(0.3, (0.1, 0.25), 1.5), seed=9)
    data, how = faster.write(tmp_path)
    other = import_recording(data, *load_map(how))
    judges = examine_others(
        found, [other], found.settings, correct=False, clock=find_common_clock([other])
    )
    assert judges.settings.axes[0].mass == found.settings.axes[0].mass
    report = judge_elsewhere(diagnosis, judges)
    assert report.gap_closed_elsewhere > 0.9
    assert report.steps[0].elsewhere > 0.9


def test_where_nothing_is_wrong_the_fitted_figures_are_named(tmp_path):
    plain = replace(TOOL, force=lambda t, x, v, a: TOOL.force(t, x, v, a) - 80.0)
    report = report_of(plain, tmp_path, "force_offset", "cable_stiffness", "thermal_drift")
    assert report.verdict == "no_gap"
    assert "up to 20 Hz; with mass and coulomb and viscous as fitted" in report.reason


def test_a_known_machine_without_an_effect_has_no_gap(tmp_path):
    plain = replace(
        TOOL,
        force=lambda t, x, v, a: TOOL.force(t, x, v, a) - 80.0,
        known=("300", "250", "400"),
    )
    report = report_of(plain, tmp_path)
    assert (report.verdict, report.causes, report.fitted) == ("no_gap", (), ())


@pytest.mark.slow
def test_a_machine_file_far_off_is_no_small_gap(tmp_path):
    """Forces that vary by less than they are off."""
    wrong = replace(TOOL, known=("30", "800", "400"), noise=(1e-6, 300.0))
    assert report_of(wrong, tmp_path).verdict != "no_gap"


def test_positions_alone_say_what_is_missing(tmp_path):
    data, how = TOOL.write(tmp_path)
    text = how.read_text().splitlines()
    how.write_text("\n".join(line for line in text if "force_actual" not in line))
    columns, model = load_map(how)
    recording = import_recording(data, columns, model)
    found = examine([recording], stage_settings(model), unknown=model.unknown)
    assert "no force of a was logged" in found.insufficient
    report = diagnose(found, {"a": 0.02}, library(), jobs=1).report
    assert (report.verdict, report.mode) == ("insufficient", "open_loop")


@pytest.mark.slow
def test_another_controller_is_no_gap_of_the_plant_but_not_no_gap(stage, recorded):
    loops = CascadeSettings(position_gain=20.0, velocity_gain=100.0)
    control = {a.name: replace(a.control, cascade=loops) for a in stage.axes}
    other = replace(stage, axes=tuple(replace(a, control=control[a.name]) for a in stage.axes))
    found = examine([recorded], other)
    assert "controller_unknown" in {f.finding for f in found.findings}
    assert found.open_loop is not None
    report = diagnose(found, dict.fromkeys(recorded.axes, 0.003), library(), jobs=1).report
    assert report.mode == "open_loop"
    assert report.verdict != "no_gap"
    assert not report.causes
    assert np.isfinite(report.gap["x"]["force"].nominal)


def with_force(machine, folder, change, **how):
    data, columns = machine.write(folder)
    columns, model = load_map(columns)
    recording = import_recording(data, columns, model)
    a = recording.axes["a"]
    made = replace(recording, axes={"a": replace(a, force_actual=change(a.force_actual))})
    return examine([made], stage_settings(model), unknown=model.unknown, **how)


def test_a_force_that_was_logged_late_is_a_finding(tmp_path):
    found = with_force(TOOL, tmp_path, lambda f: np.roll(f, 4))
    (delay,) = found.findings
    assert (delay.channel, delay.finding, delay.applied) == ("force_actual", "delay", False)
    assert delay.value == pytest.approx(0.04, abs=0.002)
    assert found.insufficient.endswith("late; correct it first, or continue with --correct")
    assert "force" in found.gap["a"]


def test_a_force_that_was_logged_late_is_corrected(tmp_path):
    found = with_force(TOOL, tmp_path, lambda f: np.roll(f, 4), correct=True)
    assert found.insufficient is None
    assert [(f.finding, f.applied) for f in found.findings] == [("delay", True)]
    assert found.settings.axes[0].mass == pytest.approx(300.0, rel=0.03)


def test_a_force_without_its_sign_is_named(tmp_path):
    found = with_force(TOOL, tmp_path, np.abs, correct=True)
    assert [(f.finding, f.applied) for f in found.findings] == [("sign", False)]
    assert found.insufficient == (
        "a: force_actual has one sign while the motion reverses: log it with its sign"
    )


def test_a_slow_log_in_coarse_steps_is_insufficient(tmp_path):
    """10 Hz and 1 mm, of strokes of 20 mm."""
    slow = replace(TOOL, rate=10.0, motion=strokes(0.02, (0.01, 0.02), 0.5))
    data, how = slow.write(tmp_path)
    columns, model = load_map(how)
    recording = import_recording(data, columns, model)
    a = recording.axes["a"]
    coarse = replace(a, position_actual=np.round(a.position_actual, 3))
    found = examine(
        [replace(recording, axes={"a": coarse})], stage_settings(model), unknown=model.unknown
    )
    assert "does not tell it" in found.insufficient


@pytest.mark.parametrize("friction", [0.5, 0.01])
def test_the_weight_of_an_arm_whose_inertia_is_next_to_nothing(tmp_path, friction):
    """Beside friction, or beside the weight where friction is next to nothing, too."""
    joint = replace(
        ROBOT,
        rate=50.0,
        motion=swings((0.8, 0.2), (0.06, 0.13)),
        force=lambda t, x, v, a: 0.01 * a + sliding(v, friction, 0.6 * friction) + 3.0 * np.sin(x),
        noise=(1e-4, 0.02),
        duration=60.0,
    )
    report = report_of(joint, tmp_path, "unbalance", "cable_stiffness", "force_offset")
    assert [c.effect for c in report.causes] == ["unbalance"]
    mass = figures(report)["mass"]
    assert mass.value < 0.01 + 3.0 * mass.sigma
