"""What force offsets reach by themselves on recipe inspection-20, over the whole path.

Margins included, and without the observer (`test_observer.py`).

The figures: oracle micro ±50 nm median 8 ms, mean 30 ms, ±200 nm 1 ms, peak 0.15 um, macro ±200 nm
2 ms; estimated from half of all friction figures, from the 4th site on, micro ±200 nm 3 ms, peak
0.3 um, ±50 nm mean 60 ms, macro ±200 nm 5 ms. `benchmarks.settling.run_figures` has them with
all seeds.
"""

import sys
import threading
from statistics import mean, median

import pytest

from tests.short_recipe import short_recipe


def select(results, kind, first_site=1):
    moves = [m for r in results for m in r.summary["moves"]]
    return [m for m in moves if m["kind"] == kind and m["site"] >= first_site]


def settling(moves, window):
    return [m["settling"][window] for m in moves]


def test_without_compensation_is_the_baseline(run):
    result = run("none", observer=False)
    assert result.summary["outcome"] == "completed"
    assert 0.1 <= median(settling(select([result], "micro"), "5e-08")) <= 0.18
    assert result.summary["friction"] == []


def test_oracle(run):
    results = [run("oracle", seed, observer=False) for seed in (1, 2)]
    micro, macro = select(results, "micro"), select(results, "macro")
    assert median(settling(micro, "5e-08")) <= 0.008
    assert mean(settling(micro, "5e-08")) <= 0.03
    assert median(settling(micro, "2e-07")) <= 0.001
    assert median(m["peak_error"] for m in micro) <= 0.15e-6
    assert median(settling(macro, "2e-07")) <= 0.002


TRUTHS = {
    "as stated": (1.0, 1.0, 1.0, 1.0),
    "all up": (1.6, 1.6, 1.6, 1.2),
    "all down": (0.6, 0.6, 0.6, 0.8),
    "crossed": (1.5, 0.7, 0.65, 0.85),
}


@pytest.mark.parametrize("truth", TRUTHS)
def test_estimated_from_half_of_all_friction_figures(run, machine, truth, altered):
    stage = altered(machine, *TRUTHS[truth])
    result = run("estimated", 1, 0.5, stage, observer=False)
    micro, macro = select([result], "micro", 4), select([result], "macro", 4)
    assert median(settling(micro, "2e-07")) <= 0.003
    assert median(m["peak_error"] for m in micro) <= 0.3e-6
    assert mean(settling(micro, "5e-08")) <= 0.06
    assert median(settling(macro, "2e-07")) <= 0.005
    # And the figures themselves, both axes: the level wanders by 1 %.
    coulomb, viscous, stiffness, rate = TRUTHS[truth]
    last = {e["axis"]: e["parameters"] for e in result.summary["friction"]}
    for axis, (fc, sv, s0) in {"x": (6.0, 20.0, 6e5), "y": (9.0, 30.0, 8e5)}.items():
        assert last[axis]["coulomb"]["value"] == pytest.approx(fc * coulomb, rel=0.04)
        assert last[axis]["viscous"]["value"] == pytest.approx(sv * viscous, rel=0.1)
        assert last[axis]["stiffness"]["value"] == pytest.approx(s0 * stiffness, rel=0.06)
        if truth != "crossed":  # its micro-moves stay below two breakaway travels
            learned = last[axis]["attraction"]["value"] / last[axis]["coulomb"]["value"]
            assert learned == pytest.approx(100.0 * rate, rel=0.06)


def test_never_updated_is_much_worse(run):
    results = [run("model", 1, 0.5, observer=False)]
    assert median(settling(select(results, "micro", 4), "2e-07")) > 0.03


def test_a_run_in_virtual_time_never_waits_for_the_wall_clock(run, tmp_path):
    # How many times faster than real time it is: benchmarks/settling/run_figures.py.
    ours, slept, watching = threading.get_ident(), [], True

    def watch(event, arguments):
        if watching and event == "time.sleep" and threading.get_ident() == ours:
            slept.append(arguments)

    sys.addaudithook(watch)  # for good; it is idle from then on
    recipe = tmp_path / "short.yaml"
    recipe.write_text(short_recipe((0.01, 0.0), (0.02, 0.01), (0.0, 0.02)))
    summary = run("estimated", recipe=recipe).summary
    watching = False
    assert slept == []
    assert summary["duration"] > 0.5
    assert summary["wall_time"] > 0
