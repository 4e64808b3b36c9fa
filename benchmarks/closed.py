"""Nearly closed pieces: an animal with a small hole, and bodies without a hand. Are they flat without flips, or is a cut named?

    OMP_NUM_THREADS=1 python benchmarks/closed.py [--only TEXT] [--picture FOLDER]

The animal is a sphere that is drawn out along a head, a tail and four legs. Bodies are those of the folder WARPFLAT_DATA (or
../shared/data), each without the faces within 18 cm of the tip of a hand. Seconds are processor seconds.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import warp as wp
from minima import part_of
from real import default_files

import warpflat
from warpflat.core.arrays import FloatArray, IntArray
from warpflat.flat.surface.io.read import read_scan
from warpflat.flat.surface.mesh import Surface

# Directions of head, tail and legs, how far each is drawn out over the radius, and how sharply.
_LIMBS = (
    ((1.0, 0.5, 0.0), 1.2, 12.0), ((-1.0, 0.4, 0.0), 1.5, 60.0),
    ((0.6, -0.8, 0.4), 1.4, 30.0), ((0.6, -0.8, -0.4), 1.4, 30.0), ((-0.6, -0.8, 0.4), 1.4, 30.0), ((-0.6, -0.8, -0.4), 1.4, 30.0),
)  # fmt: skip


def icosphere(subdivisions: int) -> tuple[FloatArray, IntArray]:
    """Return the vertices, on the unit sphere, and the faces of an icosahedron whose faces are quartered several times."""
    g = 0.5 * (1.0 + 5.0**0.5)
    points = [np.array(p) for p in ((-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g), (0, -1, -g), (0, 1, -g),
                                    (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1))]  # fmt: skip
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6), (7, 1, 8),
             (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]  # fmt: skip
    vertices, triangles = np.array(points) / np.linalg.norm(points[0]), np.array(faces)
    for _ in range(subdivisions):
        edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
        edges, middle = np.unique(edges, axis=0, return_inverse=True)
        ab, bc, ca = (len(vertices) + middle.reshape(-1, 3)).T
        a, b, c = triangles.T
        added = vertices[edges].sum(axis=1)
        vertices = np.concatenate([vertices, added / np.linalg.norm(added, axis=1, keepdims=True)])
        triangles = np.concatenate(
            [np.stack(row, axis=1) for row in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    return vertices, triangles.astype(np.int32)


def animal(subdivisions: int = 4) -> Surface:
    """Return a sphere of 10 cm drawn out along head, tail and legs, with a hole of 12 degrees in its back."""
    points, faces = icosphere(subdivisions)
    radius = np.ones(len(points))
    for direction, length, sharpness in _LIMBS:
        along = points @ (np.array(direction) / np.linalg.norm(direction))
        radius += length * np.exp(sharpness * (along - 1.0))
    keep = (points[faces][:, :, 1] < np.cos(np.radians(12.0))).any(axis=1)
    return part_of(0.1 * radius[:, None] * points, faces[keep], "animal")


def without_hand(file: Path) -> Surface:
    """Return a body without the faces near the tip of a hand, the vertex farthest to one side."""
    points, faces = read_scan(file)
    near = np.linalg.norm(points - points[points[:, 0].argmax()], axis=1) < 0.18
    return part_of(points, faces[~near[faces].any(axis=1)], file.stem)


def pieces() -> Iterator[tuple[str, Callable[[], Surface]]]:
    """Yield pieces by name."""
    yield "animal", animal
    yield "animal, fine", lambda: animal(5)
    for file in sorted({f.parent for f in default_files()}.pop().glob("body_*.obj")) if default_files() else []:
        yield f"{file.stem}, no hand", lambda file=file: without_hand(file)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", metavar="TEXT", help="pieces whose name contains it")
    parser.add_argument("--picture", type=Path, metavar="FOLDER", help="also draw each piece")
    chosen = parser.parse_args()
    wp.config.quiet = True
    print(
        f"{'piece':26} {'verts':>7} {'flips':>5} {'finite':>6} {'rest':>4} {'over mm2':>9} {'length %':>8} {'seconds':>8}  note"
    )
    for name, make in pieces():
        if chosen.only not in name:
            continue
        surface = make()
        begun = time.process_time()
        piece = warpflat.flatten(surface, device="cpu")
        seconds = time.process_time() - begun
        if chosen.picture:
            warpflat.save_piece(piece, chosen.picture / name.replace(", ", "_").replace(" ", "_"), frames=False)
        notes = [note for note in piece.notes if "nearly closed" in note]
        print(
            f"{name:26} {len(surface.vertices):7,} {piece.flipped_faces:5d} {np.isfinite(piece.positions).all()!s:>6} "
            f"{'yes' if piece.converged else 'NO':>4} {1e6 * piece.overlap:9.3g} {100 * piece.measures['length_error']:8.1f} "
            f"{seconds:8.1f}  {notes[0] if notes else 'none'}",
            flush=True,
        )


if __name__ == "__main__":
    main()
