"""A console before a fake stage server, and folders with what must not be reached."""

import pytest

from tests.unit.stagectl.console.fake_server import FakeServer
from tests.unit.stagectl.console.live_console import live_console


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A data folder with a run, and what must not be reached from it; one with recipes."""
    root = tmp_path_factory.mktemp("console")
    data, recipes, sockets = root / "data", root / "recipes", root / "sockets"
    for folder in (data / "run-1", data / "gaps" / "gap-1", root / "outside", recipes):
        folder.mkdir(parents=True)
    sockets.mkdir(mode=0o700)
    (root / "outside" / "secret.json").write_text('{"secret": true}')
    (root / "secret.json").write_text('{"secret": true}')
    (data / "run-1" / "summary.json").write_text("{}")
    (data / "run-1" / "report.html").write_text("<script>alert(1)</script>")
    (data / "run-1" / ".hidden.json").write_text("{}")
    (data / "run-1" / "recording.journal").write_text("")
    (data / "link").symlink_to(root / "outside")
    (data / "run-1" / "link.json").symlink_to(root / "secret.json")
    (data / "run-1" / "folder.json").mkdir()
    (recipes / "mine.yaml").write_text("recipe: mine\n")
    (recipes / "linked.yaml").symlink_to(root / "secret.json")
    return root


@pytest.fixture(scope="module")
def fake(folders):
    with FakeServer(folders / "sockets", folders / "data") as server:
        yield server


@pytest.fixture(scope="module")
def live(fake, folders):
    with live_console(fake.where, folders / "data", folders / "recipes") as console:
        yield console.log_in()


@pytest.fixture
def stranger(live):
    """The same console without a cookie."""
    cookie, live.cookie = live.cookie, ""
    yield live
    live.cookie = cookie
