"""Jobs are done once each, by workers that die, fail and vanish."""

import logging
import os
import signal
import time
from contextlib import contextmanager, nullcontext
from pathlib import Path

import dask
import pytest
from distributed import Client, Future, LocalCluster

from stagectl.fleet.schedule import cluster_at, local_cluster, outcomes
from stagectl.fleet.task import Done


def done(job):
    return Done(job.url, job.stamp, "content", "result", False, None)


def take_time(job):
    time.sleep(0.1)
    return done(job)


def note(job):
    """Each try leaves a line; returns how many there are."""
    path = Path(job.out) / f"{job.url}.tries"
    path.parent.mkdir(exist_ok=True)
    with path.open("a") as file:
        file.write("x")
    return path.stat().st_size


def fail_at_first(job):
    if note(job) < (9 if job.url == "always" else 3):
        raise ValueError(f"{job.url} is\nodd")
    return done(job)


def die_at_first(job):
    if job.url.startswith("die") and note(job) < (99 if job.url == "die always" else 3):
        os.kill(os.getpid(), signal.SIGKILL)
    return done(job)


@contextmanager
def threads():
    """Workers without processes."""
    with (
        LocalCluster(
            n_workers=2, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0",
            silence_logs=logging.CRITICAL,
        ) as cluster,
        Client(cluster) as client,
    ):  # fmt: skip
        yield client


def run(jobs, connect, work):
    return {of.job.url: of for of in outcomes(jobs, connect, work=work)}


def test_a_diagnosis_that_fails_is_tried_three_times_and_stops_no_other(job):
    jobs = [job(name) for name in ("a", "always", "b")]
    ended = run(jobs, threads, fail_at_first)
    assert ended["a"].done == done(jobs[0])
    assert ended["b"].done == done(jobs[2])
    assert ended["always"].done is None
    assert ended["always"].failure == "failed 3 times: ValueError: always is odd"
    assert (Path(jobs[0].out) / "always.tries").stat().st_size == 3


@pytest.mark.slow
def test_a_worker_that_dies_costs_nothing_and_one_recording_cannot_kill_for_ever(job):
    jobs = [job(name) for name in ("a", "die", "die always", "b", "c")]
    with dask.config.set({"distributed.scheduler.allowed-failures": 1}):  # each takes seconds
        ended = run(jobs, lambda: local_cluster(2), die_at_first)
    assert {name for name, of in ended.items() if of.done is None} == {"die always"}
    assert "its worker dies" in ended["die always"].failure


def test_another_scheduler_gets_what_a_lost_one_has_not_finished(job):
    jobs = [job(str(number)) for number in range(6)]
    clusters = []

    @contextmanager
    def connect():
        with threads() as client:
            clusters.append(client)
            yield client

    said, ended = [], []
    for outcome in outcomes(jobs, connect, said.append, work=take_time):
        assert outcome.done == done(outcome.job)
        ended.append(outcome.job.url)
        if len(ended) == 1:
            held = [Future(key, clusters[0]) for key in clusters[0].futures]
            clusters[0].cancel(held)  # as a lost connection does
    assert sorted(ended) == [of.url for of in jobs]
    assert len(clusters) == 2
    assert said == ["the scheduler was lost: waiting for one"]


class Resetting:
    """A client whose scheduler is gone when an answer is asked for, and the future of that."""

    status, key = "finished", ""

    def nthreads(self):
        return {"worker": 1}

    def submit(self, work, job, key, **_):
        self.key = key
        return self

    def add_done_callback(self, call):
        call(self)

    def result(self, timeout):
        raise ConnectionResetError(104, "Connection reset by peer")


def test_a_scheduler_that_is_lost_with_an_answer_on_its_way_costs_no_recording(job):
    jobs = [job("a"), job("b")]
    connections = iter([lambda: nullcontext(Resetting()), threads])
    ended = run(jobs, lambda: next(connections)(), done)
    assert {name: of.done for name, of in ended.items()} == {of.url: done(of) for of in jobs}


def test_workers_keep_no_profile_while_they_diagnose():
    def profiled(dask_worker):
        return sorted(set(dask_worker.periodic_callbacks) & {"profile", "profile-cycle"})

    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0",
        silence_logs=logging.CRITICAL,
    ) as cluster:  # fmt: skip
        with cluster_at(cluster.scheduler_address) as client:
            assert list(client.run(profiled).values()) == [[]]
        with Client(cluster) as client:
            assert list(client.run(profiled).values()) == [["profile", "profile-cycle"]]
