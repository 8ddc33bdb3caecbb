"""The queue is on disk, and comes back."""

import json

import pytest

from stagectl.errors import UnusableInput
from stagectl.protocol.requests import QueueAdd
from stagectl.server.run_queue import FILE_NAME, RunQueue


def add(queue, name):
    return queue.add(QueueAdd(recipe="recipe: x", source=f"{name}.yaml"), name, None, None).id


def test_entries_survive_in_their_order_with_what_it_takes_to_run_them(tmp_path):
    queue = RunQueue(tmp_path)
    first, second, third = (add(queue, name) for name in "abc")
    queue.update(first, status="running", folder="/runs/a")
    queue.reorder(third, 0)
    again = RunQueue(tmp_path)
    assert [e.id for e in again.entries] == [first, third, second]
    assert again.entries[0].status == "running"
    assert again.next().request.source == "c.yaml"
    assert not again.runs  # nothing starts by itself
    assert add(again, "d") == third + 1


def test_only_the_newest_ended_entries_are_kept(tmp_path):
    queue = RunQueue(tmp_path)
    numbers = [add(queue, "a") for _ in range(105)]
    for number in numbers[:-1]:
        queue.update(number, status="done", outcome="completed")
    assert [e.id for e in queue.entries] == numbers[-101:]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{", "is damaged"),
        ('{"version": 9, "number": 0, "entries": []}', "version 9"),
        ('{"version": 1, "number": 0, "entries": [{"entry": {}}]}', "Field required"),
    ],
)
def test_a_damaged_queue_is_refused_in_one_line(tmp_path, text, reason):
    (tmp_path / FILE_NAME).write_text(text)
    with pytest.raises(UnusableInput) as refused:
        RunQueue(tmp_path)
    assert str(refused.value).startswith(str(tmp_path / FILE_NAME))
    assert reason in str(refused.value)
    assert "\n" not in str(refused.value)


def test_the_file_is_json_that_a_person_can_read(tmp_path):
    add(RunQueue(tmp_path), "a")
    body = json.loads((tmp_path / FILE_NAME).read_text())
    assert body["entries"][0]["entry"]["recipe"] == "a"
