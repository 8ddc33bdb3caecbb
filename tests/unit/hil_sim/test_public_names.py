"""What `hil_sim` offers by name, and what importing it costs."""

import subprocess
import sys

import hil_sim


def test_every_public_name_can_be_imported():
    assert [name for name in hil_sim.__all__ if getattr(hil_sim, name, None) is None] == []


def test_settings_load_neither_numba_nor_can():
    code = (
        "import sys, hil_sim.settings\n"
        "print([m for m in ('numba', 'can', 'canopen') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
