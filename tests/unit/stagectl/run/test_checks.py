"""What is checked before a run, and what that takes."""

import subprocess
import sys

_LOADED = """
import sys
from stagectl.cli import main
try:
    main()
finally:
    sys.stderr.write(" ".join({"numba", "scipy", "h5py"} & set(sys.modules)))
"""


def test_a_dry_run_loads_neither_kernels_nor_stores(tmp_path):
    words = ["run", "inspection-20", "--simulate", "--dry-run", "--out", str(tmp_path / "run")]
    done = subprocess.run(
        [sys.executable, "-c", _LOADED, *words], capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    assert "20 macro, 20 micro" in done.stdout
    assert not (tmp_path / "run").exists()
