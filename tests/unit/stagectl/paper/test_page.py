"""docs/paper.md and the command that writes it."""

import json
import re
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from stagectl.cli.paper import command
from stagectl.errors import UnusableInput
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
    for row in page.table_rows(quick)[:4]:
        line = next(line for line in committed.splitlines() if line.startswith(f"| {row[0]} |"))
        # Every second number is a deviation, of which one digit is printed.
        shown, now = numbers("".join(line.split("|")[6:])), numbers(" ".join(row[5:]))
        assert shown[::2] == pytest.approx(now[::2], rel=2e-4)
    for row in page.fixed_rows(quick):
        line = next(line for line in committed.splitlines() if f"| {' | '.join(row[:4])} |" in line)
        shown, now = numbers("".join(line.split("|")[5:8])), numbers(" ".join(row[4:7]))
        assert shown[::2] == pytest.approx(now[::2], rel=2e-3)
    for claim in quick.claims:
        assert claim.verdict[1:] in committed
    assert "varied" in committed
    for plot in (page.MOVE_PLOT, page.ZONES_PLOT):
        assert (COMMITTED.parent / plot).stat().st_size > 5000


def test_command_writes_page_plots_and_json(tmp_path):
    result = CliRunner().invoke(
        command,
        ["--quick", "--json", str(tmp_path / "p.json"), "--out", str(tmp_path / "p.md")],
        catch_exceptions=False,
    )
    assert result.exit_code == 0
    assert "Tables I and II" in result.output
    assert (tmp_path / "p.md").read_text(encoding="utf-8").startswith("# ")
    assert (tmp_path / page.MOVE_PLOT).exists()
    found = json.loads((tmp_path / "p.json").read_text(encoding="utf-8"))
    assert set(found) == {"tables", "fixed_force", "claims"}
    assert len(found["claims"]) == 6
    for claim in found["claims"]:
        assert set(claim) == {"claim", "verdict", "figure"}
    two = found["tables"]["two_windows"]["aligned"]
    assert two["stiffness"]["value"] == pytest.approx(1000.0, rel=3e-3)


def test_json_on_stdout_is_nothing_but_json():
    result = CliRunner().invoke(command, ["--quick", "--json", "-"], catch_exceptions=False)
    assert set(json.loads(result.stdout)) == {"tables", "fixed_force", "claims"}


def test_what_is_left_open_is_an_option():
    slow = CliRunner().invoke(
        command,
        ["--quick", "--json", "-", "--rate", "4000", "--profile", "jerk-limited",
         "--bandwidth", "60", "--cut-off", "0", "--feedforward", "--initial", "free"],
        catch_exceptions=False,
    )  # fmt: skip
    two = json.loads(slow.stdout)["tables"]["two_windows"]
    assert two["aligned"]["coulomb"]["value"] == pytest.approx(2.0, rel=1e-3)
    assert two["logged"]["viscous"]["value"] < 0.93


@pytest.mark.parametrize(
    ("args", "said"),
    [(["--rate", "7"], "rate: must be"), (["--rate", "1000", "--bandwidth", "300"], "unstable"),
     (["--cut-off", "-3"], "cut_off"), (["--out", "no/such/folder/p.md"], "no folder")],
)  # fmt: skip
def test_unusable_options_are_one_line(args, said):
    with pytest.raises((UnusableInput, click.BadParameter), match=said) as problem:
        command.main(["--quick", *args], standalone_mode=False)
    assert "\n" not in str(problem.value)
