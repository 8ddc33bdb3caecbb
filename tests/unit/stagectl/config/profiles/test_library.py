"""Profiles as files: strict, each fact with its source, found by name or by the EDS' identity."""

import pytest

from hil_sim.habits import Habits
from stagectl.config import driver_settings, parse_machine, stage_settings
from stagectl.config.profiles import families, load_profile, parse_profile, profile_of
from stagectl.config.profiles.model import Fact
from stagectl.errors import ConfigError

HEAD = "family: mine\ndrives: mine\n"
IDENTITY = """identity:
  vendor: {value: "0x539", source: 0x1018, tested: here}
  product: {value: 7, source: 0x1018, tested: here}
"""
EDS = "[DeviceInfo]\nVendorNumber=0x539\nProductNumber=7\nRevisionNumber=0x00020001\n"


@pytest.mark.parametrize("family", families())
def test_packaged_profiles_state_the_source_of_each_fact(family):
    profile = load_profile(family)
    assert profile.family == family
    facts = [f for name in type(profile).model_fields
             if isinstance(f := getattr(profile, name), Fact)]  # fmt: skip
    facts += profile.remarks
    assert facts
    assert all(fact.source and fact.tested == "no" for fact in facts)  # no drive was here
    assert profile.identity is None  # of none of them is it known


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("modes: {value: [csp], source: manual}", "modes.tested: is missing"),
        ("modes: {value: [cps], source: m, tested: x}", "modes.value[1]: must be"),
        ("mode: {value: [csp], source: m, tested: x}", "mode: unknown key; did you mean 'modes'?"),
        ("offset_bits: {value: 24, source: m, tested: x}", "offset_bits.value: must be 16 or 32"),
        ('only: {value: {"60C2:2": -3}, source: m, tested: x}', 'such as "0x60C2:02", is "60C2:2"'),
        ("velocity_unit: {value: rpm, source: m, tested: x}", 'is "rpm"'),
        ("bus: {}", "bus: unknown key"),
    ],
)
def test_what_is_not_understood_is_refused_with_its_place(text, reason):
    with pytest.raises(ConfigError, match=r"^own\.yaml:3:") as refused:
        parse_profile(HEAD + text + "\n", "own.yaml")
    assert reason in str(refused.value)


@pytest.fixture
def machine(stage_machine, tmp_path):
    """The machine in a file, its axis x with an EDS and these lines in its drive section."""

    def made(*lines, eds=EDS):
        (tmp_path / "x.eds").write_text(eds)
        text = stage_machine.text.replace(
            "rated_force: 40.0", "\n      ".join((*lines, "rated_force: 40.0"))
        ).replace("node: 1", "node: 1\n    eds: x.eds")
        path = tmp_path / "m.yaml"
        path.write_text(text)
        return parse_machine(text, str(path)), tmp_path / "x.eds"

    return made


def test_a_profile_beside_the_machine_file_is_found_by_identity(machine, tmp_path):
    (tmp_path / "drives").mkdir()
    (tmp_path / "drives" / "own.yaml").write_text(HEAD + IDENTITY)
    found, eds = machine()
    assert profile_of(found, "x", eds).family == "mine"
    assert profile_of(found, "y", None) is None
    other, eds = machine(eds=EDS.replace("=7", "=8"))
    assert profile_of(other, "x", eds) is None


@pytest.mark.parametrize(("revision", "found"), [("0x20009", True), ("0x30000", False)])
def test_of_the_revision_the_major_number_counts(machine, tmp_path, revision, found):
    (tmp_path / "drives").mkdir()
    line = f'  revision: {{value: "{revision}", source: 0x1018, tested: here}}\n'
    (tmp_path / "drives" / "own.yaml").write_text(HEAD + IDENTITY + line)
    own, eds = machine()
    assert (profile_of(own, "x", eds) is not None) is found


def test_a_profile_that_is_named_has_to_be_of_the_device(machine, tmp_path):
    (tmp_path / "own.yaml").write_text(HEAD + IDENTITY)
    own, eds = machine("profile: own.yaml")
    assert profile_of(own, "x", eds).family == "mine"
    other, eds = machine("profile: own.yaml", eds=EDS.replace("=7", "=8"))
    with pytest.raises(ConfigError, match=r"m\.yaml:17:16: .*profile: mine is of another device"):
        profile_of(other, "x", eds)
    missing, eds = machine("profile: epos5")
    with pytest.raises(ConfigError, match=r"drive\.profile: no drive profile epos5; did you mean"):
        driver_settings(missing)
    nowhere, eds = machine("profile: none.yaml")
    with pytest.raises(ConfigError, match=r"none\.yaml: no such file"):
        driver_settings(nowhere)


def test_a_recording_names_a_profile_that_is_not_here(machine):
    own, _ = machine("profile: own.yaml")
    recorded = parse_machine(own.text, "elsewhere/recording.h5")
    assert stage_settings(recorded).axes[0].habits == Habits()  # of its model; there is no drive
    with pytest.raises(ConfigError, match=r"own\.yaml: no such file"):
        driver_settings(parse_machine(own.text.replace("eds: x.eds", ""), "elsewhere/m.yaml"))
