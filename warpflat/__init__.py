"""warpflat: flat sewing patterns from 3D garment surfaces, by minimum strain energy on NVIDIA Warp.

>>> import warpflat
>>> result = warpflat.flatten(warpflat.read_surface("bodice.obj", units="m"), fabric="woven")
>>> warpflat.save_piece(result, "out")

Every name that a script needs is `warpflat.NAME`; it is loaded when it is first used.
"""

from __future__ import annotations

import os
import sys

from lazy_loader import attach_stub

from warpflat._version import __version__ as __version__

_HERE = os.path.dirname(os.path.abspath(__file__))


def _find_kernels() -> None:
    """Import the kernels of a checkout, which lie beside this folder; installed ones lie in it."""
    folder = os.path.join(os.path.dirname(_HERE), "kernels")
    if os.path.isdir(os.path.join(_HERE, "kernels")) or not os.path.isdir(folder):
        return
    from importlib.util import module_from_spec, spec_from_file_location

    spec = spec_from_file_location(
        "warpflat.kernels", os.path.join(folder, "__init__.py"), submodule_search_locations=[folder]
    )
    assert spec is not None
    assert spec.loader is not None
    kernels = module_from_spec(spec)
    sys.modules[spec.name] = kernels
    spec.loader.exec_module(kernels)
    globals()["kernels"] = kernels


_find_kernels()

# Names are loaded when first used, so that `import warpflat` and `warpflat --help` cost nothing.
__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
