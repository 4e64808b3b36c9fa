"""Warp's kernels are compiled here: those of a usual run together, on several threads.

Warp compiles a module when its first kernel is launched, one after the other, and keeps the code in its kernel cache.
"""

from __future__ import annotations

import pkgutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import warp as wp

from warpflat.core.activity import report_activity
from warpflat.core.errors import InputError, system_reason
from warpflat.core.memory_limit import is_out_of_memory
from warpflat.core.native_output import native_errors
from warpflat.core.threads import thread_count

__all__ = [
    "compile_all_modules",
    "compile_common_modules",
    "kernel_cache_errors",
    "launch_quietly",
    "quiet_warp",
    "start_warp",
]

# Modules that nearly every run needs. Those that take longest come first, so that no thread is left with one at the end.
_COMMON_MODULES = (
    "guard",
    "grid_lists",
    "coarsen",
    "cells",
    "stiffness",
    "geodesic",
    "strain",
    "implicit",
    "unfold",
    "curvature",
    "raster",
    "springs",
)
# Each thread first reads Warp's own headers, so that more threads gain nothing.
_MAX_THREADS = 4
# What the kernels and the compiler's temporary files need [bytes].
_REQUIRED_BYTES = 32 << 20

_is_started = False


def compile_common_modules(module: wp.Module, device: wp.Device) -> None:
    """Compile what a usual run needs, if `module` is part of that and not compiled yet.

    Args:
        module: the module of the kernel that is about to be launched.
        device: where; nothing is done for CUDA devices.

    Raises:
        InputError: something must be compiled, and the kernel cache cannot be written or has no room.
    """
    if device.is_cuda or _is_compiled(module):
        return
    package, _, name = module.name.rpartition(".")
    threads = min(thread_count(), _MAX_THREADS)
    with kernel_cache_errors():
        _require_room()
        if threads == 1 or name not in _COMMON_MODULES:
            return  # Warp compiles it by itself
        report_activity("compiling kernels, once on this machine")
        names = [f"{package}.{each}" for each in _COMMON_MODULES]
        for each in names:
            import_module(each)
        wp.force_load(device, [wp.get_module(each) for each in names], max_workers=threads)


def compile_all_modules() -> None:
    """Compile all kernels for the CPU that are not compiled yet, so that processes started later find them.

    Raises:
        InputError: the kernel cache cannot be written or has no room.
    """
    import warpflat.kernels

    start_warp()
    package = warpflat.kernels.__name__
    modules = [
        wp.get_module(import_module(f"{package}.{found.name}").__name__)
        for found in pkgutil.iter_modules(warpflat.kernels.__path__)
    ]
    with kernel_cache_errors():
        missing = [module for module in modules if module.kernels and not _is_compiled(module)]
        if missing:
            _require_room()
            report_activity("compiling kernels, once on this machine")
            wp.force_load("cpu", missing, max_workers=min(thread_count(), _MAX_THREADS))


def start_warp() -> None:
    """Initialise Warp, which makes the folder of its kernel cache; its greeting is left out, see :func:`quiet_warp`.

    That a machine has no CUDA driver is printed by Warp's native part straight to the file descriptor, whatever the log
    level; anything else that it says there is passed on.

    Raises:
        InputError: the folder cannot be made.
    """
    global _is_started
    if _is_started:
        return
    with native_errors() as lines, kernel_cache_errors():
        wp.init()
    _is_started = True
    for line in lines:
        if "Could not find or load the NVIDIA CUDA driver" not in line or wp.config.log_level < wp.LOG_INFO:
            print(line, file=sys.stderr)


@contextmanager
def quiet_warp() -> Iterator[None]:
    """Leave out Warp's greeting and its news of modules in the block, unless the user has set another log level than Warp's own."""
    if wp.config.log_level != wp.LOG_INFO:
        yield
        return
    wp.config.log_level = wp.LOG_WARNING
    try:
        yield
    finally:
        wp.config.log_level = wp.LOG_INFO


def launch_quietly(kernel: wp.Kernel, **arguments: Any) -> None:
    """Launch a kernel as ``wp.launch`` does, once; see :func:`kernel_cache_errors`."""
    start_warp()
    with kernel_cache_errors():
        wp.launch(kernel, **arguments)


@contextmanager
def kernel_cache_errors() -> Iterator[None]:
    """Let Warp load kernels quietly in the block, and report a file error as an error of the kernel cache.

    Raises:
        InputError: there was a file error.
    """
    try:
        with quiet_warp():
            yield
    except OSError as error:
        if is_out_of_memory(error):
            raise
        folder = wp.config.kernel_cache_dir or "of Warp"
        reason = system_reason(error)
        raise InputError(
            f"kernel cache {folder} cannot be written: {reason}; "
            f"set WARP_CACHE_PATH to a folder that can, with {_REQUIRED_BYTES >> 20} MB free"
        ) from error


def _require_room() -> None:
    """Write a probe file: on a full disk the compiler would end the process."""
    for folder in (wp.config.kernel_cache_dir, None):  # None is the system's folder for temporary files
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(bytes(_REQUIRED_BYTES))
            probe.flush()


def _is_compiled(module: wp.Module) -> bool:
    """Return whether Warp's cache has the module's code for the CPU."""
    return (Path(wp.config.kernel_cache_dir) / module.get_module_identifier(1)).is_dir()
