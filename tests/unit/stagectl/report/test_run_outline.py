"""What a run says."""

import pytest

from stagectl.report.run_outline import (
    friction_map_used,
    headline,
    learned_feedforward,
    run_outline,
)


def rows(summary, name, recording=None):
    table = run_outline(summary, recording).sections[name].table
    assert table is not None
    return [[c if isinstance(c, str) else c.text for c in row] for row in table.rows]


def test_interrupted_moves_are_not_in_the_table(summary):
    moves = [{**move, "completed": False} for move in summary["moves"] if move["axis"] == "x"]
    moves += [move for move in summary["moves"] if move["axis"] == "y"]
    assert {row[0] for row in rows({**summary, "moves": moves}, "results")} == {"y"}


def test_without_updates_all_moves_have_the_same_model(summary):
    assert {row[2] for row in rows({**summary, "compensation": "oracle"}, "results")} == {"true"}


def test_friction_is_that_of_the_last_accepted_estimate(summary):
    first = summary["friction"][0]
    assert rows(summary, "friction") == [["x", "coulomb", "6.020", "0.010", "N", "1 of 1"]]
    later = {**first, "parameters": {"coulomb": {"value": 8.765, "sigma": 0.012, "unit": "N"}}}
    again = {**summary, "friction": [first, later, {**first, "accepted": False}]}
    assert rows(again, "friction") == [["x", "coulomb", "8.765", "0.012", "N", "2 of 3"]]


def test_refused_estimates_and_failed_sites_are_named(summary):
    refused = {**summary["friction"][0], "accepted": False, "site": 3, "reason": "too little"}
    limits = {
        "verdict": "fail", "passed": 1, "failed": 1, "of": 2,
        "sites": [
            {"site": 1, "passed": True, "failures": []},
            {"site": 2, "passed": False, "failures": ["peak error 1 um"]},
        ],
    }  # fmt: skip
    friction = [refused, {**refused, "site": None}]
    sections = run_outline({**summary, "friction": friction, "limits": limits}, None).sections
    told = [fact.text for name in ("refused", "limits") for fact in sections[name].facts]
    assert told == ["site 3 axis x: too little", "axis x: too little", "site 2: peak error 1 um"]


def test_an_interrupted_run_says_where_and_how_to_continue(summary):
    command, fault = "stagectl run r.yaml --resume runs/a", "axis y: 0x8611"
    stop = {"reason": fault, "unit": "site", "done": 2, "of": 5, "at": 3, "resume": command}
    ended = {**summary, "outcome": "fault", "fault": fault, "interrupted": stop}
    outline = run_outline(ended, None)
    assert [badge.text for badge in outline.badges] == ["Ended with a fault"]
    assert outline.headline.startswith("Ended at site 3 of 5 (")
    assert outline.command == command
    assert fault not in [fact.text for fact in outline.notices]


def test_punctuality_is_mentioned_only_where_it_lacked(summary):
    cycle = {"period": 0.001, "missed": 0, "late": 0}
    assert run_outline({**summary, "cycle": cycle}, None).notices[-1].level == "good"
    punctuality = {"late_in_a_row": 2, "doubled": 1}
    lacked = {**summary, "cycle": {**cycle, "missed": 3, "late": 2}, "punctuality": punctuality}
    said = run_outline(lacked, None).notices[-1].text
    assert said.endswith("3 TPDOs missed, 2 SYNCs late (at most 2 in a row), 1 received twice")


def test_parameters_that_no_move_was_informative_about_are_named(summary):
    def entry(axis, accepted, **gain):
        figures = {name: {"value": 1.0, "sigma": 0.1, "unit": "1"} for name in gain}
        held = [name for name, value in gain.items() if value == 1.0]
        told = {"reason": None, "held": held} if accepted else {"reason": "why", "held": []}
        of = {"site": 1, "axis": axis, "accepted": accepted, "compute_time": 1e-4}
        return {**of, "parameters": figures, "gain": gain, **told}

    nothing = {"coulomb": 1.0, "viscous": 1.0}
    friction = [entry("x", True, **{**nothing, "coulomb": 30.0}), entry("x", True, **nothing)]
    friction.append(entry("y", False, **nothing))
    section = run_outline({**summary, "friction": friction}, None).sections["friction"]
    less = "2 of 2 accepted moves say less about it than was known; fast"
    assert [fact.text for fact in section.facts] == [
        f"{what} kept its initial value: {why} moves would be informative"
        for what, why in (
            ("viscous of axis x", less),
            ("coulomb of axis y", "no estimate was accepted; sliding"),
            ("viscous of axis y", "no estimate was accepted; fast"),
        )
    ]


