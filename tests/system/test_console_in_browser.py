"""The operator's page in a browser, before a real stage server on virtual drives."""

import os
import re
import signal
import time

import pytest

from stagectl.client import Client
from stagectl.config import load_machine
from stagectl.console.gate import SOCKET
from stagectl.protocol.requests import Abort, QueueRemove
from tests.chromium import chromium
from tests.processes import start
from tests.waiting import LONG, wait_until

RECIPE = """\
recipe: nine
macro: {velocity: 0.1, acceleration: 1.0, jerk: 50.0}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 1.0e-6, hold: 0.01, timeout: 0.5}
expose: 0.3
sites: {grid: {origin: [0.0, 0.0], pitch: [0.02, 0.02], count: [3, 3]}}
fiducial: {source: simulated, range: 80.0e-6, seed: 1}
lot: L7
"""
PAIR = RECIPE.replace("recipe: nine", "recipe: pair").replace("count: [3, 3]", "count: [2, 1]")


class Operator:
    """Somebody at a page.

    Attributes:
        page: of Playwright.
        problems: what the page's console has complained about.
    """

    def __init__(self, browser, address, name):
        self.context = browser.new_context()
        self.page = self.context.new_page()
        self.page.set_default_timeout(1e3 * LONG)
        self.problems = []
        self.page.on("pageerror", lambda why: self.problems.append(str(why)))
        self.page.on("console", self._said)
        self.page.add_init_script(f"localStorage.setItem('operator', '{name}')")
        self.page.goto(address)
        self.page.wait_for_selector(".now[data-state]:not([data-state=none])")

    def _said(self, message):
        if message.type == "error" and SOCKET not in message.text:
            self.problems.append(message.text)

    def go(self, page):
        self.page.click(f"nav a[href='#{page}']")

    def take(self):
        if self.page.get_by_text("Give back").count() == 0:
            self.page.click(".who button")
            self.page.wait_for_selector("text=Give back")

    def wait(self, state):
        self.page.wait_for_selector(f".now[data-state={state}]")

    def write(self, recipe):
        self.go("run")
        self.page.wait_for_selector(".gutter span:nth-child(5)")  # the chosen one has come
        self.page.fill("#recipe", recipe)

    def queue(self, recipe=RECIPE):
        self.write(recipe)
        self.page.wait_for_selector("text=can be run")
        self.page.click("text=Queue and start")

    def leave(self):
        self.context.close()


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def served(tmp_path_factory, browser):
    """Address of a console that has started a server, and a client of that."""
    folder = tmp_path_factory.mktemp("console")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STAGECTL_RUNTIME", str(folder / "run"))
        console = start(
            "console", "--simulate", "--port", "0", "--no-browser", "--data", folder / "data"
        )
        with console:
            address = console.stdout.readline().strip()
            try:
                yield address, folder
            finally:
                console.send_signal(signal.SIGINT)
                console.communicate(timeout=LONG)
        assert console.returncode == 0


@pytest.fixture
def anna(browser, served):
    operator = Operator(browser, served[0], "Anna")
    yield operator
    problems = list(operator.problems)
    operator.leave()
    assert problems == []


@pytest.fixture
def client(anna):
    """Of the server, for what the page cannot know; leaves the stage at rest."""
    with Client("simulated") as found:
        yield found
        found.take(force=True)
        state = found.state()
        if state.run is not None:
            found.ask(Abort())
        for entry in state.queue:
            if entry.status == "waiting":
                found.ask(QueueRemove(id=entry.id))
        found.release()
        wait_until(lambda: found.state().run is None)


