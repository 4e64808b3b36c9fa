"""USD files are read in a process of their own, whose memory and time are limited.

USD trusts what it reads. A damaged file of 2 kB can make it take 8 GB of memory, print lines of its own, or crash its process.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from pathlib import Path

from warpflat.core.errors import InputError
from warpflat.core.input_files import note_read
from warpflat.surface.io.usd_stage import UNREADABLE, UsdMesh

# The modules of `warpflat.surface` would bring Warp with them, which takes a second to load.
_PROGRAM = "from warpflat.surface.io.usd_stage import answer; answer()"


def read_usd(path: Path, *, prim: str | None = None, metres_per_unit: float | None = None) -> UsdMesh:
    """Read one mesh prim of a USD file, in a process of its own.

    Args:
        path: .usd, .usda, .usdc or .usdz.
        prim: the path of the mesh prim, or its name where that is unique; needed if there are several.
        metres_per_unit: overrides what the stage says.

    Raises:
        InputError: without the file's name: if the file is no stage, or there is no such mesh.
        OSError: it cannot be opened.
    """
    with path.open("rb"):
        pass  # USD would not say why it cannot be opened
    environment = {
        # Its threads would take address space, which is what the limit counts.
        "PXR_WORK_THREAD_LIMIT": "1",
        # No modules are looked for in the folder that we are in.
        "PYTHONSAFEPATH": "1",
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }
    done = subprocess.run(
        [sys.executable, "-c", _PROGRAM],
        input=pickle.dumps((path.absolute(), prim, metres_per_unit)),
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=os.environ | environment,
        check=False,
    )
    if done.returncode != 0:
        raise InputError(UNREADABLE)
    result = pickle.loads(done.stdout)
    if isinstance(result, str):
        raise InputError(result)
    assert isinstance(result, UsdMesh)
    for layer in result.layers:
        note_read(layer)
    return result
