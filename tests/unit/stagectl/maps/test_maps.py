"""Friction maps: built from what moves have shown, versions, checks, comparison, tables, page."""

import csv
import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from stagectl.calibration import DueSection, due_sites
from stagectl.config.machine_file import load_machine
from stagectl.errors import UnusableInput
from stagectl.history import (
    EstimateRecord,
    RunEntry,
    StageKey,
    measured_level,
    misfit_error,
    open_history,
)
from stagectl.maps import (
    MapVersion,
    TrackedPlaces,
    build_map,
    compare,
    load_active,
    map_versions,
    outdated,
    problems,
    sites_outside,
    to_json,
)
from stagectl.maps.active import REPLAYED
from stagectl.maps.export import (
    grid_table,
    refused_table,
    sites_table,
    trend_table,
    write_table,
)
from stagectl.maps.learning import figure_drift
from stagectl.maps.model import from_json
from stagectl.maps.report import render

STAGE = StageKey("wafer-xy", True)
BEGIN = 1.7e9
GRID = [(x * 0.02 - 0.04, y * 0.02 - 0.04) for y in range(5) for x in range(5)]


def level(axis, place):
    """The table: +-15 % over some 60 mm."""
    x, y = place
    wave = math.sin(25 * x + 1.0) * math.cos(20 * y) if axis == "x" else math.cos(22 * x - 15 * y)
    return (6.0 if axis == "x" else 9.0) * (1.0 + 0.15 * wave)


@pytest.fixture
def history(tmp_path):
    opened = open_history(str(tmp_path / "stage.db"), write=True)
    yield opened
    opened.close()


def calibrate(history, at=BEGIN, spot=None, everywhere=1.0, sites=GRID, seed=1, falls=0.0):
    """A calibration as the history has it: four moves a site, 1 % wander."""
    generator = np.random.default_rng(seed)
    number = history.start_run(
        RunEntry(STAGE, ("x", "y"), at, "cal", None, None, "stagectl", "runs/c", "calibration")
    )
    rows = []
    for i, place in enumerate([*sites, sites[0]]):
        for k in range(4):
            for axis in "xy":
                value = level(axis, place) * everywhere * (1.2 if place == spot else 1.0)
                value *= 1.0 - falls * (3 * i + 0.6 * k)
                shown = value * (1.0 + 0.01 * generator.standard_normal())
                rows.append(
                    EstimateRecord(
                        number, axis, "other", i + 1, place, at + 3 * i + 0.6 * k, 1e-3, True,
                        None, {"coulomb": value, "viscous": 20.0}, (0.01, 0, 0, 0.1), 1.0,
                        (shown, 0.003 * value),
                    )
                )  # fmt: skip
    history.add(rows)
    return number


def keep(history, at):
    built = build_map(history, STAGE, until=at + 1000)
    return history.save_map(STAGE, at, "weekly", to_json(built)), built


def test_a_map_knows_its_sites_and_places_between_them(history):
    calibrate(history)
    _, built = keep(history, BEGIN)
    for name, axis in built.axes.items():
        assert len(axis.sites) == 25
        assert {site.count for site in axis.sites} == {4, 8}
        errors = np.array([s.coulomb / level(name, s.place) - 1 for s in axis.sites])
        assert errors.std() < 0.008
        assert abs(errors.mean()) < 0.02  # the common level is the tracking's business
        assert np.median([site.sigma for site in axis.sites]) < 0.012
        places = np.random.default_rng(2).uniform(-0.04, 0.04, (100, 2))
        found = axis.field().at(places)
        truth = np.array([level(name, p) for p in places])
        assert np.sqrt(np.mean((found.value / truth - 1) ** 2)) < 0.02
        assert axis.figures["viscous"][0] == 20.0


