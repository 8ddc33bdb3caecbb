"""Counts calls, so that a test can say how work grows without a clock."""

import sys


def count_calls(function):
    """How many functions, those of C included, are called while `function` runs."""
    count = 0

    def on_event(frame, event, argument):
        nonlocal count
        count += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(on_event)
    try:
        function()
    finally:
        sys.setprofile(before)
    return count
