"""The layers of which a USD stage is composed, checked as the file itself is before any of them is composed.

The process that reads a file calls this: see :mod:`warpflat.core.usd_process`.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Any

from warpflat.core.errors import InputError
from warpflat.core.input_files import FORMATS, check_regular
from warpflat.core.text import quote_value
from warpflat.core.usd_process import allow_size

__all__ = ["check_layers"]

# What makes one file of many.
_FLATTEN = "save the stage as one file, as with: usdcat --flatten in.usda --out out.usdc"


def check_layers(path: Path) -> None:
    """Check all layers to which a stage refers by sublayers, references and payloads, in all variants.

    Each must be a regular file in the folder of the stage or below, all together no larger than one file may be, and readable.

    Raises:
        InputError: one is not, is missing, or cannot be told: names the layer that refers to it.
    """
    from pxr import Ar, Sdf, Tf

    folder, total = os.path.realpath(path.parent), path.stat().st_size
    todo, seen, files = list[Any](), {str(path)}, {os.path.realpath(path)}
    # Whoever opens the file itself says what is wrong with it.
    with suppress(Tf.ErrorException):
        todo = list(filter(None, [Sdf.Layer.FindOrOpen(str(path))]))
    while todo:
        layer = todo.pop()
        name = os.path.basename(layer.realPath) or path.name
        paths = list[Any]()
        layer.Traverse("/", paths.append)
        prims = [layer.GetPrimAtPath(at) for at in paths if at.IsPrimPath()]
        clips = [prim.path for prim in prims if prim and prim.HasInfo("clips")]
        if clips:
            raise InputError(f"{name}: {clips[0]} takes its values from clips, which are not read; {_FLATTEN}")
        for asset in layer.GetCompositionAssetDependencies():
            if not asset:  # within the layer
                continue
            where = f"{name} refers to {quote_value(asset)}"
            if asset.startswith("`"):
                raise InputError(f"{where}, which is an expression; {_FLATTEN}")
            full = Sdf.ComputeAssetPathRelativeToLayer(layer, asset)
            file = Ar.SplitPackageRelativePathOuter(full)[0] if Ar.IsPackageRelativePath(full) else full
            # What is not beside the layer would be looked for elsewhere.
            file = os.path.realpath(os.path.join(os.path.dirname(layer.realPath), file))
            if full in seen:
                continue
            seen.add(full)
            if os.path.commonpath([folder, file]) != folder:
                raise InputError(f"{where}, which lies outside its folder; put all parts beside it, or {_FLATTEN}")
            # Of a package each layer is a part, but it is one file.
            new = file not in files
            files.add(file)
            try:
                check_regular(Path(file), FORMATS["mesh"].most - new * total)
            except FileNotFoundError:
                raise InputError(f"{where}, which is missing; put all parts beside it, or {_FLATTEN}") from None
            except InputError as error:
                raise InputError(f"{where}, which {error}") from None
            total += new * os.path.getsize(file)
            allow_size(total)
            found = None
            with suppress(Tf.ErrorException):
                found = Sdf.Layer.FindOrOpen(full) if Ar.GetResolver().Resolve(full) else None
            if not found:
                raise InputError(f"{where}, which is no readable USD file; put all parts beside it, or {_FLATTEN}")
            todo.append(found)