@pytest.mark.parametrize("falls", [0.0, 1e-3])
def test_a_table_that_falls_while_it_is_measured_is_not_taken_for_tilted(history, falls):
    """8 % in the 78 s from the first row of sites to the last; the first site is seen again."""
    calibrate(history, falls=falls)
    built = build_map(history, STAGE)
    for name, axis in built.axes.items():
        off = np.log([site.coulomb / level(name, site.place) for site in axis.sites])
        off -= off.mean()
        said = math.sqrt(np.mean([site.sigma**2 for site in axis.sites]))
        assert np.sqrt(np.mean(off**2)) < min(0.012, 1.5 * said)
        assert abs(off[:5].mean() - off[-5:].mean()) < 0.012


def test_a_site_seen_alone_is_not_known_for_certain(history):
    """Whether a change there is its own or that of all sites, nobody knows."""
    calibrate(history)
    calibrate(history, BEGIN + 3600, sites=GRID[12:13], seed=2)
    for axis in build_map(history, STAGE).axes.values():
        sigma = {site.place: site.sigma for site in axis.sites}
        assert 0.4 * np.median(list(sigma.values())) < sigma[GRID[12]] < 0.02


def test_too_little_makes_no_map(history):
    calibrate(history, sites=GRID[:3])
    with pytest.raises(UnusableInput, match="stagectl calibrate"):
        build_map(history, STAGE)


def test_a_map_survives_its_own_format_and_damage_is_told(history):
    calibrate(history)
    _, built = keep(history, BEGIN)
    assert from_json(to_json(built), "m") == built
    for text in ("", "[]", "{}", to_json(built)[:-40], to_json(built).replace("gaussian", "x")):
        with pytest.raises(UnusableInput, match="m: not a usable friction map"):
            from_json(text, "m")
    newer = to_json(built).replace('"version": 1', '"version": 9')
    with pytest.raises(UnusableInput, match="newer"):
        from_json(newer, "m")


def test_versions_activation_and_rollback(history):
    calibrate(history)
    first, _ = keep(history, BEGIN)
    second, _ = keep(history, BEGIN + 1)
    assert (first, second) == (1, 2)
    with pytest.raises(ValueError, match="no map 7"):
        history.activate(STAGE, 7, BEGIN, "activated")
    for number in (1, 2, None, 1):
        history.activate(STAGE, number, BEGIN, "activated")
        assert [v.number for v in map_versions(history, STAGE) if v.active] == [
            n for n in (number,) if n
        ]
    assert [a.number for a in history.activations(STAGE)] == [1, 2, None, 1]


def test_what_speaks_against_a_map(history):
    machine = load_machine()
    calibrate(history, spot=GRID[12])
    _, built = keep(history, BEGIN)
    found = problems(built, machine)
    assert not any(p.grave for p in found)
    assert any("neighbours" in p.text and "axis x: site (0, 0) mm" in p.text for p in found)
    x = built.axes["x"]
    far = replace(x.sites[0], place=(0.4, 0.0))
    wild = tuple(replace(site, coulomb=site.coulomb * 9) for site in x.sites)
    vague = tuple(replace(site, sigma=0.4) for site in x.sites)
    cases = {
        "outside the travel": {"x": replace(x, sites=(far, *x.sites[1:]))},
        "times the machine file's": {"x": replace(x, sites=wild)},
        "not known to": {"x": replace(x, sites=vague)},
        "the machine has none": {"z": x},
        "only 2 sites": {"x": replace(x, sites=x.sites[:2])},
    }
    for reason, axes in cases.items():
        grave = [p.text for p in problems(replace(built, axes=axes), machine) if p.grave]
        assert any(reason in text for text in grave), reason
    other = replace(built, stage=StageKey("another", True))
    assert any("the machine is wafer-xy" in p.text for p in problems(other, machine) if p.grave)


