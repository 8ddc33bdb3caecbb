"""The recipes that the page offers: those of one folder, and those that come with the program.

A page may change the text that it sends, never the folder that the recipe's files are in.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import yaml

from stagectl.console.folder import NoSuchFile, is_name, open_inside
from stagectl.errors import UnusableInput
from stagectl.protocol.requests import MOST_RECIPE

_PACKAGED = Path(__file__).parents[1] / "data" / "recipes"
Kind = Literal["recipe", "calibrate"]
"""The first key of its files."""
_SUFFIXES = (".yaml", ".yml")


class Recipes:
    """Looks for recipes.

    Args:
        folder: of recipes, or None.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folders = [*([folder.resolve()] if folder else []), _PACKAGED]

    def names(self, kind: Kind = "recipe") -> list[str]:
        """File names of recipes or calibrations; the folder's hide packaged ones of their name."""
        found = (
            path.name
            for folder in self._folders
            if folder.is_dir()
            for path in sorted(folder.iterdir())
            if path.suffix in _SUFFIXES and is_name(path.name) and _is(path, kind)
        )
        return list(dict.fromkeys(found))

    def read(self, name: str) -> str:
        """The text of a recipe.

        Raises:
            NoSuchFile: there is none of this name, or it is not text of a recipe's size.
        """
        with open_inside(self._folder_of(name), name) as file:
            data = file.read(MOST_RECIPE + 1)
        if len(data) > MOST_RECIPE:
            raise NoSuchFile(f"{name}: larger than a recipe can be")
        try:
            return data.decode("utf-8")
        except UnicodeDecodeError as why:
            raise NoSuchFile(f"{name}: not UTF-8") from why

    def path(self, name: str, kind: Kind = "recipe") -> Path:
        """Where a recipe or calibration is.

        Raises:
            NoSuchFile: there is none of this name.
        """
        return self._folder_of(name, kind) / name

    def _folder_of(self, name: str, kind: Kind = "recipe") -> Path:
        if name in self.names(kind):
            for folder in self._folders:
                if (folder / name).is_file() and not (folder / name).is_symlink():
                    return folder
        raise NoSuchFile(f"{name[:100]}: no such recipe")


def _is(path: Path, kind: Kind) -> bool:
    key = f"{kind}:".encode()
    try:
        with path.open("rb") as file:
            return any(line.startswith(key) for line in file.read(MOST_RECIPE).splitlines())
    except OSError:
        return False


def refuse_files_elsewhere(text: str, source: Path) -> None:
    """Refuse a recipe whose tables are not in its own folder.

    Raises:
        UnusableInput: a file that it names is elsewhere.
    """
    try:
        plain = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError):
        return  # whoever checks the recipe says where it is wrong
    for section in ("sites", "fiducial"):
        named = plain.get(section) if isinstance(plain, dict) else None
        file: Any = named.get("file") if isinstance(named, dict) else None
        if file is None:
            continue
        try:
            open_inside(source.parent, *str(file).split("/")).close()
        except NoSuchFile as why:
            raise UnusableInput(f"{section}.file: {why}, in the recipe's folder") from None
