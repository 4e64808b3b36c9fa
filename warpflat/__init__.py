"""warpflat: flat sewing patterns from 3D garment surfaces, by minimum strain energy on NVIDIA Warp.

>>> import warpflat
>>> result = warpflat.flatten("bodice.obj", units="m", fabric="woven")
>>> result.save("out")
"""

from __future__ import annotations

import os

from warpflat._version import __version__

TYPE_CHECKING = False  # that of typing, whose import would take longer than this whole file

if TYPE_CHECKING:
    from typing import Any

    from warpflat.batch import flatten_all
    from warpflat.edits import change_fabric, change_surface
    from warpflat.errors import InputError
    from warpflat.fabric import Fabric, find_fabric, load_library
    from warpflat.flattening import Flattening, Progress, flatten
    from warpflat.relax import RelaxOptions
    from warpflat.surface import Surface, make_surface, read_surface

_here = os.path.dirname(os.path.abspath(__file__))
_root = os.path.dirname(_here)
if not os.path.isdir(os.path.join(_here, "kernels")) and os.path.isdir(os.path.join(_root, "kernels")):
    # Imported from a checkout's root, where the kernels lie beside this folder and not in it.
    __path__.append(_root)

_HOME = {
    "Fabric": "fabric",
    "Flattening": "flattening",
    "InputError": "errors",
    "Progress": "flattening",
    "RelaxOptions": "relax",
    "Surface": "surface",
    "change_fabric": "edits",
    "change_surface": "edits",
    "find_fabric": "fabric",
    "flatten": "flattening",
    "flatten_all": "batch",
    "load_library": "fabric",
    "make_surface": "surface",
    "read_surface": "surface",
}

__all__ = [
    "Fabric",
    "Flattening",
    "InputError",
    "Progress",
    "RelaxOptions",
    "Surface",
    "__version__",
    "change_fabric",
    "change_surface",
    "find_fabric",
    "flatten",
    "flatten_all",
    "load_library",
    "make_surface",
    "read_surface",
]


def __getattr__(name: str) -> Any:
    # Names are loaded when first used, so that `import warpflat` and `warpflat --help` cost nothing.
    if name not in _HOME:
        raise AttributeError(f"module 'warpflat' has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f"warpflat.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
