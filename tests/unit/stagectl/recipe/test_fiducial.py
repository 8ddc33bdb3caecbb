"""Sources of marks."""

import pytest

from stagectl.errors import ConfigError, RunFault
from stagectl.recipe import NoMark, make_fiducial
from stagectl.recipe.fiducial import Plugin
from stagectl.recipe.model import ListedMarks
from stagectl.recipe.schema import PluginMark, SimulatedMark


def test_simulated_marks_depend_on_seed_and_site_only():
    finder = make_fiducial(SimulatedMark(80e-6, 1))
    first = [finder.find(site, (0.0, 0.0)) for site in range(1, 400)]
    assert [finder.find(site, (0.1, 0.0)) for site in reversed(range(1, 400))] == first[::-1]
    assert make_fiducial(SimulatedMark(80e-6, 2)).find(1, (0.0, 0.0)) != first[0]


def test_simulated_marks_fill_the_range_in_whole_nanometres():
    finder = make_fiducial(SimulatedMark(80e-6, 1))
    values = [v for s in range(1, 2001) for v in finder.find(s, (0.0, 0.0)) or ()]
    assert len(values) == 4000
    assert max(map(abs, values)) <= 80e-6
    assert max(values) > 79e-6
    assert min(values) < -79e-6
    # mean of a uniform distribution: 4 sigma of its estimate
    assert abs(sum(values) / 4000) < 4 * 80e-6 / 3**0.5 / 4000**0.5
    assert all(abs(v * 1e9 - round(v * 1e9)) < 1e-6 for v in values)


def test_no_marks_and_listed_marks():
    assert make_fiducial(NoMark()).find(1, (0.0, 0.0)) is None
    listed = make_fiducial(ListedMarks({2: (1e-6, -1e-6)}))
    assert listed.find(1, (0.0, 0.0)) is None
    assert listed.find(2, (0.0, 0.0)) == (1e-6, -1e-6)


def test_a_plugin_that_is_not_installed():
    with pytest.raises(ConfigError, match=r"fiducial plug-in 'no-such' is not installed"):
        make_fiducial(PluginMark("no-such"))


class Camera:
    """A plug-in that gives the answer it was made with, or fails."""

    def __init__(self, answer):
        self.answer = answer

    def find(self, site, position):
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer


def test_a_plugins_answers_are_passed_on():
    assert Plugin("cam", Camera(None)).find(1, (0.0, 0.0)) is None
    assert Plugin("cam", Camera([1, 2e-6])).find(1, (0.0, 0.0)) == (1.0, 2e-6)


@pytest.mark.parametrize("answer", [(1,), (1, 2, 3), "ab", (float("nan"), 0.0), 3, (None, 1)])
def test_an_answer_that_is_no_offset_is_a_fault(answer):
    with pytest.raises(RunFault, match=r"'cam': site 4: the answer is not an offset"):
        Plugin("cam", Camera(answer)).find(4, (0.0, 0.0))


def test_a_failing_plugin_is_a_fault_in_one_line():
    with pytest.raises(RunFault) as caught:
        Plugin("cam", Camera(OSError("no\nlight"))).find(4, (0.0, 0.0))
    assert str(caught.value) == "fiducial plug-in 'cam': site 4: OSError: no"
