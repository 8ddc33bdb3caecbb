"""Charts as inline SVG."""

import numpy as np

from stagectl.report.gap.charts import Curve, bars, chart, matrix


def test_empty_flat_missing_and_long_data_can_be_drawn():
    assert "Nothing to draw" in chart([], "x", "y")
    flat = chart([Curve("before", np.arange(3.0), np.zeros(3))], "x", "y <z>")
    assert "y &lt;z&gt;" in flat
    assert "nan" not in flat
    gone = np.array([np.nan, -1.0, 0.0, 1.0, 10.0])
    assert "nan" not in chart([Curve("after", gone, gone)], "x", "y", log="xy")
    long = chart([Curve("measured", np.arange(1e5), np.sin(np.arange(1e5)))], "x", "y")
    assert len(long) < 40_000
    assert "nan" not in bars(["rest", "micro"], {"before": [1.0, np.nan], "after": [0.0, 0.0]}, "y")
    assert matrix(["a", "b"], {("a", "b"): 0.25}).count("0.25") >= 2
