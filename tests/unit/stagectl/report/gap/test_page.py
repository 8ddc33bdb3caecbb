"""The page of a gap diagnosis: one file, everything on it, nothing from outside."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from sim2real.attribution import signature_similarity
from sim2real.diagnosis import examine
from sim2real.diagnosis.examination import report_without_causes
from sim2real.findings import (
    Candidate,
    Cause,
    ChannelFinding,
    Confusable,
    FigureChange,
    ForceCurve,
    GapReport,
    NextExperiment,
    Parameter,
    SelectionStep,
    Unlisted,
)
from sim2real.phases import split_moves
from sim2real.residuals import view_residuals
from stagectl.report.gap.outline import headline
from stagectl.report.gap.page import move_data, render_gap_page
from stagectl.store import RecordingBlocks
from stagedata import aligned_demand
from tests.unit.stagectl.report.gap.conftest import NULL
from tests.unit.stagectl.report.page import Page

ONLY_WITH_CAUSES = ("Step by step", "Plant figures")


@pytest.fixture(scope="module")
def examined(settings):
    first = next(iter(RecordingBlocks(NULL, 2500)))
    return examine([replace(first, moves=())], settings)


@pytest.fixture(scope="module")
def explained(examined):
    """A report with everything in it that a report may have."""
    gap = {
        axis: {signal: replace(f, explained=f.nominal / 2) for signal, f in of.items()}
        for axis, of in examined.gap.items()
    }
    return replace(
        report_without_causes(examined),
        verdict="explained",
        reason="nothing <else> is left",
        where=examined.located.cells,
        gap=gap,
        gap_closed=0.93,
        gap_closed_interval=(0.9, 0.95),
        channels=(ChannelFinding("x", "force_actual", "delay", 1e-3, "s", True, "x: late"),),
        causes=(
            Cause(
                "y", "force_ripple", 0.98, {"ratio": Parameter(0.05, 0.002, "1")}, 0.9, (0.8, 1.0),
                "Correct the commutation.",
            ),
        ),
        candidates=(
            Candidate("y", "force_ripple", 0.98, 0.9), Candidate("x", "cogging", 0.01, None),
        ),
        confusable=(
            Confusable("y", ("force_ripple", "cogging"), "both waves"),
        ),
        next_experiment=NextExperiment("move slowly", ({"to": [0.0, 0.1]},), {}, {}),
        figures=(
            FigureChange("x", "stiffness", 6e5, 6.01e5, 430.0, "N/m", True, "known to 0.07 %"),
            FigureChange("y", "mass", 14.0, 13.79, 0.21, "kg", False, "at its <bound>"),
        ),
        steps=(SelectionStep("x", ("dead_time",), ("dead_time",), 0.71, 0.02),),
        clock="times count from the start of a.h5",
    )  # fmt: skip


def test_the_page_is_complete_and_loads_nothing(examined, explained):
    model = [m.floor.nominal for m in examined.measured]
    curve = ForceCurve((-0.1, 0.0, 0.1), (-1.0, 0.0, 1.0), (0.1, 0.0, 0.1))
    unlisted = Unlisted("y", "velocity", ("acceleration",), 0.91, 0.97, (0.95, 0.98), curve)
    explained = replace(explained, unlisted=(unlisted,))
    page = render_gap_page(
        explained, examined, "wafer <xy>", explained=model,
        similarity={"y": {("force_ripple", "cogging"): 0.8}},
    )  # fmt: skip
    assert Page(page).stack == []
    assert "Force ripple on y accounts for 93 % of the gap." in page
    for text in (
        "Nothing &lt;else&gt; is left.", "wafer &lt;xy&gt;", "Correct the commutation.", "x: late",
        "90–95 %", "both waves", "move slowly", "to: [0.0, 0.1]", "± 0.0020",  # noqa: RUF001
        "0.80", "71 %", "y: a force over velocity that no effect of the library has; closes 97 %",
        "from one over acceleration", "Axis y: force over velocity",
        "times count from the start of a.h5", *ONLY_WITH_CAUSES,
    ):  # fmt: skip
        assert text in page
    order = ("accounts for", "Gap of wafer &lt;xy&gt; (rms)", "Where the gap is")
    assert sorted(order, key=page.index) == list(order), "the verdict comes first"
    assert not re.search(r"(src|href|@import|url\()\s*=?\s*[\"']?(https?:)?//", page)
    assert page.count('class="chart curves"') == 4 * 4 + 1
    assert page.count('{"name":"after"') >= 4 * 4
    assert not re.search(r"\bnan\b", page, re.IGNORECASE)


def test_a_coordinate_seen_in_innovations_says_what_it_closes(examined, explained):
    curve = ForceCurve((0.0, 1.0), (-1.0, 1.0), (0.1, 0.1))
    unlisted = Unlisted(
        "y", "force", (), 0.8, 0.8, (0.7, 0.9), curve, "history", seen_in="innovations"
    )
    page = render_gap_page(
        replace(explained, verdict="unexplained", causes=(), unlisted=(unlisted,)), examined, "m"
    )
    for text in (
        "on y a force over motor force closes 80 % of the one-step prediction errors",
        "y: a force over motor force, with hysteresis, that no effect of the library has; "
        "closes 80 % (70 % to 90 %) of the one-step prediction errors, p = 0.80",
        "Axis y: force over force since it turned",
    ):
        assert text in page.replace("\u00a0", " ")


def test_a_force_that_repeats_itself_says_every_how_much(examined, explained):
    curve = ForceCurve((0.0, 0.1), (-1.0, 1.0), (0.1, 0.1))
    unlisted = Unlisted("y", "position", (), 0.8, 0.8, (0.7, 0.9), curve, period=0.0279)
    page = render_gap_page(
        replace(explained, verdict="unexplained", causes=(), unlisted=(unlisted,)), examined, "m"
    ).replace("\u00a0", " ")
    assert "y: a force over position, repeating every 27.9 mm, that no effect of the" in page


def test_changed_and_kept_figures_are_told(examined, explained):
    page = render_gap_page(explained, examined, "m")
    table = re.search(r"<h2>Plant figures</h2>(.*?)</section>", page, re.S)[1]
    changed, kept = re.findall(r"<li.*?</li>", table)
    for text in ("600000 → 601000 ± 430 N/m", "known to 0.07 %"):
        assert text in changed
    for text in ("warning", "stays 14.00 kg, fitted 13.79", "at its &lt;bound&gt;"):
        assert text in kept


def test_what_the_models_leave_is_drawn_and_explained(examined, explained):
    model = [m.floor.nominal for m in examined.measured]
    views = view_residuals(examined.measured, model, examined.settings)
    page = render_gap_page(explained, examined, "m", explained=model, views=views)
    assert Page(page).stack == []
    for heading in ("over velocity", "over position and velocity", "around reversals", "response"):
        assert re.search(f"<h2>[^<]*{heading}[^<]*</h2>", page)
    assert not re.search(r"\bnan\b", page)
    data = json.loads(re.search(r'id="data">(.*?)</script>', page, re.S)[1])
    assert data["kinds"] == ["before", "after"]


def test_without_causes_there_are_no_curves_after(examined):
    report = replace(report_without_causes(examined), verdict="no_gap")
    page = render_gap_page(report, examined, "m")
    assert Page(page).stack == []
    assert '{"name":"after"' not in page
    assert "describes this stage" in page
    assert [text for text in ONLY_WITH_CAUSES if text in page] == []


def test_an_insufficient_recording_has_a_page_too(examined):
    none = replace(examined, insufficient="no motion", measured=(), gap=None, located=None)
    report = report_without_causes(none)
    page = render_gap_page(report, none, "m")
    assert Page(page).stack == []
    assert "No motion." in page
    assert "<svg" not in page


def test_several_causes_are_a_sentence():
    causes = tuple(Cause("x", name, 0.9, {}, None, None) for name in ("cogging", "dead_time"))
    report = GapReport((), "explained", "", causes=causes, gap_closed=0.9)
    assert headline(report) == ("Cogging and dead time on x together account for 90 % of the gap.")
    elsewhere = replace(report, causes=(causes[0], replace(causes[1], axis="y")))
    assert "Cogging on x and dead time on y" in headline(elsewhere)


def test_a_check_is_part_of_the_headline():
    found = GapReport(
        (), "partly_explained", "", causes=(Cause("x", "cogging", 0.9, {}, None, None),),
        gap_closed=1.0, gap_closed_elsewhere=0.63,
    )  # fmt: skip
    assert headline(found) == (
        "Cogging on x accounts for 100 % of the gap, on the recordings of --check for 63 %; "
        "the rest is unexplained."
    )


def test_the_gap_is_one_figure_in_reason_and_page(examined):
    report = report_without_causes(examined)
    (floors,) = re.findall(r"gap is (\S+) times the floor", report.reason)
    page = render_gap_page(report, examined, "m")
    assert f"{floors} \u00d7 floor" in page
    assert "A perfect model leaves" in page, "what a figure near 1 says"


def test_every_verdict_has_a_headline():
    for verdict in ("no_gap", "explained", "partly_explained", "unexplained", "insufficient"):
        assert headline(GapReport((), verdict, "")).endswith(".")


def test_similarity_of_signatures_is_drawn(examined, explained):
    of = {"cogging": np.array([1.0, 0.0]), "stribeck": np.array([3.0, 4.0]), "none": np.zeros(2)}
    alike = signature_similarity(of, ["cogging", "stribeck", "none", "unknown"])
    assert alike == {("cogging", "stribeck"): pytest.approx(0.6)}
    sure = replace(explained, confusable=())
    page = render_gap_page(sure, examined, "m", similarity={"x": alike})
    assert Page(page).stack == []
    assert "0.60" in page
    assert "All effects that fit can be distinguished" in page


RATIO = 0.1


def unpacked(series, kind):
    return np.cumsum(series[kind]) * series["step"]


def test_every_move_is_there_and_unpacks_to_its_signals(measured, settings):
    data = move_data([measured], [measured.floor.nominal], settings, "y", max_values=10**9)
    blocks = split_moves(measured.replay.recording, measured.replay.period)
    assert len(data["moves"]) == len(blocks)
    assert (data["every"], data["axis"], data["kinds"]) == (1, "y", ["before", "after"])
    json.dumps(data, allow_nan=False)
    signals = measured.replay.recording.axes["x"]
    for move, block in zip(data["moves"], blocks, strict=True):
        first = round(block.moving + move["start"] / move["step"])
        shown = slice(first, block.stop)
        force = move["axes"]["x"]["force"]
        assert unpacked(force, "measured") == pytest.approx(
            signals.force_actual[shown], abs=force["step"]
        )
        error = move["axes"]["x"]["error"]
        expected = 1e6 * (aligned_demand(signals, RATIO) - signals.position_actual)[shown]
        assert unpacked(error, "measured") == pytest.approx(expected, abs=error["step"])
        assert error["step"] < 1e-3 * max(np.abs(expected).max(), 1e-9)


def test_the_move_with_the_largest_force_residual_comes_first(measured, settings):
    blocks = split_moves(measured.replay.recording, measured.replay.period)
    energies = [
        np.sum(measured.residual["x"]["force"][block.moving : block.end] ** 2) for block in blocks
    ]
    assert move_data([measured], None, settings, "x")["first"] == int(np.argmax(energies))


def test_long_recordings_are_shown_with_fewer_samples(measured, settings):
    whole = len(json.dumps(move_data([measured], None, settings, "x", max_values=10**9)))
    data = move_data([measured], None, settings, "x", max_values=10_000)
    assert data["every"] > 1
    assert len(json.dumps(data)) < whole / data["every"] * 2
    assert len(data["moves"]) == len(split_moves(measured.replay.recording, 1e-3))


def test_where_only_forces_are_compared_there_is_no_following_error(measured, settings):
    forces = {**measured.gap, "x": {"force": measured.gap["x"]["force"]}}
    for move in move_data([replace(measured, gap=forces)], None, settings, "x")["moves"]:
        assert set(move["axes"]["x"]) == {"force"}
        assert set(move["axes"]["y"]) == {"force", "error"}
