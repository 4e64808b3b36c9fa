"""The same kernels for CUDA devices: compiled to PTX, which takes Warp's own compiler and no GPU."""

from __future__ import annotations

import pkgutil
from importlib import import_module
from pathlib import Path

import pytest
import warp as wp
import warpflat.kernels

# Device functions alone are compiled with the kernels that call them.
FUNCTIONS = {"indices", "membrane_cell"}
MODULES = sorted({module.name for module in pkgutil.iter_modules(warpflat.kernels.__path__)} - FUNCTIONS)


@pytest.mark.parametrize("name", MODULES)
def test_kernels_compile_for_cuda(name: str, tmp_path: Path):
    wp.init()
    if not wp.get_cuda_supported_archs():
        pytest.skip("this build of Warp has no compiler for CUDA")
    module = import_module(f"warpflat.kernels.{name}")
    kernels = [kernel for kernel in vars(module).values() if isinstance(kernel, wp.Kernel)]
    # What a module imports belongs to another one.
    own = [kernel.key for kernel in kernels if kernel.module.name == module.__name__]
    assert own
    wp.compile_aot_module(module, arch=min(wp.get_cuda_supported_archs()), module_dir=tmp_path, use_ptx=True)
    (ptx,) = tmp_path.glob("*.ptx")
    text = ptx.read_text()
    for key in own:
        assert f"{key}_" in text, key
