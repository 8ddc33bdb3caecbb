"""The picture of the console in README and docs: `python tools/console_picture.py [--dark]`.

A run on the virtual stage, seen in Debian's Chromium. To be made while nothing else runs: late
SYNCs are counted in it.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import sync_playwright

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "console.png"
RECIPE = """\
recipe: wafer-7
macro: {velocity: 0.3, acceleration: 3.0, jerk: 300.0}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 2.0e-7, hold: 0.01, timeout: 0.5}
expose: 0.05
sites: {grid: {origin: [-0.1, -0.08], pitch: [0.04, 0.04], count: [6, 5]}}
fiducial: {source: simulated, range: 80.0e-6, seed: 1}
limits: {settling: 0.03}
lot: L7
"""


@contextmanager
def _console(folder: Path) -> Iterator[str]:
    """A console on the virtual stage; its address."""
    command = [sys.executable, "-m", "stagectl", "console", "--simulate", "--no-browser",
               "--port", "0", "--data", str(folder)]  # fmt: skip
    runtime = {"STAGECTL_RUNTIME": str(folder / "run")}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env=os.environ | runtime
    ) as console:
        try:
            yield console.stdout.readline().strip() if console.stdout else ""
        finally:
            console.send_signal(signal.SIGINT)


def main() -> None:
    """Make the picture."""
    parser = argparse.ArgumentParser(description=__doc__.partition(":")[0])
    parser.add_argument("--dark", action="store_true")
    parser.add_argument("--size", default="1366x860", help="of the window")
    parser.add_argument("--out", type=Path, default=PICTURE)
    asked = parser.parse_args()
    width, height = map(int, asked.size.split("x"))
    with tempfile.TemporaryDirectory() as name, _console(Path(name)) as address:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(
                executable_path="/usr/bin/chromium", args=["--no-sandbox"]
            )
            page = browser.new_page(
                viewport={"width": width, "height": height},
                color_scheme="dark" if asked.dark else "light",
            )
            page.set_default_timeout(60_000)
            page.add_init_script("localStorage.setItem('operator', 'Anna Berg')")
            page.goto(address)
            page.click("text=Take command")
            page.click("nav a[href='#run']")
            page.wait_for_selector(".gutter span:nth-child(5)")
            page.fill("#recipe", RECIPE)
            page.wait_for_selector("text=can be run")
            page.click("text=Queue and start")
            page.click("nav a[href='#live']")
            page.wait_for_selector(".now >> text=/: 2[2-6] of/")
            page.screenshot(path=asked.out)
            page.keyboard.press("Escape")
            page.click("nav a[href='#run']")
            page.wait_for_selector("text=Last run")  # else its server would go on
            browser.close()
    print(asked.out)


if __name__ == "__main__":
    main()
