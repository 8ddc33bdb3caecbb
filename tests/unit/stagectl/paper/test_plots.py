"""The paper's figures as plots."""

import xml.etree.ElementTree as ET

import pytest

from stagectl.paper import plots

SVG = "{http://www.w3.org/2000/svg}"


@pytest.mark.parametrize("plot", [plots.move, plots.zones])
def test_plots_are_xml(quick, plot):
    root = ET.fromstring(plot(quick))  # noqa: S314
    assert len(root.findall(f"{SVG}polyline")) >= 4
