"""`gap blind` continues from its lines; unusable input is one line."""

import json

from click.testing import CliRunner

from stagectl.cli.gap_blind import blind
from stagectl.errors import StagectlError

LINE = {
    "label": "v", "only": None, "elements": None, "substeps": None, "seed": 3, "number": 0,
    "leave_out": False, "kind": "one",
    "truth": [
        {"axis": "x", "effect": "dead_time", "values": {"delay": 5e-4}, "gap": 3.0,
         "kin": "dead_time"},
    ],
    "verdict": "explained",
    "told": [
        {"axis": "x", "effect": "dead_time", "probability": 0.98, "gap_closed": 0.97,
         "parameters": {"delay": [5.1e-4, 1e-5]}},
    ],
    "confusable": [], "sigmas": {"x.dead_time.delay": 1.0}, "gap": 3.0, "promised": 0.97,
    "second": 0.95, "seconds": 12.0, "processor": 10.0, "key": "{}", "nonce": "", "digest": "",
}  # fmt: skip


def run(*arguments):
    done = CliRunner().invoke(blind, [str(a) for a in arguments])
    if isinstance(done.exception, StagectlError):
        return done.exception.exit_code, str(done.exception)
    assert done.exception is None, repr(done.exception)
    return 0, done.output


def test_trials_already_in_the_lines_are_not_repeated(tmp_path):
    lines, figures, docs = (tmp_path / name for name in ("t.jsonl", "t.json", "blind.md"))
    lines.write_text(json.dumps(LINE) + "\n" + json.dumps({**LINE, "seed": 4}) + "\n")
    common = ("--trials", 1, "--seed", 3, "--label", "v", "--lines", lines)
    code, _ = run(*common, "--json", figures, "--docs", docs)
    assert code == 0
    assert len(lines.read_text().splitlines()) == 2
    counted = json.loads(figures.read_text())
    assert counted["one"] == {"count": 1, "of": 1}
    assert counted["confusion"] == [["dead_time", "dead_time", 1]]
    assert "seeds: 3, 4; trials: 2" in docs.read_text()


def test_unusable_input_is_one_line(tmp_path):
    lines = tmp_path / "t.jsonl"
    lines.write_text(json.dumps(LINE) + "\n[1]\n")
    assert run("--lines", lines) == (2, f"{lines}:2: is not a blind trial")
    lines.write_bytes(b"\x93\xff\x00")
    assert run("--lines", lines) == (2, f"{lines}: is not a file of blind trials")
    code, text = run("--only", "magic")
    assert code == 2
    assert text.startswith("--only: no effect magic; there are ")
