"""Compare a scan's tapes with tapes laid by trimesh and SciPy: `WARPFLAT_DATA=DIR python benchmarks/scan_tapes.py`.

The four bodies as they are, turned, scaled, with noise, with holes, and with arms and legs bent by a skeleton of this
program's own. `--copies NAME ...` picks some, `--worst` prints what is off only. `--mixes SEED ...` takes bodies that are
random mixes of the four, of other breadth, depth and height, instead: nothing was tuned on those of a new seed. `--published FILE ...`
takes bodies of GarmentCode, whose measurements lie beside them (mean_all.obj and mean_all.yaml).
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

import numpy as np
import trimesh

from warpflat.core.errors import InputError
from warpflat.flat.surface.io.read import read_scan
from warpflat.garment.mannequin.mannequin import Mannequin

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "garment" / "mannequin"))
from body_copies import COPIES, as_given, copy_of_body
from body_tapes import armpit_and_crotch, tapes
from landmarks import Landmarks
from limb_tapes import arm_tapes, foot_tape, head_tape, leg_tapes

# ISO 20685 allows a scan's height and girth to differ from a tape's by so much [mm].
HEIGHT, GIRTH = 4.0, 9.0
BODIES = ("female", "male", "male_heavy", "child")


def by_tape(points: np.ndarray, faces: np.ndarray, tips: dict[str, int]) -> dict[str, tuple[float, float]]:
    """Return height above the floor and girth [m] of every independent tape that can be laid, by the package's names.

    `tips` are the vertices at the fingertips.
    """
    triangles = np.concatenate([faces[:, :3], faces[faces[:, 3] >= 0][:, [0, 2, 3]]])
    marks = Landmarks(faces)
    on_floor = points - [0.0, points[:, 1].min(), 0.0]
    mesh = trimesh.Trimesh(on_floor, triangles, process=False)
    found: dict[str, tuple[float, float]] = {
        "head": head_tape(mesh),
        **tapes(on_floor, faces, marks.fold(on_floor), marks.bust(on_floor)),
    }
    armpit, crotch, _ = armpit_and_crotch(mesh)
    for side in ("left", "right"):
        left = side == "left"
        bones, knee = marks.bones(on_floor, side), marks.knee(on_floor, side)
        found |= {f"{name} {side}": t for name, t in arm_tapes(mesh, armpit, tips[side], bones).items()}
        found |= {f"{name} {side}": t for name, t in leg_tapes(mesh, crotch, left, knee).items()}
        found[f"foot {side}"] = foot_tape(mesh, left)
    return found


class Body:
    """A body's mesh, and the independent tapes around it, laid once for all copies of one shape."""

    def __init__(self, name: str, points: np.ndarray, faces: np.ndarray) -> None:
        self.name = name
        self.points, self.faces = points - [0.0, points[:, 1].min(), 0.0], faces
        triangles = np.concatenate([self.faces[:, :3], self.faces[self.faces[:, 3] >= 0][:, [0, 2, 3]]])
        self.marks = armpit_and_crotch(trimesh.Trimesh(self.points, triangles, process=False))
        self.tips = {"left": int(np.argmax(self.points[:, 0])), "right": int(np.argmin(self.points[:, 0]))}
        self._laid: list[tuple[np.ndarray, dict[str, tuple[float, float]]]] = []

    def copy(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return a copy's vertices [m] and faces."""
        return copy_of_body(self.points, self.faces, name, *self.marks)

    def tapes(self, points: np.ndarray) -> dict[str, tuple[float, float]]:
        """Return the independent tapes around the whole body with these vertices."""
        for shape, laid in self._laid:
            if np.array_equal(shape, points):
                return laid
        self._laid.append((points, by_tape(points, self.faces, self.tips)))
        return self._laid[-1][1]


def given_bodies(names: list[str]) -> list[Body]:
    """Return bodies of the data folder."""
    folder = Path(os.environ["WARPFLAT_DATA"])
    read = [(name, *read_scan(folder / f"body_{name}.obj")) for name in names]
    return [Body(name, np.asarray(points, float), np.asarray(faces)) for name, points, faces in read]


def mixed_bodies(seeds: list[int]) -> list[Body]:
    """Return bodies that are mixes of all four, some beyond one of them, of other breadth, height and depth."""
    whole = given_bodies(list(BODIES))
    out = []
    for seed in seeds:
        random = np.random.default_rng(1000 + seed)
        shares = 1.4 * random.dirichlet(np.full(len(whole), 0.8)) - 0.1
        scales = random.uniform((0.90, 0.92, 0.90), (1.12, 1.08, 1.12))
        points = sum(share * body.points for share, body in zip(shares, whole, strict=True)) * scales
        out.append(Body(f"mix {seed}", points, whole[0].faces))
    return out


def report(of: Body, copy: str, worst_only: bool) -> tuple[int, int, int]:
    """Print a copy's tapes and the package's differences; return how many there were, were off, and are off as said."""
    points, faces = of.copy(copy)
    # Noise and holes do not change a body: the tapes lie on the clean and whole one.
    independent = of.tapes(of.points if copy in ("noise", "holes") else points)
    began = time.process_time()
    try:
        body = Mannequin.from_scan(as_given(points, copy), faces, resolution_mm=20.0)
    except InputError as error:
        print(f"{of.name}, {copy}: refused: {error}", flush=True)
        return len(independent), len(independent), len(independent)
    print(f"{of.name}, {copy}: {time.process_time() - began:.1f} s")
    off = said = 0
    for tape, (height, girth) in independent.items():
        ours = body.measures.get(tape)
        if ours is None:
            print(f"  {tape:14} {1000 * height:6.0f} {1000 * girth:6.0f}  not found")
            off += 1
            continue
        misses = 1000.0 * (ours.height - height), 1000.0 * (ours.girth - girth)
        is_off = abs(misses[0]) > HEIGHT or abs(misses[1]) > GIRTH
        off += is_off
        said += is_off and ours.guess is not None
        if is_off or not worst_only:
            words = ("  off" if is_off else "") + ("  a guess" if ours.guess else "")
            print(f"  {tape:14} {1000 * height:6.0f} {1000 * girth:6.0f}  {misses[0]:+7.1f} {misses[1]:+7.1f}{words}")
    together = body.measures.get("hip, legs together")
    if together is not None and not worst_only:
        scanned = 1000 * body.measures["hip"].girth
        print(f"  hip, legs together: {1000 * together.girth:.0f} mm, as scanned {scanned:.0f} mm")
    sys.stdout.flush()
    return len(independent), off, said


def report_published(path: Path) -> None:
    """Print what is published of a body of GarmentCode [mm], and how far the package's tapes differ; `g` is a guess."""
    rows = [row.partition(":") for row in path.with_suffix(".yaml").read_text().splitlines()]
    cm = {name.strip(): float(value.partition("#")[0]) for name, _, value in rows if value.strip()}
    vertices, faces = read_scan(path)
    body = Mannequin.from_scan(np.asarray(vertices, float), np.asarray(faces), resolution_mm=20.0)
    # Heights count from the floor, the bust's from the nape down.
    known = {"bust height": cm["height"] - cm["head_l"] - cm["vert_bust_line"], "hip": cm["hips"]}
    known |= {name: cm[name] for name in ("bust", "underbust", "waist")}
    words = []
    for name, value in known.items():
        ours = body.measures[name.split(" ")[0]]
        found = ours.height if name.endswith("height") else ours.girth
        words.append(f"{name} {10 * value:.0f} {1000 * found - 10 * value:+.1f}{' g' if ours.guess else ''}")
    chest = body.measures["chest, fullest"]
    words.append(f"fullest chest {1000 * chest.girth:.0f} at {1000 * chest.height:.0f}{' g' if chest.guess else ''}")
    print(f"{path.stem}: {', '.join(words)}", flush=True)


def main() -> None:
    """Print, for each body and copy, height and girth by tape and how far the package's differ [mm]."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--bodies", nargs="+", default=list(BODIES))
    parser.add_argument("--mixes", nargs="+", type=int, metavar="SEED", help="random mixes of the four bodies instead")
    parser.add_argument("--copies", nargs="+", default=list(COPIES), choices=COPIES)
    parser.add_argument("--worst", action="store_true", help="tapes that are off only")
    parser.add_argument("--published", nargs="+", type=Path, metavar="FILE", help="bodies of GarmentCode instead")
    options = parser.parse_args()
    if options.published:
        for path in options.published:
            report_published(path)
        return
    print("tape, height and girth by tape, and how far the package's height and girth differ [mm]")
    counts = {copy: np.zeros(3, dtype=int) for copy in options.copies}
    for body in mixed_bodies(options.mixes) if options.mixes else given_bodies(options.bodies):
        for copy in options.copies:
            counts[copy] += report(body, copy, options.worst)
    print(
        f"{'copy':12} {'tapes':>5} {'off':>4} {'said':>4}  (off: by more than {HEIGHT:g} mm in height or {GIRTH:g} mm in girth;"
    )
    print(f"{'':28}  said: of these the package says that they are guesses)")
    for copy, count in [*counts.items(), ("all", sum(counts.values()))]:
        print(f"{copy:12} {count[0]:5d} {count[1]:4d} {count[2]:4d}")


if __name__ == "__main__":
    main()
