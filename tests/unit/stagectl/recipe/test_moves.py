"""Lists of moves: their profiles, their places, and what is refused of them."""

import pytest

from tests.unit.stagectl.recipe.conftest import HEAD

MOVES = HEAD + "moves:\n"


@pytest.mark.parametrize(
    ("moves", "line"),
    [
        (
            "- {to: [0, 1]}",
            "6:8: moves[1].to: 1 m is outside the travel -0.15 ... 0.15 m of axis y",
        ),
        ("- {reverse: 1 mm, axis: z}", "6:25: moves[1].axis: no such axis in the machine; known:"),
        ("- {to: [0, 0], kind: creep}", "6:3: moves[1].velocity: is missing: a creep needs a"),
        ("- {to: [0, 0], velocity: 3}", "6:26: moves[1].velocity: 3 is above the limit of axis x"),
        ("- {to: [0, 0], dwell: 3}", "6:3: moves[1]: must be a mapping with exactly one of to,"),
        ("- {rpeat: 3, moves: []}", "6:3: moves[1]: must be a mapping with exactly one of to,"),
        ("- {repeat: 2, moves: []}", "6:22: moves[1].moves: must have at least 1 item(s)"),
        ("- {repeat: 0, moves: [{dwell: 1}]}", "6:12: moves[1].repeat: must be >= 1, is 0"),
        (
            "- {dwell: 1}\n- {repeat: 2, moves: [{dwell: 1}, {to: [0, 0], kinds: macro}]}",
            "7:48: moves[2].moves[2].kinds: unknown key; did you mean 'kind'?",
        ),
        (
            "- {repeat: 2, moves: [{dwell: 1}, {reverse: 1, axis: y}]}",
            "6:45: moves[1].moves[2].reverse: 1 m is outside the travel",
        ),
        (
            "- {repeat: 90000, moves: [{repeat: 90000, moves: [{dwell: 0}]}]}",
            "6:1: moves: unrolls to 8100000000 moves and dwells, more than 100000",
        ),
        ("  to: [0, 0]", "6:3: moves: must be a list, is a mapping"),
    ],
)
def test_each_fault_of_a_move(problems_of, moves, line):
    (found,) = problems_of(MOVES + moves)
    assert found.startswith(f"r.yaml:{line}")


def test_a_refused_move_does_not_shift_the_places_of_others(problems_of):
    found = problems_of(MOVES + "- {reverse: 1 mm, axis: z}\n- {to: [0, 1]}\n")
    assert [line.split(": ")[1] for line in found] == ["moves[1].axis", "moves[2].to"]
