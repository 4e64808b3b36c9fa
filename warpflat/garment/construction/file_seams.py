"""Seams that a file has: where its texture, its materials or its groups part the cloth into islands.

Corners of faces carry a number each: that of their texture coordinates, or of their face's material or group. Two faces that share an
edge in space are of one island where both ends of the edge have the same numbers; elsewhere the edge is on a seam. Vertices at one place
are one, so that formats that split them (GLB) and those that do not (OBJ, USD) say the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warpflat.core import BoolArray, FloatArray, InputError, format_count
from warpflat.flat import RawMesh, following_corners, join_labels, weld_map

__all__ = ["COUNTED", "FILE_SEAMS", "MOST_ISLANDS", "FileSeams", "asked_seams", "file_seams", "like_cut_pieces"]

Ids = NDArray[np.int64]

#: What seams a file can have, in the order in which "file" takes them.
FILE_SEAMS = ("uv", "materials", "groups")
#: More islands than this are no pattern.
MOST_ISLANDS = 200
# Islands of fewer than this share of their part's area are joined to the neighbour along most of their outline.
_CRUMB = 1e-3
#: The area of an island of the texture counts if it is more than this share of the cloth's.
COUNTED = 0.01
# Cut pieces: at most so many; areas that agree with the cloth's within this share; and no more of an island than this lies face down.
_MOST_PIECES, _SAME_AREA, _FACE_DOWN = 24, 0.15, 0.01
# Slits are one seam across a gap of this share of both, from which they turn by no more than this (its cosine).
_GAP, _IN_LINE = 0.25, float(np.cos(np.radians(30.0)))
# A part that is mirrored in the texture is an island of its own from this share on.
_MIRRORED = 0.05


@dataclass(frozen=True, kw_only=True, eq=False)
class FileSeams:
    """How a file parts its cloth in one way.

    Attributes:
        way: "uv", "materials" or "groups".
        edges: #E by 2, vertices of the file at the ends of each edge on a seam.
        beside: #E by 2, the two islands at each.
        island: #F, the island of each face, from 0.
        names: of the islands in the file, "" where it has none.
        joined: how many islands were crumbs, and were joined to a neighbour.
    """

    way: str
    edges: Ids
    beside: Ids
    island: Ids
    names: tuple[str, ...]
    joined: int = 0

    def describe(self, count: int | None = None) -> str:
        """Return in words what parts the cloth: all islands, or so many of them."""
        count = len(self.names) if count is None else count
        return {
            "uv": f"{format_count(count, 'island')} of the file's texture",
            "materials": f"{format_count(count, 'area')} of one material each",
            "groups": f"{format_count(count, 'area')} of one group each",
        }[self.way]


def file_seams(raw: RawMesh) -> dict[str, FileSeams]:
    """Return the seams that a file has, by the way in which it says them; they have no edges where all islands lie apart anyway.

    Args:
        raw: the mesh as it stands, its faces and positions checked.
    """
    corner: dict[str, tuple[Ids, tuple[str, ...]]] = {}
    polygons = raw.polygons
    if raw.texture is not None:
        known = np.isfinite(raw.texture).all(axis=2) & (polygons >= 0)
        number = np.full(polygons.shape, -1, dtype=np.int64)
        # Places that are written twice, as for each corner of a face, are one.
        number[known] = np.unique(raw.texture[known], axis=0, return_inverse=True)[1].ravel()
        corner["uv"] = number, ()
    for way, given in (("materials", raw.face_material), ("groups", raw.face_group)):
        if given is not None and len(given[1]) > 1:
            corner[way] = np.repeat(given[0][:, None], polygons.shape[1], axis=1), given[1]
    if not corner:
        return {}
    sides = _Sides(raw)
    found = {}
    for way, (number, names) in corner.items():
        if way == "uv":
            assert raw.texture is not None
            # A half that lies mirrored on the other one shares its places along the middle.
            turn = np.sign(_texture_areas(raw.texture, polygons)).astype(np.int64)
            island = sides.islands(number)
            area = np.bincount(3 * island + turn + 1, sides.area, minlength=3 * int(island.max()) + 3).reshape(-1, 3)
            two = np.minimum(area[:, 0], area[:, 2]) > _MIRRORED * area.sum(axis=1)
            mirrored = two[island] & (turn < 0)
            number[mirrored] = np.where(number[mirrored] >= 0, number[mirrored] + number.max() + 1, -1)
        island = sides.islands(number)
        island, joined = sides.without_crumbs(island) if int(island.max()) < MOST_ISLANDS else (island, 0)
        differ = sides.pairs[(sides.ends(number)[0] != sides.ends(number)[1]).any(axis=1)]
        differ = np.concatenate([differ, sides.bridges(differ)])
        # Within an island that a crumb was joined to, only its own slits are left.
        of = island[sides.face[differ]]
        kept = (of[:, 0] != of[:, 1]) | ~sides.was_crumb[sides.face[differ]].any(axis=1)
        differ, of = differ[kept], of[kept]
        first = np.unique(island, return_index=True)[1]
        found[way] = FileSeams(
            way=way,
            edges=np.stack([sides.tail[differ[:, 0]], sides.head[differ[:, 0]]], axis=1),
            beside=of,
            island=island,
            names=tuple(names[raw_number] if names else "" for raw_number in number[first, 0].tolist()),
            joined=joined,
        )
    return found


def asked_seams(path: Path, find: str, seams: Mapping[str, FileSeams]) -> FileSeams:
    """Return those of a file's seams that are asked for.

    Raises:
        InputError: the file has none of them, or too many for a pattern.
    """
    wanted = FILE_SEAMS if find == "file" else (find,)
    taken = next((seams[way] for way in wanted if way in seams), None)
    if taken is None:
        lacks = {"uv": "texture coordinates", "materials": "more than one material", "groups": "more than one group"}
        other = f"seams by {' and '.join(seams)}" if seams else "no other seams either"
        raise InputError(
            f"{path}: find = {find!r}: the file does not have {' or '.join(lacks[way] for way in wanted)}; it has {other}: "
            'give find = "auto" (--seams auto) to look for seams'
        )
    if len(taken.names) > MOST_ISLANDS:
        raise InputError(
            f"{path}: find = {find!r}: {taken.describe()} are too many for a pattern, which has at most {MOST_ISLANDS} pieces; "
            'find = "auto" (--seams auto) looks for seams'
        )
    return taken


def like_cut_pieces(raw: RawMesh, seams: FileSeams) -> str:
    """Return why the islands of a file's texture cannot be the pieces of a pattern; "" where they look like it.

    Pieces are few, discs with a simple outline, and as large as the cloth, up to one scale for each connected part.
    """
    assert raw.texture is not None
    count = len(seams.names)
    if count > _MOST_PIECES:
        return f"{count} are more than {_MOST_PIECES}"
    sides = _Sides(raw)
    flat = _texture_areas(raw.texture, raw.polygons)
    part = sides.islands(np.zeros(raw.polygons.shape, dtype=np.int64))
    for number in range(int(part.max()) + 1):
        whole = part == number
        scale = np.abs(flat[whole]).sum() / max(sides.area[whole].sum(), 1e-300)
        for island in np.unique(seams.island[whole]).tolist():
            own = seams.island == island
            area = float(sides.area[own].sum())
            if area < COUNTED * sides.area.sum():
                continue
            ratio = float(np.abs(flat[own]).sum()) / max(area * scale, 1e-300)
            if not abs(ratio - 1.0) <= _SAME_AREA:
                return f"one has {ratio:.2f} times the area that the scale of the others gives it"
            if (
                min(flat[own].clip(min=0.0).sum(), -flat[own].clip(max=0.0).sum())
                > _FACE_DOWN * np.abs(flat[own]).sum()
            ):
                return "one lies partly face down"
            if not _has_simple_outline(raw.texture[own], raw.polygons[own]):
                return "one has holes, or an outline that crosses itself"
    return ""


class _Sides:
    """The sides of all faces, from tail to head, and which lie at one place."""

    def __init__(self, raw: RawMesh) -> None:
        polygons = raw.polygons
        real = polygons >= 0
        size = real.sum(axis=1)
        self._follow = following_corners(polygons)
        self._real = real
        self._place = place = weld_map(raw.vertices).astype(np.int64)
        self._points = raw.vertices
        heads = np.take_along_axis(polygons, self._follow, axis=1)
        self.face = np.repeat(np.arange(len(polygons)), size)
        self.tail, self.head = polygons[real], heads[real]
        tail, head = place[self.tail], place[self.head]
        self._against = tail > head
        key = np.minimum(tail, head) * len(place) + np.maximum(tail, head)
        key[tail == head] = -1 - np.arange(int((tail == head).sum()))
        order = np.argsort(key, kind="stable")
        same = key[order[1:]] == key[order[:-1]]
        #: #P by 2, sides at one place; of three, the first with the second, and the second with the third.
        self.pairs = np.stack([order[:-1][same], order[1:][same]], axis=1)
        self.length = np.linalg.norm(raw.vertices[self.tail] - raw.vertices[self.head], axis=1)
        corners = raw.vertices[np.maximum(polygons, 0)]
        middle = (corners * real[..., None]).sum(axis=1, keepdims=True) / np.maximum(size, 1)[:, None, None]
        following = np.take_along_axis(corners, self._follow[..., None], axis=1)
        normal = np.where(real[..., None], np.cross(corners - middle, following - middle), 0.0).sum(axis=1)
        #: #F [the file's unit, squared].
        self.area = 0.5 * np.linalg.norm(normal, axis=1)
        self.was_crumb: BoolArray = np.zeros(len(polygons), dtype=bool)

    def bridges(self, seams: Ids) -> Ids:
        """Return pairs of sides (#B by 2) along which slits (#P by 2 pairs of sides) go on to others in line with them.

        Two slits are one seam where the gap between their ends is short against both, and both run straight on across it.
        """
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import dijkstra

        if not len(seams):
            return seams
        count = len(self._place)
        tail, head = self._place[self.tail], self._place[self.head]
        a, b = tail[seams[:, 0]], head[seams[:, 0]]
        part = join_labels(count, a, b)
        long = np.bincount(part[a], self.length[seams[:, 0]], minlength=int(part.max()) + 1)
        # Slits end where one of their edges does, and no border is.
        alone = np.ones(len(tail), dtype=bool)
        alone[self.pairs.ravel()] = False
        degree = np.bincount(np.concatenate([a, b]), minlength=count)
        degree[np.concatenate([tail[alone], head[alone]])] = 0
        ends = np.flatnonzero(degree == 1)
        if len(ends) > MOST_ISLANDS:
            return seams[:0]  # as many are no pattern
        at_one, at_two = degree[a] == 1, degree[b] == 1
        before = dict(
            zip([*a[at_one].tolist(), *b[at_two].tolist()], [*b[at_one].tolist(), *a[at_two].tolist()], strict=True)
        )
        found = list[tuple[float, int, int]]()
        for one, other in combinations(ends.tolist(), 2):
            across = self._points[other] - self._points[one]
            gap = float(np.linalg.norm(across))
            if part[one] == part[other] or not 0.0 < gap <= _GAP * float(long[part[one]] + long[part[other]]):
                continue
            runs = self._points[one] - self._points[before[one]], self._points[before[other]] - self._points[other]
            if all(float(run @ across) >= _IN_LINE * float(np.linalg.norm(run)) * gap for run in runs):
                found.append((gap, one, other))
        if not found:
            return seams[:0]
        graph = coo_array((self.length, (tail, head)), shape=(count, count)).tocsr()
        sides = np.stack([tail, head], axis=1)[self.pairs[:, 0]].tolist()
        at = {frozenset(pair): row for row, pair in enumerate(sides)}
        rows, taken = list[int](), set[int]()
        for gap, one, other in sorted(found):
            if {one, other} & taken:
                continue
            taken |= {one, other}
            reached, came = dijkstra(graph, directed=False, indices=one, return_predecessors=True, limit=gap / _IN_LINE)
            while np.isfinite(reached[other]) and other != one:
                rows += [at[key]] if (key := frozenset((other, int(came[other])))) in at else []
                other = int(came[other])
        return self.pairs[rows]

    def ends(self, number: Ids) -> tuple[Ids, Ids]:
        """Return #P by 2 twice: the numbers (#F by k, of corners) at both ends of the sides of each pair, in one direction."""
        tail, head = number[self._real], np.take_along_axis(number, self._follow, axis=1)[self._real]
        low, high = np.where(self._against, head, tail), np.where(self._against, tail, head)
        one, other = self.pairs.T
        return np.stack([low[one], high[one]], axis=1), np.stack([low[other], high[other]], axis=1)

    def islands(self, number: Ids) -> Ids:
        """Return #F, the island of each face, where corners have these numbers (#F by k)."""
        one, other = self.ends(number)
        same = self.pairs[(one == other).all(axis=1)]
        return join_labels(len(self._real), *self.face[same].T).astype(np.int64)

    def without_crumbs(self, island: Ids) -> tuple[Ids, int]:
        """Return the islands (#F, from 0), the smallest joined to the neighbour along most of their outline, and how many these are."""
        part = self.islands(np.zeros(self._real.shape, dtype=np.int64))
        whole = np.bincount(part, self.area)
        area, joined = np.bincount(island, self.area), 0
        own_part = part[np.unique(island, return_index=True)[1]]
        small = np.flatnonzero(area < _CRUMB * whole[own_part])
        target = np.arange(len(area))
        of = island[self.face[self.pairs]]
        length = self.length[self.pairs[:, 0]]
        for one in small[np.argsort(area[small], kind="stable")].tolist():
            now = target[of]
            near = (now == target[one]).any(axis=1) & (now[:, 0] != now[:, 1])
            if near.any():
                others = np.where(now[near, 0] == target[one], now[near, 1], now[near, 0])
                target[target == target[one]] = int(np.bincount(others, length[near]).argmax())
                self.was_crumb |= island == one
                joined += 1
        return np.unique(target[island], return_inverse=True)[1].ravel().astype(np.int64), joined


def _texture_areas(texture: FloatArray, polygons: Ids) -> FloatArray:
    """Return #F, the area of each face in the texture, negative where it is mirrored; 0 without coordinates."""
    real, follow = (polygons >= 0)[..., None], following_corners(polygons)
    # What is beyond all numbers has no area.
    with np.errstate(over="ignore", invalid="ignore"):
        points = np.where(real, texture - texture[:, :1], 0.0)
        x, y = points.transpose(2, 0, 1)
        nx, ny = np.take_along_axis(x, follow, axis=1), np.take_along_axis(y, follow, axis=1)
        area = 0.5 * np.where(real[..., 0], x * ny - nx * y, 0.0).sum(axis=1)
    return np.nan_to_num(area, nan=0.0, posinf=0.0, neginf=0.0)


def _has_simple_outline(texture: FloatArray, polygons: Ids) -> bool:
    """Return whether an island has one border in the texture, which does not cross itself."""
    import shapely

    real = (polygons >= 0) & np.isfinite(texture).all(axis=2)
    number: Ids = np.full(polygons.shape, -1, dtype=np.int64)
    places, number[real] = np.unique(texture[real], axis=0, return_inverse=True)
    rows: list[list[int]] = [[corner for corner in row if corner >= 0] for row in number.tolist()]
    sides = {(a, b) for row in rows for a, b in pairwise([*row, *row[:1]])}
    follow = {a: b for a, b in sides if (b, a) not in sides}
    if not follow:
        return False
    start = next(iter(follow))
    ring = [start]
    while (after := follow.get(ring[-1])) is not None and after != start and len(ring) <= len(follow):
        ring.append(after)
    if after != start or len(ring) != len(follow) or len(ring) < 3:
        return False
    return bool(shapely.Polygon(places[ring]).is_valid)
