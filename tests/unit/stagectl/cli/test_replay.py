"""`stagectl replay`: what it prints of the first difference."""

import json

from tests.command import stagectl
from tests.unit.stagectl.run.replay.logged import edit


def test_a_frame_that_the_host_sends_differently_is_the_first_one_told(logged):
    number = edit(logged / "bus.asc", r"( 201 .* d 8 \w\w \w\w) \w\w", r"\1 7F", 900)
    edit(logged / "bus.asc", r"( 202 .* d 8 \w\w \w\w) \w\w", r"\1 7F", 950)
    result = stagectl("replay", logged)
    assert result.returncode == 1
    said = " ".join(result.stdout.split())
    assert "was modified after the run" in said + result.stderr
    assert f"differs at frame {number}" in said
    assert said.count("x, RPDO 1: Controlword 0x001F (enable operation") == 2


def test_what_the_host_gets_differently_shows_where_it_acts_on_it(logged):
    """A position that was received otherwise changes an offset later on, by the estimate."""
    number = edit(logged / "bus.asc", r"( 181 .* d 8) 37 12", r"\1 18 02", 400)  # FAULT
    difference = json.loads(stagectl("replay", logged, "--json", "-").stdout)["difference"]
    assert difference["number"] > number
    assert "quick stop" in difference["sent"]["meaning"]
    assert "enable operation" in difference["recorded"]["meaning"]
