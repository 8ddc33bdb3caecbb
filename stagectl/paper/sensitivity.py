"""Sensitivity of the two-window estimate to what the paper leaves open.

One choice at a time is changed in the given case.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from stagectl.paper import published
from stagectl.paper.fit import Fit
from stagectl.paper.signals import Alignment, Processing
from stagectl.paper.simulate import Profile
from stagectl.paper.tables import ALIGNMENTS, Case
from stagectl.paper.window import Options


@dataclass(frozen=True, slots=True)
class Row:
    """One choice and its estimate.

    Attributes:
        group: what was varied; choice: to what.
        fit: of two windows; None where there is none.
        problem: why there is none.
    """

    group: str
    choice: str
    fit: Fit | None
    problem: str = ""


def compute(case: Case, progress: Callable[[], None] = lambda: None) -> tuple[Row, ...]:
    """All rows; `progress` is called after each."""
    rows = []
    for group, choice, varied in variations(case):
        try:
            rows.append(Row(group, choice, varied().fit("two_windows")))
        except ValueError as error:
            rows.append(Row(group, choice, None, str(error)))
        progress()
    return tuple(rows)


def variations(case: Case) -> Iterator[tuple[str, str, Callable[[], Case]]]:
    """Group, choice, and a function that makes the case, for a choice may be impossible."""
    yield from _move(case)
    yield from _signals(case)
    yield from _zones(case)
    yield from _solver(case)


def _setup(case: Case, force: Alignment, **changes: object) -> Callable[[], Case]:
    def make() -> Case:
        setup = replace(case.setup, **changes)  # type: ignore[arg-type]
        return replace(case.with_force(force), setup=setup)

    return make


def _move(case: Case) -> Iterator[tuple[str, str, Callable[[], Case]]]:
    for force in ALIGNMENTS:
        for rate in (20_000, 10_000, 4_000, 1_000):
            yield "sample rate", f"{rate / 1e3:.0f} kHz, {force}", _setup(case, force, rate=rate)
    profiles: tuple[Profile, ...] = ("sine", "jerk-limited")
    for force in ALIGNMENTS:
        for profile in profiles:
            yield "profile", f"{profile}, {force}", _setup(case, force, profile=profile)
    for force in ALIGNMENTS:
        for bandwidth in (50.0, 100.0, 200.0):
            yield "gains", f"{bandwidth:.0f} Hz, {force}", _setup(case, force, bandwidth=bandwidth)
        choice = f"acceleration feedforward, {force}"
        yield "gains", choice, _setup(case, force, feedforward=True)


def _signals(case: Case) -> Iterator[tuple[str, str, Callable[[], Case]]]:
    def make(processing: Processing) -> Callable[[], Case]:
        return lambda: replace(case, processing=processing)

    for filtered in (True, False):
        for cut_off in (50.0, 100.0, 200.0, 500.0):
            processing = replace(case.processing, cut_off=cut_off, filter_force=filtered)
            words = "force too" if filtered else "force not"
            yield "filter", f"{cut_off:.0f} Hz, {words}", make(processing)
    yield "filter", "none", make(replace(case.processing, cut_off=None))
    for order in (1, 4):
        yield "filter", f"order {order}", make(replace(case.processing, order=order))


def _zones(case: Case) -> Iterator[tuple[str, str, Callable[[], Case]]]:
    def make(options: Options, **changes: float) -> Callable[[], Case]:
        borders = replace(case.borders, **changes)
        return lambda: replace(case, borders=borders, options=options)

    for onset in (1e-3, 2e-3, 3e-3, 6e-3):
        yield "start of zone A", f"{onset * 1e3:.0f} mm", make(case.options, onset=onset)
    for turned in (True, False):
        options = replace(case.options, turned=turned)
        words = "elements stick" if turned else "elements slip on"
        for shift in (-10e-3, -5e-3, -2e-3, -1e-3, 1e-3, 5e-3):
            if turned or shift < 0:
                choice = f"{shift * 1e3:+.0f} ms, {words}"
                yield "border of A and B", choice, make(options, shift=shift)
    for stick in (5e-3, 10e-3, 20e-3, 100e-3):
        yield "duration of zone B", f"{stick * 1e3:.0f} ms", make(case.options, stick=stick)


def _solver(case: Case) -> Iterator[tuple[str, str, Callable[[], Case]]]:
    def make(options: Options, force: Alignment) -> Callable[[], Case]:
        return lambda: replace(case.with_force(force), options=options)

    for force in ALIGNMENTS:
        yield "initial forces", f"tied, {force}", make(replace(case.options, initial="tied"), force)
        yield "initial forces", f"free, {force}", make(replace(case.options, initial="free"), force)
    used: Alignment = case.processing.force
    for factor in (0.1, 2.0, 3.0):
        start = {name: factor * value for name, value in published.REFERENCE.items()}
        yield "first iterate", f"{factor:g} times", make(replace(case.options, start=start), used)
    mixed = dict(zip(published.PARAMETERS, (1.0, 40.0, 3.0, 300.0), strict=True))
    choice = "Fc 0.5, C 10, sigma_v 3, sigma0 0.3 times"
    yield "first iterate", choice, make(replace(case.options, start=mixed), used)
    own = replace(case.options, jacobian="sensitivities")
    yield "derivatives", "of the model, not differences", make(own, used)
