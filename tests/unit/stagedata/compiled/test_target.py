"""The processor that kernels are compiled for: chosen before numba compiles, unless a user has."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import llvmlite.binding as llvm
import pytest

SHOW = (
    "import json, os; from stagedata.compiled.target import choose_processor; choose_processor();"
    "import numba; print(json.dumps([numba.config.CPU_NAME, numba.config.CPU_FEATURES]))"
)


def chosen(**environment: str) -> list[str | None]:
    clean = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_CPU")}
    done = subprocess.run(
        [sys.executable, "-c", SHOW], env=clean | environment, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    return json.loads(done.stdout)  # type: ignore[no-any-return]


def test_a_level_of_the_family_not_this_very_machine() -> None:
    has = llvm.get_host_cpu_features()
    if not all(has.get(name) for name in ("avx2", "fma", "bmi2", "movbe")):
        pytest.skip("this processor is of another family, or older than x86-64-v3")
    assert chosen() == ["x86-64-v3", ""]


def test_what_the_user_has_chosen_stays() -> None:
    assert chosen(NUMBA_CPU_NAME="generic")[0] == "generic"
    assert chosen(NUMBA_CPU_FEATURES="+sse4.2")[1] == "+sse4.2"
