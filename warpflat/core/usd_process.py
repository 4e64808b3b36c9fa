"""USD files of others are read in a process of their own, whose memory and time are limited.

USD trusts what it reads. A damaged file of 2 kB can make it take 8 GB of memory, print lines of its own, or crash its process.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from warpflat.core.errors import InputError
from warpflat.core.memory_limit import require_memory_for_usd

__all__ = ["UNREADABLE", "allow_size", "answer", "read_apart"]

UNREADABLE = (
    "not a readable USD file: damaged, cut short, or with values of another type than its schema's; write it again"
)

# Memory that reading may take beside the library's own, and more per byte of the file, since lists of corners pack tightly [bytes].
_MEMORY, _MEMORY_PER_BYTE = 2**30, 200
# Of the processor; the clock may show more, where others compute, but a pipe that the file names must not be waited for.
_SECONDS, _BYTES_PER_SECOND, _WAITING = 20, 10**6, 20
# Memory that the process of a file had before it read anything [bytes]; None in any other process.
_taken: int | None = None
# Its limits before that, by their kind.
_before: dict[int, int] = {}
_PROGRAM = "from warpflat.core.usd_process import answer; answer()"


def read_apart(function: str, path: Path, **arguments: Any) -> Any:
    """Call a function with the path of a USD file in a process of its own.

    Args:
        function: "module:name"; what the module imports, the process loads.
        path: of the file, the function's first argument.
        arguments: the others.

    Raises:
        InputError: without the file's name: the function has raised one, or the process has not ended well.
        OSError: the file cannot be opened.
    """
    with path.open("rb"):
        pass  # USD would not say why it cannot be opened
    size = path.stat().st_size
    environment = {
        # Its threads would take address space, which is what the limit counts.
        "PXR_WORK_THREAD_LIMIT": "1",
        # No modules are looked for in the folder that we are in.
        "PYTHONSAFEPATH": "1",
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }
    try:
        done = subprocess.run(
            [sys.executable, "-c", _PROGRAM],
            input=pickle.dumps((function, path.absolute(), arguments)),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ | environment,
            timeout=_WAITING * (_SECONDS + size / _BYTES_PER_SECOND),
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise InputError(UNREADABLE) from None
    if done.returncode != 0:
        raise InputError(UNREADABLE)
    good, result = pickle.loads(done.stdout)
    if not good:
        raise InputError(result)
    return result


def allow_size(size: int) -> None:
    """Limit the memory and the time of a process that reads a file by what it reads [bytes]; of any other process nothing."""
    if _taken is None:
        return
    import resource

    for kind, most in (
        (resource.RLIMIT_AS, _taken + _MEMORY + _MEMORY_PER_BYTE * size),
        (resource.RLIMIT_CPU, _SECONDS + size // _BYTES_PER_SECOND),
    ):
        hard = resource.getrlimit(kind)[1]
        least = min(limit for limit in (most, _before[kind], hard) if limit != resource.RLIM_INFINITY)
        resource.setrlimit(kind, (least, hard))


def answer() -> None:
    """Call the function named on standard input, and write what it returns, or the words of an error, to standard output."""
    # Other output of the library must not mix with the result.
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    function, path, arguments = pickle.load(sys.stdin.buffer)
    module, _, name = function.partition(":")
    try:
        require_memory_for_usd()
        from pxr import UsdGeom, UsdUtils  # noqa: F401, as the limit counts what comes after it

        call, size = getattr(import_module(module), name), path.stat().st_size
        if sys.platform == "linux":
            import resource

            global _taken
            _taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            _before.update({kind: resource.getrlimit(kind)[0] for kind in (resource.RLIMIT_AS, resource.RLIMIT_CPU)})
            allow_size(size)
        result = True, call(path, **arguments)
    except InputError as error:
        result = False, str(error)
    pickle.dump(result, out, protocol=pickle.HIGHEST_PROTOCOL)
    out.close()
    os._exit(0)  # USD and Python would clear their memory for a fifth of a second