def test_comparison_tells_a_spot_from_the_whole_table(history):
    calibrate(history)
    _, before = keep(history, BEGIN)
    calibrate(history, BEGIN + 7 * 86400, GRID[7], 1.08, seed=2)
    _, after = keep(history, BEGIN + 7 * 86400)
    for axis in compare(before, after):
        assert axis.common == pytest.approx(0.08, abs=0.02)
        assert axis.sites[0].place == GRID[7]
        assert axis.sites[0].change == pytest.approx(0.2, abs=0.05)
        assert [s.place for s in axis.sites if s.significant] == [GRID[7]]


def estimate(shown, zones="AB", misfit=0.6, level=1.0, accepted=True, expected=(6.0, 0.06)):
    """Of a move before which so much was expected [N]."""
    return SimpleNamespace(
        shown=shown, zones=zones, misfit=misfit, accepted=accepted, level=level,
        friction=SimpleNamespace(coulomb=6.0), expected=expected,
    )  # fmt: skip


def test_what_a_measurement_is_worth():
    """A move that hardly slid, and one that the model does not explain, say less of the level."""
    assert measured_level(estimate(None, "B", 0.4)) is None
    sigmas = [
        measured_level(estimate((6.0, 0.02), zones, misfit))[1]
        for zones, misfit in (("AB", 0.6), ("AB", 1.5), ("B", 0.4), ("B", 1.5))
    ]
    assert sigmas[0] == sigmas[1] == 0.02
    assert 0.02 < 3 * sigmas[2] < sigmas[3]
    assert [
        misfit_error(estimate((6.0, 0.02), zones, misfit)) > 0.0
        for zones, misfit in (("AB", 0.6), ("AB", 1.5), ("B", 1.5))
    ] == [False, True, False]


def test_a_slide_that_jumps_shows_where_it_ended():
    """20 % up at once: not nothing, nor what a small change would mean."""
    for shown in (None, (9.0, 0.05)):
        assert measured_level(estimate(shown, level=1.2)) == pytest.approx((7.2, 0.06))
    assert measured_level(estimate((6.2, 0.05), level=1.02)) == (6.2, 0.05)
    assert measured_level(estimate(None, level=1.2, accepted=False)) is None
    assert measured_level(estimate(None, "B", level=1.2)) is None


def test_how_fast_the_other_figures_drift_is_learnt_per_axis_and_figure(history):
    """Viscous friction of x walks by 3 % a root day; that of y, and stiffness, stand still."""
    generator = np.random.default_rng(3)
    places, days = GRID[:6], 12
    walk = {
        axis: rate * generator.standard_normal((days, 6)).cumsum(axis=0)
        for axis, rate in (("x", 0.03), ("y", 0.0))
    }
    for day in range(days):
        at = BEGIN + day * 86400.0
        number = history.start_run(
            RunEntry(STAGE, ("x", "y"), at, "cal", None, None, "s", "f", "calibration")
        )
        history.add(
            [
                EstimateRecord(
                    number, axis, "other", i + 1, place, at + i, 1e-3, True, None,
                    {"coulomb": 6.0, "viscous": 20.0 * math.exp(walk[axis][day, i]),
                     "stiffness": 7e5},
                    (0.01, 0, 0, 0, 0.01, 0, 0, 0, 49e6), 1.0, (6.0, 0.02),
                )
                for i, place in enumerate(places)
                for axis in "xy"
            ]
        )  # fmt: skip
    drift = figure_drift(history, STAGE, ("x", "y"))
    assert set(drift["x"]) == {"viscous", "stiffness"}  # the Coulomb force is the tracking's
    gap = 1.0 / 86400.0  # a day's walk, in the second from one move to the next
    assert drift["x"]["viscous"] > 0.02 * gap**0.5
    assert drift["x"]["viscous"] > 3 * max(drift["y"]["viscous"], drift["x"]["stiffness"])
    assert figure_drift(history, STAGE, ("z",)) == {}


