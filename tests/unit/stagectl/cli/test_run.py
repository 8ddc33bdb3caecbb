"""`stagectl run`, in this process."""

import json

from click.testing import CliRunner

from stagectl.cli import cli
from tests.signals import as_in_a_terminal
from tests.unit.stagectl.run.whole import SITES, failing_at


def test_an_interrupted_run_is_continued(go, sites, tmp_path):
    (tmp_path / "r.yaml").write_text(SITES)
    listener, _ = failing_at(6)
    go(sites, "a", listener=listener)

    def run(*options):
        arguments = ["run", str(tmp_path / "r.yaml"), "--simulate", *options]
        with as_in_a_terminal():
            return CliRunner().invoke(cli, arguments)

    folder, other = str(tmp_path / "a"), str(tmp_path / "b")
    clash = run("--resume", folder, "--out", folder)
    assert clash.exit_code == 2
    assert "given as --resume and as --out" in " ".join(clash.output.split())
    told = tmp_path / "plan.json"
    planned = run("--resume", folder, "--dry-run", "--json", str(told))
    assert planned.exit_code == 0, planned.output
    plan = json.loads(told.read_text())
    assert plan["sites"] == len(sites.sites) - 2
    assert plan["moves"]["macro"] == plan["sites"]
    rest = run("--resume", folder, "--out", other, "--retries", "1")
    assert rest.exit_code == 0, rest.output
    assert "after the first 2 sites" in rest.output
