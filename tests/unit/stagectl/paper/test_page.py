"""docs/paper.md and the command that writes it."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from stagectl.paper import page

COMMITTED = Path(__file__).parents[4] / "docs" / "paper.md"


def numbers(text):
    return [float(n) for n in re.findall(r"-?\d+(?:\.\d+)?(?:e-?\d+)?", text)]


def test_page_holds_every_claim_and_both_plots(quick):
    text = page.render(quick)
    for claim in quick.claims:
        assert claim.claim in text
        assert claim.figure in text
    assert text.count("](images/paper-") == 2
    assert "varied" not in text  # a quick study has no sensitivity


def test_the_committed_page_is_of_this_code(quick):
    committed = COMMITTED.read_text(encoding="utf-8")
    estimates, fixed = page.tables(quick)
    for row in estimates.rows[4:]:
        line = next(line for line in committed.splitlines() if line.startswith(f"| {row[0]} |"))
        # Every second number is a deviation, of which one digit is printed.
        shown, now = numbers("".join(line.split("|")[2:6])), numbers(" ".join(row[1:5]))
        assert shown[::2] == pytest.approx(now[::2], rel=2e-4)
    for row in fixed.rows:
        line = next(line for line in committed.splitlines() if f"| {' | '.join(row[:4])} |" in line)
        shown, now = numbers("".join(line.split("|")[5:8])), numbers(" ".join(row[4:7]))
        assert shown[::2] == pytest.approx(now[::2], rel=2e-3)
    for claim in quick.claims:
        assert claim.verdict[1:] in committed
    assert "varied" in committed
    for plot in (page.MOVE_PLOT, page.ZONES_PLOT):
        assert (COMMITTED.parent / plot).stat().st_size > 5000


@pytest.mark.parametrize("plot", [page.plot_move, page.plot_zones])
def test_plots_are_xml(quick, plot):
    root = ET.fromstring(plot(quick))  # noqa: S314
    assert len(root.findall("{http://www.w3.org/2000/svg}polyline")) >= 4
