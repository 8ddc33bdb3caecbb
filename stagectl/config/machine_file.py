"""Reading of machine files."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from stagectl.config.history_address import is_server, without_password
from stagectl.config.machine import Machine
from stagectl.config.machine_checks import check_machine
from stagectl.config.validation import sort_problems, validate
from stagectl.config.yaml_nodes import Document, load_document, parse_document
from stagectl.errors import ConfigError


def load_machine(path: Path | str | None = None) -> Machine:
    """The machine of a file; None means the packaged `wafer-xy`.

    Raises:
        ConfigError: the file cannot be used; one line per problem.
    """
    if path is not None:
        return _machine(load_document(path))
    packaged = resources.files("stagectl") / "data" / "machines" / "wafer-xy.yaml"
    return parse_machine(packaged.read_text(encoding="utf-8"), "wafer-xy.yaml (packaged)")


def parse_machine(text: str, name: str) -> Machine:
    """The machine of a text, such as that in a recording; messages call it `name`.

    Raises:
        ConfigError: the text cannot be used; one line per problem.
    """
    return _machine(parse_document(text, name))


def _machine(document: Document) -> Machine:
    machine = validate(document, Machine)
    problems = check_machine(machine, document)
    if problems:
        raise ConfigError(sort_problems(problems))
    if machine.history is not None and is_server(machine.history):
        shown = without_password(machine.history)
        if shown != machine.history:  # recordings and twins are passed on
            document = document.with_text("history", shown)
    machine.attach(document)
    return machine
