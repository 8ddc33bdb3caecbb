"""The processor that kernels are compiled for: chosen before numba compiles, unless a user has."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys

import llvmlite.binding as llvm
import pytest

from stagedata.compiled.target import level_of

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


def test_this_process_compiles_for_the_level_of_its_processor() -> None:
    level = level_of(platform.machine(), llvm.get_host_cpu_features())
    assert chosen() == [level, None if level is None else ""]


V3 = dict.fromkeys(("avx2", "fma", "bmi", "bmi2", "f16c", "lzcnt", "movbe"), True)


@pytest.mark.parametrize(
    ("family", "features", "level"),
    [
        ("x86_64", V3, "x86-64-v3"),
        ("x86_64", V3 | {"avx512f": True, "amx-tile": True}, "x86-64-v3"),  # not more than that
        ("x86_64", V3 | {"movbe": False}, None),
        ("x86_64", {}, None),
        ("aarch64", {"sve": True}, "generic"),
        ("riscv64", {}, None),
    ],
)
def test_the_level_is_one_that_the_processor_can_run(
    family: str, features: dict[str, bool], level: str | None
) -> None:
    assert level_of(family, features) == level


def test_what_the_user_has_chosen_stays() -> None:
    assert chosen(NUMBA_CPU_NAME="generic")[0] == "generic"
    assert chosen(NUMBA_CPU_FEATURES="+sse4.2")[1] == "+sse4.2"
