"""How the kernels of all packages are compiled, and where they are kept.

- `kernels`: the decorator, and the processor they are compiled for;
- `libraries`: from kernels to machine code, one optimisation for each entry point;
- `cache`, `stamp`: kept on disk, judged by content.

Loads numba; nothing else of `stagedata` does.
"""

from stagedata.compiled.cache import SHIPPED, on_compiling, on_use
from stagedata.compiled.folder import kernel_folder
from stagedata.compiled.kernels import KernelByType, kernel, machine_code

__all__ = [
    "SHIPPED",
    "KernelByType",
    "kernel",
    "kernel_folder",
    "machine_code",
    "on_compiling",
    "on_use",
]
