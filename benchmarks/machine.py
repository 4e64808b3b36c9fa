"""What the machine can do and what a run takes of it: the speed of a copy, bytes of a step, peak memory."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warpflat.flat.model.network import SpringNetwork

if TYPE_CHECKING:
    from meshes import Mesh


def copy_speed(threads: int, *, size: int = 64 * 2**20) -> float:
    """Bytes per second, read and written, of copies of `size` bytes on so many threads at once; the best of several."""
    pairs = [(np.ones(size // 8), np.zeros(size // 8)) for _ in range(threads)]
    best = 0.0
    for _ in range(5):
        workers = [threading.Thread(target=np.copyto, args=(to, source)) for source, to in pairs]
        begun = time.perf_counter()
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
        best = max(best, 2.0 * threads * size / (time.perf_counter() - begun))
    return best


def _arrays(value: Any) -> list[wp.array]:
    """Warp arrays in the fields of an object and of the Warp structs among them."""
    found = []
    for entry in vars(value).values():
        if isinstance(entry, wp.array):
            found.append(entry)
        elif hasattr(type(entry), "vars") or hasattr(entry, "_cls"):
            names = entry._cls.vars if hasattr(entry, "_cls") else type(entry).vars
            found += [a for a in (getattr(entry, key, None) for key in names) if isinstance(a, wp.array)]
    return found


def buffer_bytes(network: SpringNetwork) -> float:
    """Bytes of a network's arrays on its device."""
    return float(sum(array.size * wp.types.type_size_in_bytes(array.dtype) for array in _arrays(network)))


def step_bytes(network: SpringNetwork) -> float:
    """Bytes that one approximate implicit step of a cycle has to move if every array it reads or writes is moved once.

    All cells are looked at before every fourth. (Places and velocities of neighbours are gathered several times; what the
    caches do not hold of that comes on top.)
    """
    v, f, c, s = network.vertex_count, network.face_count, network.cell_count, network.spring_count
    look = c * 24 + f * (16 + 4 + 4 + 8) + v * 32  # laid; corners, first, acting, clearance; places, velocities
    look += len(network.cell_arrays.around.entry) * 4 + f * (4 + 8) + v * (16 + 8 + 4)  # slots, what faces say; reach
    gather = v * (16 + 16 + 8 + 8 + 4 + 4 + 16 + 16) + 2 * s * (4 + 8 + 8)
    gather += v * (16 + 8 + 16 + 16 + 8)
    advance = v * (8 + 4 + 16 + 16 + 16 + 8 + 16 + 8) + 2 * s * (4 + 8) + v * 2 * 32
    return float(0.25 * look + gather + advance)


_CHILD = """
import pickle, sys, time
sys.path.insert(0, sys.argv[1])
import speed, warpflat
warm, mesh, name, repeats = pickle.load(sys.stdin.buffer)
def status(key):
    for line in open("/proc/self/status"):
        if line.startswith(key):
            return 1024 * int(line.split()[1])
def flatten(surface, datum):
    return warpflat.flatten(surface, fabric=speed.CLOTH, datum=datum, device="cpu", **speed.OURS[name])
flatten(*warm)
surface, datum = pickle.loads(mesh)
before, taken = status("VmRSS"), []
open("/proc/self/clear_refs", "w").write("5")
for _ in range(repeats):
    begun = time.process_time()
    flat = flatten(surface, datum)
    taken.append(time.process_time() - begun)
    if len(taken) == 1:
        most = status("VmHWM") - before
    del flat
    surface, datum = pickle.loads(mesh)
print(most, min(taken))
"""


def memory_of_flatten(mesh: Mesh, solver: str) -> float:
    """Bytes by which `warpflat.flatten` raises the peak memory of a fresh process (Linux), kernels already loaded."""
    return cost_of_flatten(mesh, solver)[0]


def cost_of_flatten(mesh: Mesh, solver: str, *, warm: Mesh | None = None, repeats: int = 1) -> tuple[float, float]:
    """Return what `warpflat.flatten` takes in a fresh process (Linux): growth of its peak memory [bytes], processor time [s].

    Args:
        mesh: it is flattened `repeats` times, from copies of which nothing is known; the fastest counts.
        solver: a name of `speed.OURS`.
        warm: flattened before, so that kernels are loaded; a small irregular dome by default.
    """
    from meshes import KINDS

    warm = warm or KINDS["irregular"]("dome", 200)
    given = pickle.dumps(
        ((warm.surface, warm.datum), pickle.dumps((mesh.surface, mesh.datum)), solver, repeats), protocol=5
    )
    here = str(Path(__file__).parent)
    done = subprocess.run([sys.executable, "-c", _CHILD, here], input=given, capture_output=True, env=os.environ.copy())
    if done.returncode:
        raise RuntimeError(done.stderr.decode().strip().splitlines()[-1])
    memory, seconds = done.stdout.decode().split()[-2:]
    return float(memory), float(seconds)
