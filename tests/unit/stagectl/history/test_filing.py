"""Filing what a history lacks: once, and for the runs that may lack some."""

from stagectl.history import StageKey, StepRecord

BEGIN = 1.7e9


STAGE = StageKey("wafer-xy", True)


def test_filing_again_adds_nothing(where, opened, a_run, an_estimate):
    """After a connection was lost nobody knows whether the last rows got through."""
    history = opened(where)
    run = a_run(uuid="5eed")
    number = history.start_run(run)
    assert history.start_run(run) == number != history.start_run(a_run(uuid="0ther"))
    history.add([an_estimate(number, number=1)])
    history.add([an_estimate(number, number=n, time=BEGIN + n) for n in (1, 2, 3)])
    step = StepRecord(number, "x", (0.01, -0.02), BEGIN + 2.0, 0.1, "site", number=1)
    history.add_step(step)
    history.add_step(step)
    assert history.filed(number) == 3
    assert history.at_date(STAGE, BEGIN + 1.5)[0].time == BEGIN + 1.0  # as it was
    assert history.steps(STAGE) == [step]


def test_runs_with_estimates_that_may_be_missing_are_listed(where, opened, a_run):
    history = opened(where)
    runs = {name: history.start_run(a_run(uuid=name, folder=f"runs/{name}")) for name in "abcd"}
    history.start_run(a_run(StageKey("another", True), uuid="e"))
    history.start_run(a_run())  # of an older version: nobody could tell which files are its own
    history.end_run(runs["a"], "completed", estimates=7)
    history.end_run(runs["b"], None, estimates=2)  # killed, and filed since
    history.end_run(runs["c"], "fault", "axis x: ...")
    assert history.unfiled(STAGE) == [("d", "runs/d"), ("c", "runs/c")]
    assert history.unfiled(STAGE, last=1) == [("d", "runs/d")]
    outcomes = {number: outcome for number, _, outcome in history.runs(STAGE)}
    assert [outcomes[runs[name]] for name in "abcd"] == ["completed", None, "fault", None]
