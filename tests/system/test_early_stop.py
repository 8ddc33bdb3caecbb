"""A stop requested before anything moves, where the exception that it raises is lost."""

from contextlib import suppress
from datetime import UTC, datetime

import pytest

from stagectl.errors import Aborted
from stagectl.recipe import parse_recipe
from stagectl.run import Listener, RunRequest, execute
from stagectl.sequencer import Mode
from tests.system.short_recipe import short_recipe


@pytest.mark.parametrize("during", ["booting the drives", "homing", "enabling the drives"])
def test_a_stop_that_a_finalizer_swallows_is_not_lost(machine, tmp_path, during):
    """As `__del__` does, whose exceptions Python reports and forgets."""
    stops, phases = [], []

    def phase(name):
        phases.append(name)
        if name == during:
            with suppress(KeyboardInterrupt):
                stops[0]("stopped by the operator (Ctrl-C)")

    request = RunRequest(
        parse_recipe(short_recipe((0.01, 0.0)), "r.yaml", machine), machine, machine, None,
        Mode.NONE, 1.0, 1, tmp_path / "run", datetime.now(UTC),
    )  # fmt: skip
    result = execute(request, Listener(phase=phase, stoppable=stops.append))
    assert isinstance(result.error, Aborted)
    assert "Ctrl-C" in str(result.error)
    assert phases[phases.index(during) + 1].startswith("writing")
