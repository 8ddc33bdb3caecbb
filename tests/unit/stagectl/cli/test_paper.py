"""`stagectl paper`: its files, its JSON, and options that cannot be used."""

import json

import click
import pytest
from click.testing import CliRunner

from stagectl.cli.paper import command
from stagectl.errors import UnusableInput
from stagectl.paper import page


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
    assert len(found["fixed_force"]) == 4
    assert set(found["fixed_force"][0]) == {"initial", "bounds", "tables"}
    two = found["tables"]["two_windows"]["aligned"]
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
