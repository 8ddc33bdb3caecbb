"""Counts calls, so that a test can say how work grows without a clock."""

import gc
import sys


def count_calls(function):
    """How many functions, those of C included, are called while `function` runs."""
    count = 0

    def on_event(frame, event, argument):
        nonlocal count
        count += event in ("call", "c_call")

    before, collects = sys.getprofile(), gc.isenabled()
    gc.disable()  # a collection calls those who watch it
    sys.setprofile(on_event)
    try:
        function()
    finally:
        sys.setprofile(before)
        if collects:
            gc.enable()
    return count
