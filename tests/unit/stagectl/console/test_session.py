"""Who commands by which page, and that motion ends with it."""

import time

import pytest

from stagectl.console.access import Access
from stagectl.console.session import RENEWAL
from stagectl.rates import Rates
from tests.unit.stagectl.console.live_console import TOKEN, Page, page
from tests.waiting import wait_until


@pytest.fixture(autouse=True)
def _heard_anew(fake):
    yield
    fake.heard.clear()
    fake.changes.clear()


@pytest.fixture
def anna(live):
    with page(live, "Anna") as opened:
        yield Page(opened)


@pytest.fixture
def commanding(anna):
    anna.until(lambda state: state.get("doing"))
    assert "result" in anna.ask(op="take", force=True)
    anna.until(lambda state: state["me"]["commands"])
    return anna


def test_a_second_page_watches_and_stops_but_does_not_command(live, fake, commanding):
    with page(live, "Ben") as opened:
        ben = Page(opened)
        ben.until(lambda state: state.get("lease"))
        assert ben.state["lease"]["holder"].startswith("Anna")
        assert not ben.state["me"]["commands"]
        assert "refused" in ben.ask(op="home")
        assert "Anna" in ben.ask(op="take")["refused"]["text"]
        assert not fake.asked("home")
        assert "result" in ben.ask(op="stop")
        assert "Ben" in fake.asked("stop")[0].reason


def test_a_page_that_is_taken_over_knows(live, fake, commanding):
    with page(live, "Ben") as opened:
        assert "result" in Page(opened).ask(op="take", force=True)
        commanding.until(lambda state: not state["me"]["commands"])
        assert "refused" in commanding.ask(op="home")
        assert not fake.asked("home")


def test_command_is_given_back_when_the_page_goes(live, fake, commanding):
    commanding.opened.close()
    wait_until(lambda: fake.asked("release"))


def test_motion_ends_with_the_page(live, fake, commanding):
    assert "result" in commanding.ask(begin=True, op="jog", axis="x", velocity=1e-3)
    commanding.opened.socket.close()  # without a word
    wait_until(lambda: [jog.velocity for jog in fake.asked("jog")] == [1e-3, 0.0])


def test_renewals_that_were_held_up_do_not_start_motion_again(fake, commanding):
    jog = {"op": "jog", "axis": "x", "velocity": 1e-3}
    assert "result" in commanding.ask(begin=True, **jog)
    assert "result" in commanding.ask(**jog)
    time.sleep(2 * RENEWAL)
    assert "refused" in commanding.ask(**jog)
    assert len(fake.asked("jog")) == 2
    assert "result" in commanding.ask(op="jog", axis="x", velocity=0.0)  # is never too late
    assert "refused" in commanding.ask(**jog)
    assert "refused" in commanding.ask(op="jog", axis="y", velocity=1e-3)
    assert len(fake.asked("jog")) == 3


def test_a_recipe_goes_with_its_own_path(fake, folders, commanding):
    asked = {"op": "queue_add", "recipe": "recipe: mine", "source": "mine.yaml"}
    assert commanding.ask(**asked)["result"] == {"id": 1}
    assert fake.asked("queue_add")[0].source == str(folders / "recipes" / "mine.yaml")


def test_a_twin_goes_by_the_name_of_its_diagnosis(fake, folders, commanding):
    twin = folders / "data" / "gaps" / "gap-1" / "twin.yaml"
    twin.write_text("machine: a twin\n")
    asked = {"op": "queue_add", "recipe": "recipe: mine", "source": "mine.yaml"}
    assert "result" in commanding.ask(**asked, machine={"text": "", "source": "gap-1"})
    sent = fake.asked("queue_add")[-1].machine
    assert (sent.text, sent.source) == ("machine: a twin\n", str(twin))


def test_samples_come_without_a_gap(live, fake):
    import struct

    with page(live) as opened:
        opened.send('{"samples": true}')
        expected = None
        for _ in range(200):
            message = opened.recv(60)
            if isinstance(message, str):
                continue
            _, axes, count, _, first = struct.unpack("<IIIId", message[:24])
            assert axes == 2
            assert expected in (None, first)
            assert len(message) == 24 + 8 * 14 * count
            expected = first + count
        assert expected is not None


def test_stop_is_not_limited_but_the_rest_is(live, fake):
    live.console.gate.rates = Rates(rate=0.0, burst=2)
    try:
        assert [live.get("/api/recipes")[0] for _ in range(3)] == [200, 200, 429]
        assert [live.post("/api/stop", {})[0] for _ in range(5)] == [200] * 5
    finally:
        live.console.gate.rates = Rates(rate=1e6, burst=1e6)
    assert len(fake.asked("stop")) == 5


def test_wrong_tokens_are_limited_but_the_right_one_is_not(live):
    live.console.gate.wrong_tokens = Rates(rate=0.0, burst=1)
    try:
        wrong = [live.post("/api/login", {"token": "wrong"})[0] for _ in range(3)]
        assert wrong == [401, 429, 429]
        assert live.post("/api/login", {"token": TOKEN})[0] == 200
    finally:
        live.console.gate.wrong_tokens = Rates(rate=1e6, burst=1e6)


def test_a_ticket_is_good_once_for_its_session_and_for_seconds():
    now = [0.0]
    access = Access(TOKEN, lambda: now[0])
    ticket = access.give_ticket("a", "Anna")
    assert access.redeem(ticket, "b") is None
    assert access.redeem(ticket, "a") is None  # spent by the attempt
    ticket = access.give_ticket("a", "Anna")
    assert access.redeem(ticket, "a") == "Anna"
    assert access.redeem(ticket, "a") is None
    ticket = access.give_ticket("a", "Anna")
    now[0] = 10.5
    assert access.redeem(ticket, "a") is None


def test_a_cookie_expires_after_a_shift():
    now = [0.0]
    access = Access(TOKEN, lambda: now[0])
    cookie = access.log_in(TOKEN)
    assert Access(TOKEN, lambda: 3600.0).session(cookie) == access.session(cookie) is not None
    assert Access(TOKEN + "x", lambda: now[0]).session(cookie) is None
    now[0] = 17 * 3600.0
    assert access.session(cookie) is None
