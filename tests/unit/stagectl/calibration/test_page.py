"""What a calibration says, and its page."""

import re
from dataclasses import replace

import numpy as np
import pytest

from estimation.field import FrictionField
from stagectl.calibration.outcome import SiteOutcome
from stagectl.calibration.page import (
    CalibrationReport,
    calibration_outline,
    render_calibration,
    verdict,
    write_calibration_page,
)
from stagectl.calibration.sequence import Gain, SiteSequence
from stagectl.maps import AxisChange, FrictionMap, MapSite, MapVersion, SiteChange
from stagectl.maps.model import MapAxis
from stagectl.report import print_sections
from tests.unit.stagectl.calibration.conftest import SITES
from tests.unit.stagectl.printed import printed


def version(number, level):
    values = level * np.array([1.0, 1.1, 1.0, 0.95])
    field = FrictionField(np.array(SITES), values, np.full(4, 0.01))
    of = zip(SITES, values.tolist(), strict=True)
    sites = tuple(MapSite(place, value, 0.01, 1.7e9, 4) for place, value in of)
    built = FrictionMap(None, 1.7e9, {"x": MapAxis(sites, field.nodes, {})})
    return MapVersion(number, 1.7e9, "", False, built)


def outcome(site, severity, change=None, suggestion=""):
    known = ("x", 6.1, 0.012, change, {"coulomb": Gain(0.3, 0.01)}, ())
    return SiteOutcome(site, SITES[site - 1], *known, severity, suggestion)


@pytest.fixture
def report():
    outcomes = [
        outcome(1, "good", 0.001), outcome(2, "act", 0.213, "look for dirt <there>"),
        outcome(3, "watch", -0.05), outcome(4, "good", 0.0),
    ]  # fmt: skip
    changes = [AxisChange("x", 0.04, 0.1, (SiteChange(SITES[1], 0.213, 0.01),))]
    return CalibrationReport(
        "weekly", "wafer-xy (simulated)", "2026-11-22", None, "map 3 (after service)", 5, 5,
        outcomes, changes, SiteSequence((), 1.2, {"x": {"coulomb": Gain(0.3, 0.008)}}),
        version(4, 6.4), version(3, 6.0),
    )  # fmt: skip


def text_of(html):
    body = re.sub(r"<(style|svg|script).*?</\1>", "", html, flags=re.DOTALL)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", body))


def test_it_has_every_site_its_change_and_its_verdict(report):
    text = text_of(render_calibration(report))
    assert "(20.0, 0.0) x 6.100 1.2 % +21.3 % 4.9 (5.2) act" in text
    assert "site 2, axis x: look for dirt &lt;there&gt;" in text
    assert "axis x: all sites +4.0 % since the last map" in text
    assert "Friction map used map 3 (after service)" in text
    assert "Compared with map 3" in text
    assert "Settling" not in text, "that is of production"


def test_one_site_says_nothing_of_all(report):
    alone = replace(report, outcomes=report.outcomes[1:2])
    text = text_of(render_calibration(alone))
    assert "all sites +4.0 %" not in text
    assert "axis x: 1 site measured; whether all sites have changed shows when at least 3" in text


def test_the_headline_counts_verdicts_the_worst_first(report):
    assert verdict(report) == (
        "5 of 5 visits; results by site and axis: 1 to act on, 1 to watch, 2 in order. "
        "New map 4, compared with map 3."
    )


def test_new_map_and_the_one_before_are_drawn_side_by_side(report):
    html = render_calibration(report)
    assert re.findall(r"<svg[^>]*><title>([^<]+)<", html) == [
        "Coulomb force, axis x, map 4",
        "Coulomb force, axis x, map 3",
        "known to (1 sigma), axis x",
    ]


def test_an_interrupted_first_calibration_says_so(report, tmp_path):
    cut = replace(
        report, error="axis x: following error", version=None, before=None, changes=[],
        visited=2, outcomes=report.outcomes[:2], used="none",
    )  # fmt: skip
    write_calibration_page(tmp_path / "report.html", cut)
    text = text_of((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert "Interrupted Dark 2 of 5 visits;" in text
    assert "No new map." in text
    assert "axis x: following error" in text
    assert "nothing: there was no map" in text


@pytest.mark.parametrize("severity", ["good", "watch", "act", "failed"])
def test_the_table_fits_80_columns(report, severity):
    figures = {"coulomb": 12.021, "sigma": 0.105, "change": -0.123}
    wide = replace(outcome(3, severity), site=121, place=(-0.15, -0.15), **figures)
    sections = calibration_outline(replace(report, outcomes=[wide])).sections
    text = printed(print_sections([sections["sites"]]), 80)
    assert "…" not in text
    (row,) = [line for line in text.splitlines() if line.split()[:1] == ["121"]]
    assert row.split()[-1] == severity
