"""How the kernels of this package are compiled: as all are, see `stagedata.compiled`."""

from stagedata.compiled import KernelByType, kernel, machine_code

__all__ = ["KernelByType", "kernel", "machine_code"]
