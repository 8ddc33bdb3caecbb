"""Every command: an output is no input, and replaces a file of another kind only when asked."""

import os
import sqlite3
from contextlib import closing
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from stagectl.cli import cli
from stagectl.cli.file_kinds import ANY, HTML, JSON, MACHINE_FILE, PAGE, RECIPE_FILE, TABLE
from stagectl.cli.files import HistoryFile, Input, InputFolder, NamesFile, Output, OutputFolder
from stagectl.cli.lazy import LazyGroup
from stagectl.cli.options import DATA, Recording


def commands():
    """All commands, with the words that call them."""
    pending = [((), cli)]
    while pending:
        words, group = pending.pop()
        context = click.Context(group)
        for name in group.list_commands(context):
            command = group.get_command(context, name)
            if isinstance(command, LazyGroup):
                pending.append(((*words, name), command))
            elif command is not None:
                yield (*words, name), command


VALUES = {"integer": "1", "integer range": "1", "OBJECT": "0x1000"}
"""Of parameters that name no file, by their type; a folder with a run for all others."""


def call(words, command, given):
    """Exit code and error of a command; what else it requires gets a value, too."""
    options, arguments = [], []
    for param in command.params:
        name = param.name or ""
        if name not in given and not param.required:
            continue
        value = given.get(name, VALUES.get(param.type.name, "else"))
        if isinstance(param, click.Option):
            options += [param.opts[0], value]
        else:
            arguments.append(value)
    done = CliRunner().invoke(cli, [*words, *options, "--", *arguments])
    return done.exit_code, " ".join((done.output + done.stderr).split())


def test_every_parameter_that_names_a_file_says_what_it_is_for():
    for words, command in commands():
        for param in command.params:
            named = isinstance(param.type, click.Path | click.File) or any(
                word in f"{param.metavar} {param.name}".upper() for word in ("FILE|", "HISTORY")
            )
            assert not named or isinstance(param.type, NamesFile), (words, param.name)


def test_no_two_parameters_of_a_command_have_one_name():
    for words, command in commands():
        names = [param.name for param in command.params]
        assert len(set(names)) == len(names), words


@pytest.fixture
def here(tmp_path, monkeypatch):
    """The working directory, with the folder of another run."""
    monkeypatch.chdir(tmp_path)
    Path("else").mkdir()
    Path("else/recording.h5").touch()


def is_refused(words, command, given, why="an output must be"):
    code, said = call(words, command, given)
    assert (code, why in said) == (2, True), (words, given, said)


def test_no_command_writes_over_what_it_reads(here):
    """Under the same name, through a link, and through a second name of the same file."""
    Path("file").write_text("precious")
    Path("link").symlink_to("file")
    os.link("file", "second")
    tried = 0
    for words, command in commands():
        outputs = [p for p in command.params if isinstance(p.type, Output)]
        for out in outputs:
            for other in command.params:
                if other is out or not isinstance(other.type, Input | HistoryFile | Output):
                    continue
                for name in ("file", "link", "second"):
                    is_refused(words, command, {other.name: "file", out.name: name})
                    tried += 1
    assert tried > 100
    assert Path("file").read_text() == "precious"


def test_no_command_replaces_a_file_of_another_kind(here):
    Path("notes.csv").write_text("Remember: the key is under the mat\n")
    for words, command in commands():
        for out in command.params:
            if isinstance(out.type, Output) and out.type.kind is not ANY:
                is_refused(words, command, {out.name: "notes.csv"}, "with --overwrite")
    assert "mat" in Path("notes.csv").read_text()


def test_a_runs_own_files_are_no_outputs_of_a_command_that_reads_or_makes_it(here):
    Path("file").mkdir()
    Path("file/summary.json").write_text("{}")
    Path("file/recording.h5").touch()
    tried = []
    for words, command in commands():
        for out in command.params:
            for other in command.params:
                folder = isinstance(other.type, InputFolder | OutputFolder | Recording)
                if folder and isinstance(out.type, Output):
                    pair = {other.name: "file", out.name: "file/summary.json"}
                    is_refused(words, command, pair)
                    tried.append(words[-1])
                elif folder and isinstance(out.type, OutputFolder) and other is not out:
                    is_refused(words, command, {other.name: "file", out.name: "file"})
    assert {"run", "calibrate", "list", "replay", "measure", "identify"} <= set(tried)


def test_a_history_made_by_the_command_itself_is_not_replaced(here):
    with closing(sqlite3.connect("stage.db")) as connection:
        connection.execute("create table t (x)")
    before = Path("stage.db").read_bytes()
    done = CliRunner().invoke(cli, ["bus-budget", "--json", "stage.db"])
    assert (done.exit_code, Path("stage.db").read_bytes()) == (2, before)


def test_when_asked_any_file_is_replaced(tmp_path):
    path = tmp_path / "notes"
    path.write_text("mine")
    done = CliRunner().invoke(cli, ["bus-budget", "--json", str(path), "--overwrite"])
    assert done.exit_code == 0, done.output
    assert JSON.is_at(path)


@pytest.mark.parametrize(
    ("kind", "text", "other"),
    [
        (JSON, '{"a": 1}\n', '{"a": 1'),
        (HTML, "<!doctype html>\n<html>", "<svg>"),
        (MACHINE_FILE, (DATA / "machines/wafer-xy.yaml").read_text(), "recipe: a\n"),
        (RECIPE_FILE, (DATA / "recipes/inspection-20.yaml").read_text(), "bus: {}\n"),
        (TABLE, "axis,x_m\r\nx,0\r\n", "a, b\n"),
        (PAGE, "# Title\n\n<!-- Made by `stagectl paper --out docs/paper.md`. -->", "# Title\n"),
    ],
)  # fmt: skip
def test_a_file_of_the_same_kind_is_replaced(tmp_path, kind, text, other):
    path = tmp_path / "file"
    assert kind.is_at(path)
    path.write_text("")
    assert kind.is_at(path)
    path.write_text(text)
    assert kind.is_at(path)
    path.write_text(other)
    assert not kind.is_at(path)
    assert kind.is_at(Path("/dev/null"))
