"""Things without seams, made here by formula: how the whole command parts them, how flat the pieces lie, and how long it takes.

python benchmarks/things.py [WORDS ...] [--fabric woven] [--out FOLDER]

Each thing whose name contains one of the words, all by default, is written as OBJ, and `warpflat flatten` is run on it as a user runs it.

Columns: faces; pieces, and how many of them are drawn; share of the cloth beyond its limit [%]; how much is taken off all around before a
piece falls into parts, 30 mm at most [mm]; length of all seams over the square root of the area; processor seconds of the command, with its
film and pictures; its exit code, and what its last line says where that is not 0. With a folder the results stay there.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
import trimesh

from warpflat.core.arrays import FloatArray
from warpflat.garment.seams.solid import parts_within

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from seam_solids import skin

Distance = Callable[[FloatArray], FloatArray]
Vector = Sequence[float]
_SIDES = (1.0, -1.0)


def capsule(start: Vector, end: Vector, first: float, last: float) -> Distance:
    """Return the distance from a rod with round ends, of one radius at its start and another at its end [m]."""
    a, way = np.array(start), np.subtract(end, start)

    def distance(points: FloatArray) -> FloatArray:
        share = np.clip((points - a) @ way / (way @ way), 0.0, 1.0)
        return np.asarray(np.linalg.norm(points - a - share[:, None] * way, axis=1) - first - share * (last - first))

    return distance


def trunk(low: float, high: float, wide: float, deep: float) -> Distance:
    """Return about the distance from an upright elliptic rod with round ends [m]."""
    upright = capsule((0, low, 0), (0, high, 0), wide, wide)
    return lambda points: upright(points * [1.0, 1.0, wide / deep]) * deep / wide


def ellipsoid(centre: Vector, radii: Vector) -> Distance:
    """Return about the distance from an ellipsoid [m]."""
    return lambda points: (np.linalg.norm((points - centre) / np.array(radii), axis=1) - 1.0) * min(radii)


def box(centre: Vector, size: Vector, rounding: float = 0.01) -> Distance:
    """Return the distance from a box with round edges [m]."""

    def distance(points: FloatArray) -> FloatArray:
        beyond = np.abs(points - centre) - (np.array(size) / 2.0 - rounding)
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        return np.asarray(outside + np.minimum(beyond.max(axis=1), 0.0) - rounding)

    return distance


def cylinder(radius: float, low: float, high: float) -> Distance:
    """Return about the distance from an upright cylinder [m]."""
    return lambda p: np.maximum(np.hypot(p[:, 0], p[:, 2]) - radius, np.maximum(low - p[:, 1], p[:, 1] - high))


def torus(centre: Vector, radius: float, thick: float) -> Distance:
    """Return the distance from a ring around an axis along z [m]."""
    return lambda p: np.hypot(np.hypot(p[:, 0] - centre[0], p[:, 1] - centre[1]) - radius, p[:, 2] - centre[2]) - thick


def joined(*parts: Distance, round_by: float) -> Distance:
    """Return about the distance from several parts, their joints rounded [m]."""

    def distance(points: FloatArray) -> FloatArray:
        found = parts[0](points)
        for part in parts[1:]:
            other = part(points)
            share = np.clip(0.5 + 0.5 * (other - found) / round_by, 0.0, 1.0)
            found = other * (1.0 - share) + found * share - round_by * share * (1.0 - share)
        return found

    return distance


def nets(distance: Distance, low: Vector, high: Vector, step: float) -> trimesh.Trimesh:
    """Return the zero surface of a distance: a vertex in each cell that it crosses (surface nets), smoothed (Taubin)."""
    axes = [np.arange(a - 2.0 * step, b + 2.5 * step, step) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    value = distance(grid.reshape(-1, 3)).reshape(grid.shape[:3])
    shape = np.array(value.shape) - 1
    corners = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    inside = value < 0.0
    around = np.stack([inside[tuple(slice(c, n + c) for c, n in zip(one, shape, strict=True))] for one in corners], -1)
    crossed = around.any(axis=-1) & ~around.all(axis=-1)
    cells = np.argwhere(crossed)
    total, count = np.zeros((len(cells), 3)), np.zeros(len(cells))
    for one in range(8):
        for other in range(one + 1, 8):
            if np.abs(corners[one] - corners[other]).sum() == 1:
                a, b = value[tuple((cells + corners[one]).T)], value[tuple((cells + corners[other]).T)]
                through = (a < 0.0) != (b < 0.0)
                share = np.where(through, a / np.where(through, a - b, 1.0), 0.0)
                total[through] += (corners[one] + share[:, None] * (corners[other] - corners[one]))[through]
                count += through
    vertices = np.array([axis[0] for axis in axes]) + step * (cells + total / count[:, None])
    index = np.full(crossed.shape, -1)
    index[crossed] = np.arange(len(cells))
    faces = []
    for axis in range(3):
        along, u, v = np.roll(np.eye(3, dtype=int), -axis, axis=0)
        before = inside[tuple(slice(0, n) for n in np.array(value.shape) - along)]
        after = inside[tuple(slice(n, None) for n in along)]
        edges = np.argwhere(before != after)
        edges = edges[(edges @ u > 0) & (edges @ v > 0)]
        quad = np.stack([index[tuple((edges - back).T)] for back in (u + v, v, 0 * u, u)], axis=1)
        outwards = before[tuple(edges.T)]
        faces.append(np.where(outwards[:, None], quad, quad[:, ::-1]))
    quads = np.concatenate(faces)
    mesh = trimesh.Trimesh(vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
    trimesh.smoothing.filter_taubin(mesh, iterations=10)
    return mesh


def by_tetrahedra(
    shape: Distance, low: Vector, high: Vector, step: float, *openings: tuple[Vector, Vector]
) -> trimesh.Trimesh:
    """Return the mesh that the tests make by marching tetrahedra: no vertex of it mirrors another one."""
    made = skin(shape, low, high, step, openings)
    return trimesh.Trimesh(made.vertices, made.faces[:, :3], process=False)


def cut(mesh: trimesh.Trimesh, *planes: tuple[Vector, Vector]) -> trimesh.Trimesh:
    """Return the part of a mesh to which the normals of all planes (point, normal) point."""
    for point, normal in planes:
        mesh = mesh.slice_plane(point, normal)
    mesh.merge_vertices()
    mesh.update_faces(mesh.nondegenerate_faces(height=1e-5))
    return mesh


def without(mesh: trimesh.Trimesh, near: Distance) -> trimesh.Trimesh:
    """Return the largest part of a mesh without the faces of which a corner lies within a distance."""
    mesh.update_faces(~(near(mesh.vertices) < 0.0)[mesh.faces].any(axis=1))
    mesh.remove_unreferenced_vertices()
    return max(mesh.split(only_watertight=False, repair=False), key=lambda part: float(part.area))


def turned(profile: Sequence[Vector], deep: float = 1.0, around: int = 72) -> trimesh.Trimesh:
    """Return the surface that a profile (radius, height) sweeps around the y axis, `deep` times as far along z as along x."""
    rows = np.array(profile)
    angle = np.arange(around) * 2.0 * np.pi / around
    radius, height = rows[:, :1], np.repeat(rows[:, 1:], around, axis=1)
    vertices = np.stack([radius * np.cos(angle), height, deep * radius * np.sin(angle)], axis=-1).reshape(-1, 3)
    row, here = np.meshgrid(np.arange(len(rows) - 1) * around, np.arange(around), indexing="ij")
    a, b = (row + here).ravel(), (row + (here + 1) % around).ravel()
    faces = np.concatenate([np.stack([a, a + around, b], 1), np.stack([b, a + around, b + around], 1)])
    mesh = trimesh.Trimesh(vertices, faces)
    mesh.update_faces(mesh.nondegenerate_faces())
    return mesh


def plush(ear: tuple[Vector, float, float], foot: tuple[Vector, Vector]) -> Distance:
    """Return a toy that sits: ears with their tip and two radii, arms, feet with both their ends, and a snout."""
    (x, y, z), (heel, toe) = ear[0], foot
    return joined(
        ellipsoid((0, 0.12, 0), (0.09, 0.12, 0.08)),
        ellipsoid((0, 0.28, 0.01), (0.085, 0.075, 0.075)),
        *[capsule((s * 0.05, 0.34, 0), (s * x, y, z), *ear[1:]) for s in _SIDES],
        *[capsule((s * 0.08, 0.18, 0.02), (s * 0.14, 0.12, 0.06), 0.03, 0.03) for s in _SIDES],
        *[capsule(heel * np.array([s, 1, 1]), toe * np.array([s, 1, 1]), 0.036, 0.036) for s in _SIDES],
        ellipsoid((0, 0.265, 0.08), (0.03, 0.025, 0.025)),
        round_by=0.02,
    )


def hand(roots: Vector, apart: float, thick: float, thumb: tuple[Vector, float, float], round_by: float) -> Distance:
    """Return a hand: where its four fingers begin, how far they spread, how thick they are; the thumb's tip and radii."""
    fingers = zip(roots, (0.06, 0.075, 0.07, 0.05), strict=True)
    return joined(
        box((0, 0.05, 0), (0.085, 0.11, 0.03), 0.014),
        *[capsule((x, 0.1, 0), (x * apart, 0.1 + long, 0), thick, thick - 0.001) for x, long in fingers],
        capsule((-0.04, 0.03, 0), *thumb),
        round_by=round_by,
    )


