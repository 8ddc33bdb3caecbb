"""Threads that fits share."""

from __future__ import annotations

import threading
import time

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from sim2real.fitting.workers import Stopped, Workers


@pytest.mark.parametrize("jobs", [1, 2])
def test_map_keeps_the_order_and_may_be_nested(jobs):
    with Workers(jobs) as workers:

        def row(i):
            return workers.map(lambda j: 10 * i + j, range(3))

        assert workers.map(row, range(5)) == [[10 * i + j for j in range(3)] for i in range(5)]


@pytest.mark.parametrize(
    ("jobs", "count", "most", "parts"),
    [(1, 7, 4, [3, 4]), (2, 7, 8, [3, 4]), (2, 1, 8, [1]), (2, 0, 8, []), (2, 12, 4, [4, 4, 4])],
)
def test_items_are_spread_over_all_threads(jobs, count, most, parts):
    sizes = []

    def doubled(items):
        sizes.append(len(items))
        return [2 * item for item in items]

    with Workers(jobs) as workers:
        assert workers.spread(doubled, range(count), most) == [2 * i for i in range(count)]
    assert sorted(sizes) == parts


def test_two_tasks_run_at_the_same_time():
    both = threading.Barrier(2, timeout=20.0)
    with Workers(2) as workers:
        assert sorted(workers.map(lambda _: both.wait(), range(2))) == [0, 1]


def test_an_error_of_a_task_comes_out():
    with Workers(2) as workers, pytest.raises(ZeroDivisionError):
        workers.map(lambda i: 1 // i, range(3))


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_is_at_work_when_they_are_left_stops(jobs):
    begun, ends = threading.Event(), []

    def task():
        try:
            for _ in range(2000):
                begun.set()
                workers.map(time.sleep, [0.005, 0.005])
        except Stopped:
            ends.append("stopped")

    thread = threading.Thread(target=task)
    workers = Workers(jobs)

    def interrupted():
        with workers:
            thread.start()
            assert begun.wait(20.0)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    thread.join()
    assert ends == ["stopped"]
    with pytest.raises(Stopped):
        workers.check()


def test_linear_algebra_has_one_thread_while_fits_have_theirs():
    def threads():
        found = {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}
        assert found
        return found

    with threadpool_limits(2, user_api="blas"):
        with Workers():
            assert threads() == {1}
        assert threads() == {2}
