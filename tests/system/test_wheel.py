"""A wheel holds all that the README's first run needs, compiled kernels included."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_the_readmes_first_run_from_a_wheel_in_any_folder_compiles_nothing(tmp_path):
    pytest.importorskip("hatchling")
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    built, site, anywhere = (tmp_path / name for name in ("built", "site", "anywhere"))
    wheel = ["wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", built, ROOT]
    subprocess.run([*pip, *wheel], check=True)
    (file,) = built.glob("*.whl")
    tag = f"cp{sys.version_info.major}{sys.version_info.minor}"
    assert f"-{tag}-{tag}-" in file.name
    subprocess.run([*pip, "install", "--no-deps", "--target", site, file], check=True)
    anywhere.mkdir()
    done = subprocess.run(
        [sys.executable, "-m", "stagectl", "run", "recipes/inspection-20.yaml", "--simulate"],
        cwd=anywhere, text=True, capture_output=True, check=False,
        env=os.environ | {"PYTHONPATH": str(site), "NUMBA_CACHE_DIR": str(tmp_path / "cache")},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "20 sites" in done.stdout
    assert len(list(anywhere.glob("runs/*/report.html"))) == 1
    assert list((site / "stagedata" / "compiled" / "shipped").glob("*.kernel"))
    assert not list((tmp_path / "cache").rglob("*.kernel"))