def mug() -> trimesh.Trimesh:
    outside = joined(cylinder(0.04, 0.0, 0.1), torus((0.045, 0.05, 0.0), 0.028, 0.006), round_by=0.006)
    inside = cylinder(0.035, 0.006, 0.2)
    return nets(lambda p: np.maximum(outside(p), -inside(p)), (-0.05, -0.01, -0.05), (0.09, 0.11, 0.05), 0.003)


def slipper_sock() -> trimesh.Trimesh:
    foot = capsule((0, 0.045, -0.05), (0, 0.04, 0.12), 0.042, 0.036)
    leg = capsule((0, 0.05, -0.05), (0, 0.3, -0.05), 0.045, 0.05)
    mesh = nets(joined(foot, leg, round_by=0.04), (-0.07, -0.01, -0.12), (0.07, 0.38, 0.18), 0.007)
    return cut(mesh, ((0, 0.25, 0), (0, -1, 0)))


def shoe() -> trimesh.Trimesh:
    foot = capsule((0, 0.035, -0.1), (0, 0.03, 0.1), 0.04, 0.035)
    last = joined(foot, capsule((0, 0.04, -0.09), (0, 0.14, -0.09), 0.042, 0.045), round_by=0.03)
    mesh = nets(lambda p: np.maximum(last(p), -p[:, 1]), (-0.07, -0.01, -0.17), (0.07, 0.2, 0.15), 0.006)
    return cut(mesh, ((0, 0.13, 0), (0, -1, 0)))