def test_in_production_a_site_is_known_on_arrival_and_its_step_is_found(history):
    calibrate(history)
    number, _ = keep(history, BEGIN)
    history.activate(STAGE, number, BEGIN, "activated")
    machine = load_machine()
    unseen = (0.011, 0.009)
    active = load_active(history, STAGE, machine, [unseen], BEGIN + 120)
    assert active.version.number == number
    assert active.figures["x"]["viscous"] == (20.0, pytest.approx(0.1**0.5))
    places, steps = active.places, []
    places.on_step = steps.append
    assert isinstance(places, TrackedPlaces)
    there = places.expected_at(unseen, 1.0)
    for axis, expected in zip("xy", there, strict=True):
        truth = level(axis, unseen)
        assert abs(expected.coulomb - truth) < 3 * expected.sigma + 0.02 * truth
    assert places.expected_at((unseen[0] + 1e-4, unseen[1]), 2.0) is None  # a micro-move stays
    path = np.linspace((-0.03, -0.02), unseen, 30)
    variation = places.coulomb_variation(0, path)
    truth = np.array([level("x", p) for p in path]) / level("x", unseen) - 1
    assert np.abs(variation - truth).max() < 0.03
    assert variation[-1] == pytest.approx(0.0, abs=1e-9)
    for k in range(3):  # settle the common level first
        for place in GRID[:5]:
            places.expected_at(place, 10.0 + k)
            places.learn(0, "macro", estimate((level("x", place), 0.02)), 10.0 + k)
    assert steps == []
    places.expected_at(GRID[12], 20.0)
    answer = places.learn(0, "macro", estimate((1.2 * level("x", GRID[12]), 0.02)), 20.5)
    assert [(s.axis, s.place, s.everywhere) for s in steps] == [("x", GRID[12], False)]
    assert answer.coulomb == pytest.approx(1.2 * level("x", GRID[12]), rel=0.04)


def test_production_and_doubt_make_sites_due(history):
    """What production has found off the map, and what the map does not know well any more."""
    calibrate(history)
    number, _ = keep(history, BEGIN)
    history.activate(STAGE, number, BEGIN, "activated")
    machine, sites = load_machine(), GRID[:6]
    run = history.start_run(RunEntry(STAGE, ("x", "y"), BEGIN + 200, "r", None, None, "s", "f"))
    history.add(
        [
            EstimateRecord(
                run, "x", "macro", i + 1, place, BEGIN + 200 + 10 * k + i, 1e-3, True, None,
                {"coulomb": 6.0}, (0.01,), 1.0,
                (level("x", place) * (1.06 if i == 4 else 1.0), 0.02),
            )
            for k in range(8) for i, place in enumerate(sites)
        ]
    )  # fmt: skip

    def due(now, **limits):
        places = load_active(history, STAGE, machine, sites, now).places
        asked = DueSection.model_validate({"days": 1000, **limits})
        found = due_sites(sites, asked, history, STAGE, ("x", "y"), now, places)
        return {d.place: " ".join(d.reasons) for d in found}

    found = due(BEGIN + 300)
    assert set(found) == {sites[4]}
    assert re.fullmatch(r"x: \+[56]\.\d% off the map", found[sites[4]])
    assert due(BEGIN + 300, change=0.2) == {}
    assert due(BEGIN + 86400 * 30, change=0.2).keys() == set(sites)  # nobody has looked since
    assert all("known to" in reason for reason in due(BEGIN + 300, uncertainty=1e-3).values())


