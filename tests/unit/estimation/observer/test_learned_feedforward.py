"""What of the forces that moves have lacked is fed forward: nothing without evidence."""

import numpy as np
import pytest

from estimation.observer import COUPLING, LEAD, MASS, LearnedFeedforward
from estimation.observer.feedforward_error import FeedforwardError

SIGMA = (0.005, 3e-5, 0.005)


def move(value, travel=0.025, sigma=SIGMA, rested=False):
    information = np.diag(np.power(sigma, -2.0))
    return FeedforwardError(np.array(value, dtype=float), information, travel, rested)


def there_and_back(number):
    return 0.025 * (-1) ** number


def test_what_moves_show_again_and_again_is_fed_forward():
    learned = LearnedFeedforward()
    truth = np.array([0.09, 0.0, 0.03])
    for k in range(6):
        wander = 1e-3 * (-1) ** k
        lacked = truth + np.array([wander, 0.0, wander]) - learned.fed
        learned.take(move(lacked, there_and_back(k)))
        if k == 0:
            assert not learned.fed.any(), "one move explains only itself"
    assert learned.fed == pytest.approx(truth, abs=2e-3)
    for k in range(20):
        learned.take(move(-learned.fed, there_and_back(k)))  # the payload is gone
    assert learned.fed == pytest.approx(np.zeros(3), abs=2e-3)


def test_one_group_of_moves_alone_is_no_evidence():
    """A force over position is the same in every move along one path, one way."""
    learned = LearnedFeedforward()
    for k in range(10):
        learned.take(move([0.09, 0.0, 0.0], 0.025 if k % 2 else 0.024))
        assert not learned.fed.any()
    learned.take(move([0.09, 0.0, 0.0], 0.05))
    assert learned.fed == pytest.approx([0.09, 0.0, 0.0], abs=2e-3)


def test_groups_that_disagree_are_no_evidence():
    learned = LearnedFeedforward()
    for k in range(10):
        learned.take(move([0.09 if k % 2 else 0.02, 0.0, 0.0] - learned.fed, there_and_back(k)))
    assert not learned.fed.any()


@pytest.mark.parametrize("share", [-0.33, 0.37, 1.0])
def test_a_mass_that_is_far_off_is_fed_forward_and_nothing_in_its_place(share):
    """Moves far from the model show a lead beside it, by the observer's wrong lag."""
    learned = LearnedFeedforward()
    for k in range(8):
        off = share - learned.fed[MASS]
        lacked = [off, 2.5e-3 * off - learned.fed[LEAD], -learned.fed[COUPLING]]
        learned.take(move(lacked, there_and_back(k), (0.01 + 0.1 * abs(off), 6e-4, 0.3)))
    assert learned.fed == pytest.approx([share, 0.0, 0.0], abs=5e-3)


def test_axes_that_accelerate_alike_decide_nothing_and_one_alone_does():
    """On a diagonal a mass and a coupling are the same; a move of one axis tells them apart."""
    both = np.array([[1.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 1.0]]) / 0.005**2
    both += np.diag([1.0, 1e6, 1.0])
    diagonal = [
        FeedforwardError(np.array([0.05, 0.0, 0.05]), both, t, False) for t in (0.05, -0.05)
    ]
    learned = LearnedFeedforward()
    for error in diagonal:
        learned.take(error)
    assert not learned.fed.any()
    learned.take(move([0.1, 0.0, 0.0], sigma=(0.005, 3e-5, 1.0)))
    assert learned.fed == pytest.approx([0.1, 0.0, 0.0], abs=3e-3)
    learned = LearnedFeedforward()
    learned.take(diagonal[0])
    learned.take(move([0.0, 0.0, 0.1], 0.05, (1.0, 1.0, 0.005), rested=True))
    assert learned.fed == pytest.approx([0.0, 0.0, 0.1], abs=3e-3)


def test_what_a_perfect_move_shows_is_not_fed_forward():
    learned = LearnedFeedforward()
    for k in range(20):
        learned.take(move(np.array([-2e-3, -5e-5, 0.0]) - learned.fed, there_and_back(k)))
    assert np.abs(learned.fed).max() < 3e-3


def test_what_differs_from_move_to_move_is_not():
    learned, random = LearnedFeedforward(), np.random.default_rng(5)
    for k in range(60):
        seen = random.normal(0.0, 1.0, 3) * [0.03, 2e-4, 0.03]
        learned.take(move(seen - learned.fed, there_and_back(k)))
        assert not learned.fed.any()


def test_an_agreement_of_uncertain_moves_is_not():
    learned = LearnedFeedforward()
    for k in range(3):  # coupling, where the other axis hardly moves
        learned.take(move((0.0, 0.0, 0.05), there_and_back(k), (0.005, 3e-5, 0.12)))
    assert learned.value[2] == pytest.approx(0.05, rel=0.2)
    np.testing.assert_array_equal(learned.fed, 0.0)


def test_nothing_is_fed_forward_beside_what_is_not_plausible():
    """A mass that is not there is something else, which may look like the others, too."""
    learned = LearnedFeedforward()
    for k in range(5):
        learned.take(move(np.array([-0.95, 5e-4, 0.4]) - learned.fed, there_and_back(k)))
        assert not learned.fed.any()
    learned = LearnedFeedforward()
    for k in range(5):
        learned.take(move(np.array([0.0, 5e-4, 0.0]) - learned.fed, there_and_back(k)))
    assert learned.fed == pytest.approx([0.0, 5e-4, 0.0], rel=0.01)


def test_thousands_of_moves_of_one_axis_alone():
    learned = LearnedFeedforward()
    alone = np.diag([4e4, 1e9, 0.0])
    for k in range(5000):
        value = np.array([0.05, 0.0, 0.0]) - learned.fed
        learned.take(FeedforwardError(value, alone, there_and_back(k), False))
    assert learned.fed == pytest.approx([0.05, 0.0, 0.0], abs=1e-5)
