"""Versions of maps and their use, on SQLite and PostgreSQL."""

import pytest

from stagectl.history import StageKey
from tests.unit.stagectl.rows import BEGIN, STAGE

OTHER = StageKey("wafer-xy", False)


@pytest.fixture
def history(where, opened):
    return opened(where)


def test_versions_are_numbered_for_each_stage_and_kept_as_written(history):
    assert [history.save_map(STAGE, BEGIN + n, f"c{n}", f'{{"n": {n}}}') for n in (1, 2)] == [1, 2]
    assert history.save_map(OTHER, BEGIN, "", "{}") == 1
    first, second = history.maps(STAGE)
    assert (first.number, first.made, first.comment) == (1, BEGIN + 1, "c1")
    assert second.content == '{"n": 2}'
    assert not first.active
    assert [m.number for m in history.maps(OTHER)] == [1]
    assert history.maps(StageKey("another", True)) == []


def test_one_version_is_active_at_a_time_and_none_after_it_is_taken_back(history):
    for n in range(2):
        history.save_map(STAGE, BEGIN + n, "", "{}")
    for number in (1, 2, None, 2):
        history.activate(STAGE, number, BEGIN, "why")
        assert [m.number for m in history.maps(STAGE) if m.active] == ([number] if number else [])
    assert [(a.number, a.reason) for a in history.activations(STAGE)] == [
        (1, "why"), (2, "why"), (None, "why"), (2, "why"),
    ]  # fmt: skip
    assert history.activations(OTHER) == []


def test_a_version_that_there_is_not_cannot_be_activated(history):
    history.save_map(STAGE, BEGIN, "", "{}")
    history.activate(STAGE, 1, BEGIN, "first")
    with pytest.raises(ValueError, match="no map 7"):
        history.activate(STAGE, 7, BEGIN + 1, "again")
    with pytest.raises(ValueError, match="no map 1"):
        history.activate(OTHER, 1, BEGIN + 1, "of another stage")
    assert [m.number for m in history.maps(STAGE) if m.active] == [1]
    assert len(history.activations(STAGE)) == 1
