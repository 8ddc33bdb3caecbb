"""What importing settings of the simulator costs."""

import subprocess
import sys


def test_settings_load_neither_numba_nor_can():
    code = (
        "import sys, hil_sim.settings\n"
        "print([m for m in ('numba', 'can', 'canopen') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
