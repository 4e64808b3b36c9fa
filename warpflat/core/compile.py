"""Kernels are compiled when they are first needed, once on a machine: here those of a usual run together, on all cores.

Module after module takes seven seconds, on two cores at once less than five.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

import warp as wp

from warpflat.core.activity import doing
from warpflat.core.errors import InputError
from warpflat.core.memory_limit import is_out_of_memory
from warpflat.core.threads import thread_count

__all__ = ["compile_usual", "start_warp", "writing_kernels"]

# Modules that nearly every run needs, those that take longest first; what it writes in the end, too.
_USUAL = (
    "grid_lists",
    "coarsen",
    "cells",
    "stiffness",
    "geodesic",
    "strain",
    "implicit",
    "unfold",
    "curvature",
    "cubic_interpolation",
    "line_solve",
    "raster",
    "prolongation",
    "reduce",
    "springs",
)
# Each thread reads Warp's own headers first, which takes a second: more would not gain by it.
_MOST_THREADS = 4
# All kernels take a tenth of it, the compiler's own files the rest for the time being [bytes].
_ROOM = 32 << 20


def compile_usual(module: wp.Module, device: wp.Device) -> None:
    """Compile what a usual run needs, before the first kernel of it that is not compiled yet; nothing if all is.

    Args:
        module: of the kernel that is about to be run.
        device: on which; for CUDA devices nothing is done.

    Raises:
        InputError: something must be compiled, and the kernel cache cannot be written or has no room.
    """
    if device.is_cuda or _is_compiled(module):
        return
    package, _, name = module.name.rpartition(".")
    threads = min(thread_count(), _MOST_THREADS)
    with writing_kernels():
        _require_room()
        if threads == 1 or name not in _USUAL:
            return
        doing("compiling kernels, once on this machine")
        for each in _USUAL:
            import_module(f"{package}.{each}")
        missing = [own for own in (wp.get_module(f"{package}.{each}") for each in _USUAL) if not _is_compiled(own)]
        wp.force_load(device, missing, block_dim=1, max_workers=threads)


def start_warp() -> None:
    """Start Warp, if nobody has; it makes the folder of its kernel cache then.

    Raises:
        InputError: that cannot be made.
    """
    with writing_kernels():
        wp.init()


@contextmanager
def writing_kernels() -> Iterator[None]:
    """Have a file error in the body told as one of the kernel cache.

    Raises:
        InputError: there was one.
    """
    try:
        yield
    except OSError as error:
        if is_out_of_memory(error):
            raise
        folder = wp.config.kernel_cache_dir or "of Warp"
        reason = (error.strerror or str(error)).lower()
        raise InputError(
            f"kernel cache {folder} cannot be written: {reason}; set WARP_CACHE_PATH to a folder that can, with {_ROOM >> 20} MB free"
        ) from error


def _require_room() -> None:
    """See that compiled kernels can be written: where a disk is full the compiler would end the process."""
    for folder in (wp.config.kernel_cache_dir, None):  # None: where temporary files are, for the compiler's own
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(bytes(_ROOM))
            probe.flush()


def _is_compiled(module: wp.Module) -> bool:
    """Whether Warp has the module's code for the CPU."""
    return (Path(wp.config.kernel_cache_dir) / module.get_module_identifier(1)).is_dir()
