"""A slice of `benchmarks.robustness.fuzz`; hypothesis looks for the smallest input that breaks."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.robustness import fuzz, fuzz_input
from stagectl.config.faults import parse_faults
from stagectl.config.machine.file import parse_machine
from stagectl.errors import UnusableInput
from stagectl.recipe import parse_recipe
from stagectl.store import (
    read_ledger,
    read_log,
    read_notes,
    read_recording,
    recover_journal,
    recover_log,
)

share = st.floats(0.0, 1.0, allow_nan=False)
edits = st.lists(
    st.tuples(st.sampled_from(fuzz_input.EDITS), share, share, st.integers(0, 255)),
    min_size=1,
    max_size=6,
)


def frames(ids):
    anything = st.tuples(st.sampled_from(ids) | st.integers(0, 0x7FF), st.binary(max_size=8))
    servers = [i for i in ids if i & 0x780 in (0x580, 0x600)]
    access = st.builds(
        lambda server, command, place, value: (
            server,
            bytes((command, place[0] & 0xFF, place[0] >> 8, place[1])) + value,
        ),
        st.sampled_from(servers),
        st.sampled_from([0x2F, 0x2B, 0x23, 0x40, 0x21, 0xA0, 0xC2, 0x60, 0x80]),
        st.sampled_from([(0x6040, 0), (0x6060, 0), (0x1400, 1), (0x1600, 0), (0x1600, 1),
                         (0x1800, 2), (0x1005, 0), (0x1016, 1), (0x1017, 0), (0x6064, 0)]),
        st.binary(min_size=4, max_size=4),
    )  # fmt: skip
    return anything | access


def few(examples):
    return settings(
        max_examples=examples,
        deadline=None,
        suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
    )


@few(5)
@given(st.lists(st.tuples(st.floats(0.0, 1.0), frames(fuzz_input.AT_DRIVER)), max_size=12))
def test_arbitrary_frames_at_the_driver(sequence):
    sequence.sort(key=lambda entry: entry[0])
    fuzz.strike_driver([frame for _, frame in sequence], [moment for moment, _ in sequence])


@few(12)
@given(edits)
def test_arbitrary_eds(tmp_path, changes):
    fuzz.read_eds(fuzz_input.edited(fuzz.sound("eds"), changes), tmp_path)


@pytest.mark.parametrize("what", ["machine", "recipe", "faults"])
@few(25)
@given(edits)
def test_arbitrary_yaml(machine, what, changes):
    parse = {
        "machine": parse_machine,
        "recipe": lambda text, name: parse_recipe(text, name, machine),
        "faults": lambda text, name: parse_faults(text, name, machine, 1),
    }[what]
    fuzz.read_text(parse, fuzz_input.edited(fuzz.sound(what), changes), f"{what}.yaml")


@few(25)
@given(edits)
def test_arbitrary_recordings(tmp_path, changes):
    data = fuzz_input.edited(fuzz.sound("recording"), changes)
    fuzz.read_files(data, tmp_path, "recording.h5", read_recording, read_ledger, read_notes)


@few(25)
@given(edits)
def test_arbitrary_logs_and_journals(tmp_path, changes):
    for what, name, reader in (
        ("bus log", "bus.asc", lambda path: list(read_log(path).frames())),
        ("frames", "bus.frames", lambda path: recover_log(path.parent)),
        ("journal", "recording.journal", recover_journal),
    ):
        fuzz.read_files(fuzz_input.edited(fuzz.sound(what), changes), tmp_path, name, reader)


def test_a_log_from_no_year(tmp_path):
    """Found once: a header whose time is none."""
    data = bytearray(fuzz.sound("frames"))
    data[15] = 0x7F
    (tmp_path / "bus.frames").write_bytes(data)
    with pytest.raises(UnusableInput, match="header is damaged"):
        recover_log(tmp_path)