def cushion() -> trimesh.Trimesh:
    ball = trimesh.creation.icosphere(5)
    square = np.sign(ball.vertices) * np.abs(ball.vertices) ** 0.5
    return trimesh.Trimesh(square * [0.2, 0.2, 0.0] + ball.vertices * [0.0, 0.0, 0.07], ball.faces)


def cap() -> trimesh.Trimesh:
    mesh = nets(ellipsoid((0, 0, 0), (0.085, 0.12, 0.1)), (-0.1, -0.13, -0.11), (0.1, 0.13, 0.11), 0.006)
    angle, out = np.meshgrid(np.linspace(-1.1, 1.1, 41), np.linspace(0.0, 0.75, 14))
    x, y = 0.085 * np.sin(angle), -0.02 * np.sin(angle) ** 2 * out
    brim = np.stack([x, y, 0.1 * np.cos(angle) * (1.0 + out * np.cos(angle) ** 0.8)], axis=-1).reshape(-1, 3)
    a = (np.arange(13)[:, None] * 41 + np.arange(40)).ravel()
    faces = np.concatenate([np.stack([a, a + 41, a + 1], 1), np.stack([a + 1, a + 41, a + 42], 1)])
    return cut(mesh, ((0, 0, 0), (0, 1, 0))) + trimesh.Trimesh(brim, faces, process=False)


def bucket_bag() -> trimesh.Trimesh:
    wall = [(0.11 + 0.08 * y, y) for y in np.linspace(0.008, 0.25, 24)]
    return turned([*((r, 0.0) for r in np.linspace(0.0, 0.11, 13)), *wall])


def brimmed_hat() -> trimesh.Trimesh:
    edge = [(0.07 + 0.012 * np.sin(a), 0.108 + 0.012 * np.cos(a)) for a in np.linspace(0.3, 1.57, 4)]
    wall = zip(np.linspace(0.083, 0.092, 10), np.linspace(0.1, 0.0, 10), strict=True)
    brim = [(r, -0.002 * row) for row, r in enumerate(np.linspace(0.1, 0.16, 9))]
    mesh = turned([*((r, 0.12) for r in np.linspace(0.0, 0.07, 10)), *edge, *wall, *brim], deep=1.15)
    mesh.invert()
    return mesh


