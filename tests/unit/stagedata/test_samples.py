"""Samples as blocks: joined, cut, and made without any."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from stagedata import Samples


def counted(begin, count):
    found = Samples.missing(count, 2)
    return replace(found, time=np.arange(begin, begin + count) * 1e-3)


def test_missing_samples_are_invalid_and_say_nothing_of_their_arrival():
    nothing = Samples.missing(3, 2)
    assert (len(nothing), nothing.axes) == (3, 2)
    assert not nothing.valid.any()
    assert np.isnan(nothing.arrival).all()
    assert nothing.statusword.dtype == np.uint16
    assert nothing.extra.dtype == np.uint8


def test_blocks_joined_have_all_rows_of_every_field_in_order():
    whole = Samples.concatenate([counted(0, 2), counted(2, 3), counted(5, 1)])
    np.testing.assert_allclose(whole.time, np.arange(6) * 1e-3)
    assert {len(getattr(whole, f.name)) for f in fields(whole)} == {6}
    assert whole.valid.dtype == np.bool_
    one = counted(0, 2)
    assert Samples.concatenate([one]) is one


def test_the_tail_has_the_last_rows_or_all_of_them():
    whole = counted(0, 5)
    np.testing.assert_allclose(whole.tail(2).time, [3e-3, 4e-3])
    assert {len(getattr(whole.tail(2), f.name)) for f in fields(whole)} == {2}
    assert len(whole.tail(9)) == 5
    assert len(whole.tail(0)) == 0