def test_a_run_from_recipe_to_report(anna, client):
    page = anna.page
    anna.take()
    anna.go("run")
    note = "<img src=x onerror=document.title='taken'>"
    page.fill("input[placeholder^='stored']", note)
    anna.queue()
    anna.wait("running")
    page.wait_for_selector(".results svg.table .site.done")
    page.click("text=Pause after this site")
    anna.wait("paused")
    assert client.state().run.paused_since is not None
    page.click("text=Resume")
    anna.wait("running")
    page.wait_for_selector("table.sites tbody tr:nth-child(9)")
    page.wait_for_selector(".entries >> text=completed")
    progress = client.state().queue[-1]
    assert (progress.outcome, progress.lot, progress.operator) == ("completed", "L7", "Anna")
    anna.go("runs")
    row = page.wait_for_selector("tr:has-text('nine')")
    assert "<img src=x" in row.inner_text()  # as text
    assert "taken" not in page.title()
    with anna.context.expect_page() as opened:
        page.click("tr:has-text('nine') >> text=report")
    report = opened.value
    report.wait_for_selector(".uplot canvas")  # its own scripts run
    assert report.evaluate("self.origin") == "null"  # in a sandbox


@pytest.mark.slow
def test_a_run_with_a_twin_from_its_diagnosis_to_what_it_changed(anna, client, served):
    page, folder = anna.page, served[1] / "data" / "gaps" / "g-1"
    folder.mkdir(parents=True)
    (folder / "twin.yaml").write_text(load_machine().text)
    runs = []
    for twin in (False, True):
        anna.take()
        anna.go("gap")
        if twin:
            page.click("tr:has-text('g-1') >> text=Run with it")
        anna.queue(PAIR)
        wait_until(
            lambda: len(client.state().queue) and client.state().queue[-1].status == "running"
        )
        runs.append(client.state().queue[-1])
        wait_until(lambda: client.state().run is None)
    assert runs[0].machine is None
    assert runs[1].machine == str(folder / "twin.yaml")
    anna.go("runs")
    boxes = page.locator("tr:has-text('pair') input[type=checkbox]")
    boxes.nth(0).check()
    boxes.nth(1).check()
    page.click("text=Compare their machine files")
    page.wait_for_selector(".hint >> text=of the earlier one's gap above its floor")
    page.evaluate("sessionStorage.removeItem('twin')")


def test_live_shows_brake_and_sto_of_each_axis(anna, client):
    anna.go("live")
    card = anna.page.locator("section.axis").nth(1)
    card.locator("text=not active").wait_for()
    assert "Brake" in card.inner_text()
    assert re.search(r"\d\.\d %", anna.page.inner_text(".slim"))


def test_a_recipe_error_shows_its_line(anna):
    anna.write(RECIPE.replace("expose: 0.3", "expose: fast"))
    anna.page.wait_for_selector(".problems >> text=line 5, column 9")
    assert anna.page.inner_text(".gutter .marked").split()[-1] == "5"
    anna.page.click(".problems .link")
    at = anna.page.evaluate("document.getElementById('recipe').selectionStart")
    assert RECIPE[:at].count("\n") == 4
    assert anna.page.is_disabled("text=Queue and start")


DECIMATED = """async () => {
    const { Ring } = await import("/static/samples.js");
    const ring = new Ring(), rows = 8, error = 4, lost = [];
    const frame = (first, count, spikes) => {
        const buffer = new ArrayBuffer(24 + 8 * rows * count);
        new Uint32Array(buffer, 0, 4).set([1, 1, count, 0]);
        new DataView(buffer).setFloat64(16, first, true);
        const values = new Float64Array(buffer, 24);
        for (const [at, value] of spikes) values[error * count + at - first] = value;
        ring.take(buffer);
    };
    frame(1000, 9000, [[1234, 5], [7777, -5]]);
    frame(10050, 5000, [[12345, 7]]); // behind a gap of 50
    for (const bins of [50, 333, 1000, 4000]) for (let first = 1000; first < 1230; first += 7) {
        const [numbers, [values]] = ring.decimated([error], first, 15050, bins);
        if (Math.max(...values) !== 7 || Math.min(...values) !== -5) lost.push([bins, first]);
        if (!values.includes(5) || numbers.length > 2 * bins + 4) lost.push([bins, first]);
    }
    const [, [gap]] = ring.decimated([error], 10000, 10050, 50);
    return { lost, gap: gap.every((value) => value === null), end: ring.end };
}"""


def test_what_the_scope_draws_loses_no_spike(anna):
    assert anna.page.evaluate(DECIMATED) == {"lost": [], "gap": True, "end": 15050}