def tote_bag() -> trimesh.Trimesh:
    case = trimesh.creation.box((0.38, 0.35, 0.1)).subdivide_to_size(0.015)
    case.apply_translation((0, 0.175, 0))
    case.merge_vertices()
    bag, turn = cut(case, ((0, 0.34, 0), (0, -1, 0))), np.linspace(0.0, np.pi, 40)
    for z in (0.053, -0.053):
        rows = [
            np.stack([r * np.cos(turn), 0.25 + (r + 0.22) * np.sin(turn), 0.0 * turn + z], axis=1) for r in (0.08, 0.06)
        ]
        a = np.arange(39)
        faces = np.concatenate([np.stack([a, a + 1, a + 40], 1), np.stack([a + 1, a + 41, a + 40], 1)])
        bag = bag + trimesh.Trimesh(np.concatenate(rows), faces, process=False).subdivide()
    return bag


def chair() -> trimesh.Trimesh:
    legs = [box((x, 0.22, z), (0.05, 0.44, 0.05)) for x in (-0.18, 0.18) for z in (-0.18, 0.18)]
    back = box((0, 0.75, -0.19), (0.42, 0.55, 0.04))
    shape = joined(box((0, 0.45, 0), (0.42, 0.05, 0.42)), back, *legs, round_by=0.01)
    return nets(shape, (-0.25, 0, -0.25), (0.25, 1.05, 0.25), 0.011)


def tpose_dress() -> trimesh.Trimesh:
    def cone(p: FloatArray) -> FloatArray:
        radius = 0.17 + 0.3 * np.clip(1.0 - p[:, 1], 0.0, 1.0)
        return np.asarray(np.maximum(np.hypot(p[:, 0], 1.25 * p[:, 2]) - radius, p[:, 1] - 1.05))

    arms = [capsule((s * 0.15, 1.37, 0), (s * 0.65, 1.37, 0), 0.06, 0.05) for s in _SIDES]
    shape = joined(trunk(1.0, 1.36, 0.17, 0.12), *arms, cone, round_by=0.04)
    mesh = nets(shape, (-0.75, 0.4, -0.4), (0.75, 1.6, 0.4), 0.016)
    mesh = cut(mesh, ((0, 0.55, 0), (0, 1, 0)), *(((s * 0.5, 0, 0), (-s, 0, 0)) for s in _SIDES))
    return without(mesh, ellipsoid((0, 1.5, 0.03), (0.1, 0.1, 0.1)))


def hooded_jumpsuit() -> trimesh.Trimesh:
    shape = joined(
        trunk(0.9, 1.36, 0.18, 0.13),
        *[capsule((s * 0.1, 0.85, 0), (s * 0.16, 0, 0), 0.1, 0.06) for s in _SIDES],
        *[capsule((s * 0.17, 1.38, 0), (s * 0.6, 1.0, 0.03), 0.065, 0.045) for s in _SIDES],
        capsule((0, 1.4, 0), (0, 1.55, 0), 0.085, 0.085),
        ellipsoid((0, 1.62, 0), (0.12, 0.15, 0.14)),
        round_by=0.05,
    )
    wrists = [((s * 0.53, 1.06, 0.02), (s * 0.75, -0.66, 0.05)) for s in _SIDES]
    openings = [((0, 0.12, 0), (0, -1, 0)), *wrists, ((0, 1.61, 0.09), (0, 0.1, 1))]
    return by_tetrahedra(shape, (-0.75, -0.1, -0.3), (0.75, 1.85, 0.3), 0.03, *openings)


_TOY, _HAND = ((-0.2, -0.02, -0.12), (0.2, 0.46, 0.2)), ((-0.11, -0.03, -0.03), (0.07, 0.2, 0.03))

