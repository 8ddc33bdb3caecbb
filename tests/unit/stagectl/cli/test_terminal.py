"""What is printed is printed as it is; progress of several phases on one bar."""

import re
from pathlib import Path

from click.testing import CliRunner
from rich.table import Table

import stagectl
from stagectl.cli import cli
from stagectl.cli.options import DATA
from stagectl.cli.terminal import join_phases, make_console, progress_bar


def test_phases_share_one_bar_that_never_goes_back():
    bar = []
    advance = join_phases(("first", "second"), lambda *state: bar.append(state))
    for what, done, total in (
        ("first", 0, 4), ("first", 2, 4), ("second", 1, 2), ("first", 4, 4), ("second", 2, 2),
        ("second", 0, 0),
    ):  # fmt: skip
        advance(what, done, total)
    assert bar == [
        ("first", 0, 200), ("first", 50, 200), ("second", 150, 200), ("first", 150, 200),
        ("second", 200, 200), ("second", 200, 200),
    ]  # fmt: skip


HOSTILE = "[/b] [red]red[/red] :warning:"


def test_a_console_prints_names_as_they_are(capsys):
    table = Table(title=HOSTILE)
    table.add_column("[bold]name")
    table.add_row(HOSTILE)
    console = make_console()
    console.print(HOSTILE, table)
    said = capsys.readouterr().out
    assert said.count(HOSTILE) == 3
    assert "[bold]name" in said


def test_what_is_being_done_is_no_markup_either(monkeypatch):
    for name, value in (("FORCE_COLOR", "1"), ("TERM", "xterm"), ("COLUMNS", "160")):
        monkeypatch.setenv(name, value)  # a bar is drawn on terminals only
    console = make_console()
    with console.capture() as shown, progress_bar(console, HOSTILE) as update:
        update(f"{HOSTILE} again", 1, 2)
    assert "[/b]" in shown.get()


def test_there_is_no_other_way_to_make_a_console():
    made = [
        path.name
        for path in Path(stagectl.__file__).parent.rglob("*.py")
        if re.search(r"(?<!class )\b(Plain)?Console\(", path.read_text(encoding="utf-8"))
    ]
    assert made == ["terminal.py"]


def test_a_machine_may_have_any_name(tmp_path):
    machine = tmp_path / "machine.yaml"
    text = (DATA / "machines/wafer-xy.yaml").read_text()
    machine.write_text(re.sub(r"(?m)^machine: .*$", f"machine: '{HOSTILE}'", text))
    done = CliRunner().invoke(cli, ["bus-budget", "--machine", str(machine)])
    assert done.exit_code == 0, done.exception
    assert HOSTILE in done.output