def moved(client, before):
    return abs(client.state().axes[0].position - before) > 20e-6


@pytest.fixture
def held(anna, client):
    """The stage ready to be moved by hand, and the button that does so."""
    anna.take()
    anna.go("move")
    if not client.state().homed:
        anna.page.click("button:text-is('Home')")
    elif not client.state().enabled:
        anna.page.click("button:text-is('Enable')")
    anna.wait("held")
    wait_until(lambda: client.state().homed)
    return anna.page.locator("button.hold").nth(1)


def release(page, how):
    if how == "released":
        page.mouse.up()
    elif how == "hidden":
        page.evaluate("""() => {
            Object.defineProperty(document, "hidden", { get: () => true });
            document.dispatchEvent(new Event("visibilitychange"));
        }""")
    elif how == "left":
        page.evaluate("location.pathname = '/static/icon.svg'")
    elif how == "another page":
        page.evaluate("location.hash = 'live'")
    else:
        event = "PointerEvent" if how == "pointercancel" else "Event"
        page.evaluate(f"dispatchEvent(new {event}('{how}'))")


def rarely(how):
    return pytest.param(how, marks=pytest.mark.slow)


@pytest.mark.parametrize(
    "how",
    ["hidden", "pointercancel", "left", *map(rarely, ["released", "blur", "another page"])],
)
def test_hold_to_move_ends(anna, client, held, how):
    before = client.state().axes[0].position
    held.hover()
    anna.page.mouse.down()
    wait_until(lambda: moved(client, before))
    release(anna.page, how)
    wait_until(lambda: client.state().doing == "held")
    at_rest = client.state().axes[0].position
    time.sleep(0.5)
    assert client.state().doing == "held"
    assert abs(client.state().axes[0].position - at_rest) < 1e-6


@pytest.mark.slow
def test_steps_and_figures_move_an_axis(anna, client, held):
    before = client.state().axes[1].position
    anna.page.click("button:text-is('+ y')")
    wait_until(lambda: abs(client.state().axes[1].position - before - 1e-4) < 1e-6)
    anna.page.fill("input[aria-label='figure for y in mm']", "1.5")
    anna.wait("held")
    anna.page.locator("text=Go to").nth(1).click()
    wait_until(lambda: abs(client.state().axes[1].position - 1.5e-3) < 1e-6)


def test_a_second_browser_watches_and_stops_but_does_not_command(anna, client, browser, served):
    anna.take()
    ben = Operator(browser, served[0], "Ben")
    try:
        ben.page.wait_for_selector(".who >> text=Anna")
        anna.queue()
        ben.wait("running")
        ben.go("move")
        ben.page.wait_for_selector("button:text-is('+ y')")
        buttons = ben.page.locator("main button:not([aria-pressed])")
        assert buttons.count() > 8
        assert all(buttons.nth(k).is_disabled() for k in range(buttons.count()))
        ben.page.keyboard.press("Escape")
        anna.wait("disabled")
        wait_until(lambda: client.state().run is None)
        assert client.state().queue[-1].outcome in ("aborted", "fault")
        assert not client.state().queue_runs
        ben.page.click(".who button")
        ben.page.click("dialog button.main")
        ben.page.wait_for_selector("text=Give back")
        anna.page.wait_for_selector("text=you watch")
        assert ben.problems == []
    finally:
        ben.leave()


@pytest.mark.slow
def test_a_server_that_is_killed_in_mid_run_comes_back_and_starts_nothing(anna, client, served):
    page = anna.page
    anna.take()
    anna.queue()
    anna.wait("running")
    os.kill(client.info.pid, signal.SIGKILL)
    page.click("text=Start the stage server")
    anna.wait("disabled")
    with Client("simulated") as again:
        state = again.state()
        assert state.run is None
        assert not state.queue_runs
        assert state.queue[-1].status == "interrupted"
        wait_until(lambda: list(served[1].glob("data/nine-*/recording.h5")))
        anna.go("run")
        assert re.search("interrupted", page.inner_text(".entries"))
