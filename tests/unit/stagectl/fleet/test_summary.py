"""A summary says what the results in a folder say, as text, page, JSON and tables."""

import io
import json
from datetime import timedelta

import pyarrow.parquet as pq
import pytest
from rich.console import Console

from stagectl.errors import UnusableInput
from stagectl.fleet.history import keep_friction
from stagectl.fleet.ledger import Ledger
from stagectl.fleet.page import fleet_outline, write_summary
from stagectl.fleet.rows import REFUSED, RESULT, to_parquet
from stagectl.fleet.summary import summarise
from stagectl.fleet.task import Done
from stagectl.history import StageKey, open_history
from stagectl.report import print_outline
from tests.postgres import serve
from tests.unit.stagectl.fleet.conftest import BEGIN
from tests.unit.stagectl.rows import estimate_record, run_entry


def keep(folder, rows):
    ledger = Ledger(folder)
    for number, row in enumerate(rows):
        name = f"results/{number}.parquet"
        folder.write(name, to_parquet([row], RESULT))
        ledger.note(Done(row["recording"], "", f"{number}", name, False, None))
    ledger.note_failure("hopeless.h5", "failed 3 times: boom")
    ledger.save()


@pytest.fixture
def fleet(folder, row):
    """A stage with cogging whose friction rises, one that is fine, one that nobody can judge."""
    rows = [row("bad", day, ["cogging"], 9.0, 6.0 + 0.05 * day) for day in range(12)]
    rows += [row("good", day, floors=1.0, coulomb=6.0) for day in range(12)]
    rows.append(row("odd", verdict="unexplained", reason="nobody knows", floors=4.0))
    rows.append(row("odd", 1, verdict="unexplained", channels=["x: force reversed"], floors=4.0))
    rows.append(row("?", verdict=REFUSED, reason="truncated", recording="cut.h5", floors=None))
    keep(folder, rows)
    return folder


def test_the_worst_come_first_with_what_is_due(fleet):
    found, _, _ = summarise(fleet)
    assert [s.key.machine for s in found.stages] == ["bad", "odd", "good"]
    (drift,) = found.drifts
    assert (drift.series.key.machine, drift.series.axis) == ("bad", "x")
    assert drift.change == pytest.approx(11 * 0.05 / 6.0, rel=1e-6)
    due = {(of.stage, of.what): of for of in found.due}
    assert due["bad", "mend"].why == "cogging on x in 5 of the last 5 recordings"
    assert due["bad", "Calibrate the friction."].within == pytest.approx(0.1 * 6.0 / 0.05 - 11)
    assert due["odd", "Record what 'stagectl gap excite' proposes."].why == "why"
    assert due["odd", "Correct the channel."].why == "x: force reversed"
    assert len(due) == 4
    assert found.due[-1].within > 0.0
    assert (found.refused, found.failures) == (
        {"cut.h5": "truncated"}, {"hopeless.h5": "failed 3 times: boom"}
    )  # fmt: skip


def test_terminal_page_json_and_tables_say_the_same(fleet, tmp_path):
    found, rows, friction = summarise(fleet)
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(print_outline(fleet_outline(found)), crop=False)
    said = " ".join(console.export_text().split())
    names = write_summary(fleet, found, rows, friction)
    page = (tmp_path / "fleet" / names[0]).read_text()
    for text in (said, page):
        for words in ("cogging on x (80 %)", "truncated", "boom", "+9.2 %", "Calibrate"):
            assert words in text
    assert page.count('class="chart curves"') == 4  # the drift, and the gap of three stages
    values = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert values["recordings"] == 27
    assert values["stages"][0]["effects"][0]["effect"] == "cogging"
    diagnoses, causes, measured = (
        pq.read_table(tmp_path / "fleet" / name).to_pylist() for name in names[1:]
    )
    assert len(diagnoses) == 27
    assert {of["verdict"] for of in diagnoses} == {"explained", "unexplained", REFUSED}
    assert [of["effect"] for of in causes] == ["cogging"] * 12
    assert max(of["coulomb"] for of in measured if of["stage"] == "bad") == 6.55


@pytest.mark.parametrize("kind", ["file", "postgres"])
def test_friction_of_a_history_is_kept_beside_the_results(kind, fleet, tmp_path):
    if kind == "file":
        keep_and_check(str(tmp_path / "stage.db"), fleet)
    else:
        with serve() as server:
            keep_and_check(server.url, fleet)


def keep_and_check(where, fleet):
    history = open_history(where, write=True)
    stage = StageKey("good", False)
    for day in range(20, 23):
        started = (BEGIN + timedelta(days=day)).timestamp()
        number = history.start_run(run_entry(stage, started=started, uuid=f"u{day}"))
        history.add([estimate_record(number, number=1, time=started + 1.0)])
    history.close()
    assert keep_friction(where, fleet) == 3
    found, _, friction = summarise(fleet)
    assert [of["coulomb"] for of in friction] == [6.0] * 3
    (series,) = [s for s in found.series if s.axis == "x" and s.key == stage]
    assert len(series.time) == 15


def test_a_folder_without_results_is_refused(folder):
    with pytest.raises(UnusableInput, match="no results"):
        summarise(folder)
