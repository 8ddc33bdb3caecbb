"""`stagectl check NODE --learn`: the profile that it writes is read again, and used."""

import pytest
from click.testing import CliRunner

from stagectl.cli import cli
from stagectl.config.profiles import parse_profile

FACTS = ", source: test, tested: test}\n"


def learn(tmp_path, stage_machine, *options, profile=""):
    """The profile learned of node 1, whose virtual drive plays another one."""
    text = stage_machine.text
    if profile:
        (tmp_path / "own.yaml").write_text(f"family: own\ndrives: own\n{profile}{FACTS}")
        text = text.replace("rated_force: 40.0", "profile: own.yaml\n      rated_force: 40.0")
    (tmp_path / "m.yaml").write_text(text)
    arguments = ["--machine", str(tmp_path / "m.yaml"), "--simulate", *options]
    done = CliRunner().invoke(cli, ["check", "1", "--learn", *arguments])
    written = list((tmp_path / "drives").glob("*.yaml"))
    return done, parse_profile(written[0].read_text(), "learned") if written else None


def test_a_profile_is_written_beside_the_machine_file(tmp_path, stage_machine):
    done, found = learn(tmp_path, stage_machine)
    assert done.exit_code == 0, done.output
    assert (tmp_path / "drives" / f"{found.family}.yaml").exists()
    assert found.identity.vendor.value == 0x535447
    assert found.modes.value == ("pp", "pv", "hm", "csp", "csv", "cst")
    assert found.modes.source.startswith("taken by 0x6060")
    assert found.modes.tested.startswith("on a virtual drive, 20")
    assert found.interpolates is None  # nothing has moved


@pytest.mark.parametrize(
    ("profile", "interpolates", "factor"),
    [
        ("interpolates: {value: false", False, None),
        ("force_factors: {value: [1.4142]", True, 1.414),
    ],
)
def test_moves_show_scale_sign_and_interpolation(
    profile, interpolates, factor, tmp_path, stage_machine
):
    done, found = learn(tmp_path, stage_machine, "--move", profile=profile)
    assert done.exit_code == 0, done.output
    assert found.offset_sign.value == 1
    assert found.interpolates.value is interpolates
    assert found.demand_delay.value == pytest.approx(0.0 if interpolates else -0.45, abs=0.1)
    if factor:
        assert found.force_factors.value == (pytest.approx(factor, rel=0.02),)


@pytest.mark.parametrize(
    ("options", "reason"),
    [(["check", "1", "--out", "p.yaml"], "--out needs --learn"),
     (["check", "9", "--learn", "--move", "--simulate"], "no axis with node id 9")],
)  # fmt: skip
def test_what_makes_no_sense_is_refused(options, reason):
    done = CliRunner().invoke(cli, options)
    assert done.exit_code == 2
    assert reason in done.output