THINGS: dict[str, Callable[[], trimesh.Trimesh]] = {
    "plush with ears, arms and feet": lambda: by_tetrahedra(
        plush(((0.085, 0.41, 0), 0.028, 0.025), ((0.055, 0.04, 0.04), (0.07, 0.03, 0.14))), *_TOY, 0.0125
    ),
    "plush of another mesh, not a manifold": lambda: nets(
        plush(((0.08, 0.42, 0), 0.025, 0.02), ((0.05, 0.04, 0.04), (0.06, 0.03, 0.14))), *_TOY, 0.006
    ),
    "glove, four fingers": lambda: by_tetrahedra(
        hand((-0.034, -0.0115, 0.0115, 0.034), 1.45, 0.0095, ((-0.085, 0.08, 0.005), 0.0125, 0.0105), 0.006),
        *_HAND,
        0.006,
        ((0, 0.005, 0), (0, -1, 0)),
    ),
    "glove, fingers that nearly touch": lambda: cut(
        nets(
            hand((-0.034, -0.011, 0.012, 0.034), 1.25, 0.0105, ((-0.075, 0.085, 0.005), 0.013, 0.011), 0.008),
            (-0.1, -0.02, -0.03),
            (0.07, 0.2, 0.03),
            0.0035,
        ),
        ((0, 0.01, 0), (0, 1, 0)),
    ),
    "mug with handle": mug,
    "slipper sock": slipper_sock,
    "shoe": shoe,
    "cushion": cushion,
    "poncho": lambda: turned(
        [(r, 1.5 - 0.55 * (r - 0.09) - 0.5 * max(r - 0.2, 0.0)) for r in np.linspace(0.55, 0.09, 34)]
    ),
    "ball": lambda: trimesh.creation.icosphere(4, radius=0.11),
    "cap with a brim": cap,
    "bucket bag": bucket_bag,
    "hat with a brim": brimmed_hat,
    "tote bag with handles": tote_bag,
    "chair": chair,
    "T-pose dress": tpose_dress,
    "hooded jumpsuit": hooded_jumpsuit,
}


def narrowest(folder: Path, names: Iterable[str]) -> float:
    """Return how much is taken off all pieces of a result before one of them is in parts, or nothing is left of it [mm]; 30 at most."""
    least = 30.0
    for name in names:
        loaded = trimesh.load(folder / f"{name}.obj", process=False)
        faces, flat = np.asarray(loaded.faces, dtype=np.int32), np.asarray(loaded.visual.uv)
        while least > 0.0 and parts_within(faces, flat, 1e-3 * least) != 1:
            least -= 0.5
    return least


def measure(name: str, mesh: trimesh.Trimesh, fabric: str, folder: Path) -> list[str]:
    """Return a row of the table; the mesh, and what the command makes of it, are in the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    file, out = folder / "thing.obj", folder / "flat"
    mesh.export(file)
    command = [sys.executable, "-m", "warpflat", "flatten", str(file), "--units", "m", "--fabric", fabric]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([*command, "--out", str(out)], capture_output=True, check=False, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = f"{after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime:.0f}"
    said = (done.stdout + done.stderr).strip()
    (folder / "console.txt").write_text(said + "\n", encoding="utf-8")
    end = "0" if done.returncode == 0 else f"{done.returncode}: {said.splitlines()[-1]}"
    if not (out / "metrics.json").exists():
        return [name, f"{len(mesh.faces):,}", "", "", "", "", seconds, end]
    metrics = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
    pieces, garment = metrics["pieces"].values(), metrics.get("garment", {})
    area = sum(piece["area_m2"] for piece in pieces)
    length = sum(seam["length_m"] for seam in garment.get("found_seams", ()))
    drawn = sum(len(cloth["pieces"]) for cloth in metrics.get("cloths", ()))
    return [
        name,
        f"{len(mesh.faces):,}",
        f"{len(pieces)}, {drawn or '-'}",
        f"{100.0 * sum(piece['wear']['outside'] * piece['area_m2'] for piece in pieces) / area:.1f}",
        f"{narrowest(out, metrics['pieces']):g}",
        f"{length / area**0.5:.1f}",
        seconds,
        end,
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*", default=[""], help="things whose name contains one of them")
    parser.add_argument("--fabric", default="woven")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="keep the results, with their pictures")
    chosen = parser.parse_args()
    print("thing | faces | pieces, drawn | beyond % | narrowest mm | seams/sqrt(A) | s | exit", flush=True)
    with tempfile.TemporaryDirectory() as scratch:
        for name, make in THINGS.items():
            if any(word in name for word in chosen.words):
                folder = (chosen.out or Path(scratch)) / name.replace(", ", "_").replace(" ", "_")
                print(" | ".join(measure(name, make(), chosen.fabric, folder)), flush=True)


if __name__ == "__main__":
    main()
