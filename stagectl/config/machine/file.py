"""Reading of machine files."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from stagectl.config.history_address import is_server, without_password
from stagectl.config.machine.checks import check_machine
from stagectl.config.machine.model import Machine
from stagectl.config.machine.unknown import fill_unknown, take_unknown
from stagectl.config.parsing.validation import sort_problems, validate
from stagectl.config.parsing.yaml_nodes import Document, load_document, parse_document
from stagectl.errors import ConfigError


def load_machine(
    path: Path | str | None = None, *, fitted: bool = False, gains: bool = True
) -> Machine:
    """The machine of a file; None means the packaged `wafer-xy`.

    Args:
        path: of the file.
        fitted: whether what the file leaves unknown will be found; else that is refused.
        gains: whether the controller's gains are needed; else they may be unknown in any case.

    Raises:
        ConfigError: the file cannot be used; one line per problem.
    """
    if path is not None:
        return _machine(load_document(path), fitted, gains)
    packaged = resources.files("stagectl") / "data" / "machines" / "wafer-xy.yaml"
    return parse_machine(packaged.read_text(encoding="utf-8"), "wafer-xy.yaml (packaged)")


def parse_machine(text: str, name: str, *, fitted: bool = False, gains: bool = True) -> Machine:
    """The machine of a text, such as that in a recording; messages call it `name`.

    `fitted` and `gains` as in `load_machine`.

    Raises:
        ConfigError: the text cannot be used; one line per problem.
    """
    return _machine(parse_document(text, name), fitted, gains)


def _machine(document: Document, fitted: bool, gains: bool) -> Machine:
    data, unknown = take_unknown(document)
    refused = unknown.places if gains else unknown.of_the_plant
    if refused and not fitted:
        text = "is unknown; only `gap diagnose` finds it, anything else needs a figure"
        raise ConfigError([document.problem(place, text) for place in refused])
    machine = validate(document, Machine, data)
    if unknown.places:
        machine = fill_unknown(machine, unknown)
    problems = check_machine(machine, document)
    if problems:
        raise ConfigError(sort_problems(problems))
    if machine.history is not None and is_server(machine.history):
        shown = without_password(machine.history)
        if shown != machine.history:  # recordings and twins are passed on
            document = document.with_text("history", shown)
    machine.attach(document, unknown.axes)
    return machine