def test_what_a_run_begins_with_does_not_grow_with_the_history(history):
    """Weeks of production say the same as their last visits, and take no longer."""
    calibrate(history)
    number, _ = keep(history, BEGIN)
    history.activate(STAGE, number, BEGIN, "activated")
    machine, place = load_machine(), GRID[7]
    generator = np.random.default_rng(4)
    run = history.start_run(RunEntry(STAGE, ("x", "y"), BEGIN + 500, "r", None, None, "s", "f"))
    rows = [
        EstimateRecord(
            run, "x", "macro", 1, place, BEGIN + 500 + 30 * k, 1e-3, True, None, {"coulomb": 6.0},
            (0.01,), 1.0, (1.03 * level("x", place) * (1 + 0.01 * generator.normal()), 0.02),
        )
        for k in range(5 * REPLAYED)
    ]  # fmt: skip
    history.add(rows[: 2 * REPLAYED])
    few = load_active(history, STAGE, machine, [place], rows[2 * REPLAYED - 1].time + 1.0).places
    history.add(rows[2 * REPLAYED :])
    many = load_active(history, STAGE, machine, [place], rows[-1].time + 1.0).places
    for places in (few, many):
        tracker, site = places.trackers["x"], places.number_of(place)
        assert tracker.moves[site] == REPLAYED
        mean, sigma = tracker.expected(site, wander=False)
        assert abs(mean - math.log(1.03 * level("x", place))) < 3.0 * sigma < 0.03


def test_a_map_is_told_its_age_and_its_end(history):
    calibrate(history)
    _, built = keep(history, BEGIN)
    day = 86400.0
    assert outdated(built, built.date + 29 * day, 365.0) == []
    for days, limit, grave in ((31, 365.0, False), (366, 365.0, True), (2, 1.0, True)):
        (found,) = outdated(built, built.date + days * day, limit)
        assert found.grave is grave
        assert f"{days} days old" in found.text
    assert "clock" in outdated(built, built.date - 2 * day, 365.0)[0].text
    version = MapVersion(3, BEGIN, "", True, built)
    assert sites_outside(version, [*GRID, (0.045, 0.0)]) == sites_outside(version, []) == []
    (said,) = sites_outside(version, [*GRID, (0.06, 0.0), (0.07, 0.0)])
    assert "map 3 ends short of 2 of 27 sites, the first at (60, 0) mm" in said


def test_tables_and_page(history, tmp_path):
    calibrate(history)
    number, built = keep(history, BEGIN)
    version = MapVersion(number, BEGIN, "a <comment>", True, built)
    sites = sites_table(version)
    assert len(sites.rows) == 50
    grid = grid_table(version, 0.01)
    inside = grid.columns.index("inside")
    assert {row[inside] for row in grid.rows} == {True, False}
    estimates = trend_table(history, STAGE)
    assert len(estimates.rows) == 208
    assert {row[estimates.columns.index("purpose")] for row in estimates.rows} == {"calibration"}
    assert refused_table(history, STAGE).rows == []
    number = history.start_run(
        RunEntry(STAGE, ("x", "y"), BEGIN + 900, "r", "L7", "W3", "stagectl", "f")
    )
    history.add(
        [
            EstimateRecord(number, "y", "macro", 3, GRID[0], BEGIN + 901, 0.02, False,
                           "coulomb jumps by -16%", {"coulomb": 6.0}, (0.01,))
        ]
    )  # fmt: skip
    refused = refused_table(history, STAGE)
    (row,) = (dict(zip(refused.columns, row, strict=True)) for row in refused.rows)
    assert (row["axis"], row["lot"], row["wafer"]) == ("y", "L7", "W3")
    assert row["reason"] == "coulomb jumps by -16%"
    path = tmp_path / "sites.csv"
    write_table(sites, path)
    with path.open() as file:
        rows = list(csv.DictReader(file))
    assert float(rows[0]["coulomb_N"]) == built.axes["x"].sites[0].coulomb
    parquet = pytest.importorskip("pyarrow.parquet")
    write_table(estimates, tmp_path / "e.parquet")
    assert parquet.read_table(tmp_path / "e.parquet").num_rows == 208
    with pytest.raises(UnusableInput, match=r"\.csv or \.parquet"):
        write_table(sites, tmp_path / "sites.xlsx")
    page = render(history, STAGE, version, version)
    assert page.count("<svg") == 2 * 2 + 50
    assert "a &lt;comment&gt;" in page
    assert "http" not in page.replace("http://www.w3.org", "")
