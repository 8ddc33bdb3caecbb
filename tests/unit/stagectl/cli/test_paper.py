"""`stagectl paper`: its files, its JSON, and options that cannot be used."""

import json

import click
import pytest
from click.testing import CliRunner

from stagectl.cli.paper import command
from stagectl.errors import UnusableInput
from stagectl.paper.page import MOVE_PLOT
from stagectl.paper.published import PARAMETERS


def test_command_writes_page_plots_and_json(tmp_path):
    page, figures = tmp_path / "p.md", tmp_path / "p.json"
    arguments = ["--quick", "--json", str(figures), "--out", str(page)]
    result = CliRunner().invoke(command, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    assert "Tables I and II" in result.output
    assert page.read_text(encoding="utf-8").startswith("# ")
    assert (tmp_path / MOVE_PLOT).exists()
    found = json.loads(figures.read_text(encoding="utf-8"))
    assert set(found) == {"tables", "fixed_force", "claims"}
    assert [set(claim) for claim in found["claims"]] == [{"claim", "verdict", "figure"}] * 6
    assert [set(one) for one in found["fixed_force"]] == [{"initial", "bounds", "tables"}] * 4
    two = found["tables"]["two_windows"]["aligned"]
    assert set(two) == {*PARAMETERS, "mse", "iterations", "evaluations"}
    assert two["stiffness"]["sigma"] > 0
    assert two["stiffness"]["value"] == pytest.approx(1000.0, rel=3e-3)


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
