"""Kernels are compiled when they are first needed, once on a machine: here those of a usual run together, on all cores.

Module after module takes seven seconds, on two cores at once less than five.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import warp as wp

from warpflat.activity import doing
from warpflat.cores import thread_count

__all__ = ["compile_usual"]

# Modules that nearly every run needs, those that take longest first; what it writes in the end, too.
_USUAL = (
    "lattice",
    "coarsen",
    "cells",
    "stiffness",
    "geodesic",
    "strain",
    "implicit",
    "surface_cells",
    "curvature",
    "cubics",
    "thread_lines",
    "raster",
    "transfer",
    "sums",
    "springs",
)
# Each thread reads Warp's own headers first, which takes a second: more would not gain by it.
_MOST_THREADS = 4


def compile_usual(module: wp.Module, device: wp.Device) -> None:
    """Compile what a usual run needs, before the first kernel of it that is not compiled yet; nothing if all is.

    Args:
        module: of the kernel that is about to be run.
        device: on which; for CUDA devices nothing is done.
    """
    package, _, name = module.name.rpartition(".")
    threads = min(thread_count(), _MOST_THREADS)
    if device.is_cuda or threads == 1 or name not in _USUAL or _is_compiled(module):
        return
    doing("compiling kernels, once on this machine")
    for each in _USUAL:
        import_module(f"{package}.{each}")
    missing = [own for own in (wp.get_module(f"{package}.{each}") for each in _USUAL) if not _is_compiled(own)]
    wp.force_load(device, missing, block_dim=1, max_workers=threads)


def _is_compiled(module: wp.Module) -> bool:
    """Whether Warp has the module's code for the CPU."""
    return (Path(wp.config.kernel_cache_dir) / module.get_module_identifier(1)).is_dir()