def test_what_happened_is_told_on_terminal_and_page_alike(summary):
    happened = {
        **summary,
        "steps": [
            {"axis": "x", "place": [0.025, 0.0], "time": 3.1, "change": 0.21, "everywhere": False},
            {"axis": "y", "place": [0.0, 0.0], "time": 4.0, "change": -0.1, "everywhere": True},
        ],
        "retries": [{"site": 3, "attempt": 1, "fault": "axis y: 0x8611"}],
        "watchdog": [{"axis": "x", "time": 0.2, "out": True, "text": "axis x: left out"}],
        "history": {"filed": 9, "estimates": 71},
    }
    told = [fact.text for fact in run_outline(happened, None, notices=["axis x: left out"]).notices]
    assert "friction of axis x stepped by +21 % at (25.0, 0.0) mm, 3.1 s" in told
    assert "friction of axis y stepped by -10 % everywhere, 4.0 s" in told
    assert "site 3 restarted (attempt 1): axis y: 0x8611" in told
    assert told.count("axis x: left out") == 1
    assert "the history has 9 of 71 estimates" in told


def test_arrival_of_tpdos_is_told_only_where_there_was_a_bus(summary):
    cycle = {"period": 0.002, "missed": 0, "late": 0}
    ledger = dict.fromkeys(("tardy", "doubled", "late_in_a_row"), 0)
    ledger["arrival"] = {"x": {"max": 0.0004}}
    summary = {**summary, "simulated": False, "punctuality": ledger, "cycle": cycle}
    (*_, cycle) = run_outline(summary, None).notices
    assert cycle.text.endswith("the latest TPDO came 0.4 ms after its SYNC")
    (*_, cycle) = run_outline({**summary, "simulated": True}, None).notices
    assert "latest" not in cycle.text


def test_the_headline_gives_the_worse_axis_where_one_is_fast():
    moves = [
        {
            "site": site, "axis": axis, "kind": "micro", "peak_error": error, "settled": True,
            "settling": {"5e-08": time, "2e-07": 0.0},
        }
        for site in (1, 2, 3)
        for axis, time, error in (("x", 0.0095, 6e-8), ("y", 0.0, 9e-8))
    ]  # fmt: skip
    summary = {
        "outcome": "completed", "moves": moves, "duration": 9.7, "wall_time": 0.6, "simulated": True
    }  # fmt: skip
    done = "0 moves in 9.7 s (simulated in 0.60 s, 16 x real time). "
    assert headline(summary, None) == done + (
        "Median settling on the worse axis: ±50 nm in 9.5\u00a0ms (x), ±200 nm in 0\u00a0ms; "
        "median peak error 0.0900\u00a0µm (y) (6 micro-moves)."
    )
    alone = {**summary, "moves": [move for move in moves if move["axis"] == "y"]}
    assert headline(alone, None) == done + (
        "Median settling: ±50 nm in 0\u00a0ms, ±200 nm in 0\u00a0ms; median peak error "
        "0.0900\u00a0µm (3 micro-moves)."
    )


@pytest.mark.parametrize(
    ("facts", "text"),
    [
        ({"map": 3, "map_comment": "after service"}, "map 3 (after service)"),
        ({"map": 3}, "map 3"),
        ({}, "none"),
        ({"map": None, "compensation": "model"}, "none (compensation model)"),
    ],
)
def test_the_friction_map_of_a_run_in_words(facts, text):
    assert friction_map_used({"compensation": "estimated", **facts}) == text


def test_learned_feedforward_names_what_differs_from_the_machine_file():
    learned = {
        "x": {"mass": 0.0931, "lead": 0.0, "coupling": -0.02},
        "y": {"mass": 0.0, "lead": 0.0, "coupling": 0.0},
    }
    assert learned_feedforward({"feedforward": learned}) == (
        "x: mass +9.3 %, coupling -2.0 %; y: as in the machine file"
    )
    assert learned_feedforward({}) == ""
