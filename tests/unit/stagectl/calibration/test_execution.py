"""A calibration as a program makes it: stopped by the operator, and gone on with."""

from stagectl.calibration import calibrate, calibration_as_json, load_calibration
from stagectl.calibration.execution import resume_calibration
from stagectl.run import HostSettings, Remarks, execute
from stagectl.sequencer import SegmentDone
from tests.unit.stagectl.calibration.conftest import FILE
from tests.unit.stagectl.run.whole import request_for, stopping_at


def test_a_stopped_calibration_has_no_map_and_says_how_to_go_on(machine, tmp_path):
    (tmp_path / "sites.yaml").write_text(FILE)
    calibration = load_calibration(tmp_path / "sites.yaml", machine)
    request = request_for(
        machine, tmp_path / "run", recipe=calibration.at(calibration.recipe.sites),
        host=HostSettings(observer=False), remarks=Remarks(operator="Ada"),
        history=str(tmp_path / "stage.db"),
    )  # fmt: skip
    result = calibrate(
        request, calibration, [], lambda asked: execute(asked, stopping_at(SegmentDone, 1))
    )
    assert "stopped by the operator" in str(result.error)
    assert f"--resume {tmp_path / 'run'}" in result.command
    report = result.report
    assert (report.version, report.visited, report.planned) == (None, 1, 5)
    assert "Interrupted" in (tmp_path / "run" / "report.html").read_text()
    written = calibration_as_json(request, calibration.sequence, None, report.outcomes)
    assert [(site["site"], site["axis"]) for site in written["sites"]] == [(1, "x"), (1, "y")]

    continued, before = resume_calibration(request, calibration, tmp_path / "run")
    assert (continued.resumed.done, continued.remarks.operator) == (1, "Ada")
    assert continued.recipe.sites == request.recipe.sites
    assert {estimate["axis"] for estimate in before} == {"x", "y"}
