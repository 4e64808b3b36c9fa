"""Compare a scan's tapes with tapes laid by trimesh and SciPy: `WARPFLAT_DATA=DIR python benchmarks/scan_tapes.py`.

The four bodies as they are, turned, scaled, with noise, with holes, and with arms and legs bent by a skeleton of this
program's own. `--copies NAME ...` picks some, `--worst` prints what is off only.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import numpy as np
import trimesh

from warpflat.core.errors import InputError
from warpflat.mannequin.mannequin import Mannequin
from warpflat.surface.io.read import read_scan

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "mannequin"))
from body_copies import COPIES, as_given, copy_of_body
from body_tapes import armpit_and_crotch, tapes
from limb_tapes import arm_tapes, foot_tape, head_tape, leg_tapes

# ISO 20685 allows a scan's height and girth to differ from a tape's by so much [mm].
HEIGHT, GIRTH = 4.0, 9.0


def by_tape(points: np.ndarray, faces: np.ndarray, tips: dict[str, int]) -> dict[str, tuple[float, float]]:
    """Return height above the floor and girth [m] of every independent tape that can be laid, by the package's names.

    `tips` are the vertices at the fingertips.
    """
    triangles = np.concatenate([faces[:, :3], faces[faces[:, 3] >= 0][:, [0, 2, 3]]])
    on_floor = points - [0.0, points[:, 1].min(), 0.0]
    mesh = trimesh.Trimesh(on_floor, triangles, process=False)
    found: dict[str, tuple[float, float]] = {"head": head_tape(mesh), **tapes(on_floor, faces)}
    armpit, crotch, _ = armpit_and_crotch(mesh)
    for side in ("left", "right"):
        left = side == "left"
        found |= {f"{name} {side}": t for name, t in arm_tapes(mesh, armpit, tips[side]).items()}
        found |= {f"{name} {side}": t for name, t in leg_tapes(mesh, crotch, left).items()}
        found[f"foot {side}"] = foot_tape(mesh, left)
    return found


def report(name: str, copy: str, worst_only: bool) -> tuple[int, int]:
    """Print a copy's tapes and the package's differences; return how many tapes there were and how many are off."""
    vertices, faces = read_scan(Path(os.environ["WARPFLAT_DATA"]) / f"body_{name}.obj")
    points, faces = np.asarray(vertices, float), np.asarray(faces)
    points = points - [0.0, points[:, 1].min(), 0.0]
    triangles = np.concatenate([faces[:, :3], faces[faces[:, 3] >= 0][:, [0, 2, 3]]])
    tips = {"left": int(np.argmax(points[:, 0])), "right": int(np.argmin(points[:, 0]))}
    whole = faces
    points, faces = copy_of_body(
        points, faces, copy, *armpit_and_crotch(trimesh.Trimesh(points, triangles, process=False))
    )
    try:
        body = Mannequin.from_scan(as_given(points, copy), faces, resolution_mm=20.0)
    except InputError as error:
        print(f"{name}, {copy}: refused: {error}")
        return 1, 1
    # Holes do not change a body: the tapes lie on the whole one.
    independent = by_tape(points, whole, tips)
    off = 0
    print(f"{name}, {copy}")
    for tape, (height, girth) in independent.items():
        ours = body.measures.get(tape)
        if ours is None:
            print(f"  {tape:14} {1000 * height:6.0f} {1000 * girth:6.0f}  not found")
            off += 1
            continue
        misses = 1000.0 * (ours.height - height), 1000.0 * (ours.girth - girth)
        is_off = abs(misses[0]) > HEIGHT or abs(misses[1]) > GIRTH
        off += is_off
        if is_off or not worst_only:
            words = ("  off" if is_off else "") + ("  a guess" if ours.guess else "")
            print(f"  {tape:14} {1000 * height:6.0f} {1000 * girth:6.0f}  {misses[0]:+7.1f} {misses[1]:+7.1f}{words}")
    together = body.measures.get("hip, legs together")
    if together is not None:
        print(
            f"  hip, legs together: {1000 * together.girth:.0f} mm, as scanned {1000 * body.measures['hip'].girth:.0f} mm"
        )
    return len(independent), off


def main() -> None:
    """Print, for each body and copy, height and girth by tape and how far the package's differ [mm]."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--bodies", nargs="+", default=["female", "male", "male_heavy", "child"])
    parser.add_argument("--copies", nargs="+", default=list(COPIES), choices=COPIES)
    parser.add_argument("--worst", action="store_true", help="tapes that are off only")
    options = parser.parse_args()
    print("tape, height and girth by tape, and how far the package's height and girth differ [mm]")
    counts = [report(name, copy, options.worst) for name in options.bodies for copy in options.copies]
    total, off = np.sum(counts, axis=0)
    print(f"{total} tapes, {off} off by more than {HEIGHT:g} mm in height or {GIRTH:g} mm in girth")


if __name__ == "__main__":
    main()
