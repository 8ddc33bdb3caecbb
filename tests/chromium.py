"""Debian's Chromium for tests of pages: skipped where it is missing, required where CI says so."""

import os
from contextlib import contextmanager
from pathlib import Path

import pytest

REQUIRED = "STAGECTL_REQUIRE_CHROMIUM"
EXECUTABLE = Path("/usr/bin/chromium")


@contextmanager
def chromium():
    """A browser without a window."""
    if not EXECUTABLE.exists():
        if os.environ.get(REQUIRED):
            pytest.fail(f"{EXECUTABLE} is missing, and {REQUIRED} is set")
        pytest.skip(f"{EXECUTABLE} is missing")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(EXECUTABLE), args=["--no-sandbox"])
        try:
            yield browser
        finally:
            browser.close()
