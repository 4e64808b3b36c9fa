"""Degenerate faces are merged into their neighbours; everything else stays exactly as it is.

A triangle is degenerate here if its smallest altitude is below a small share of the length of the edges around it.
There are two kinds (Botsch et al., Polygon Mesh Processing, 2010, ch. 8): a needle has one very short edge, which is
collapsed; a cap has a corner that lies almost on its longest edge, and the neighbour across that edge is fanned out
from the corner instead. No vertex is moved. A step is taken only if the surface stays manifold with the same border, no
feature line loses its way, and no face becomes degenerate or turns by more than 90 degrees.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable
from itertools import pairwise

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.flat.surface.half_edges import HalfEdges, half_edges
from warpflat.flat.surface.vectors import cross, norm, points_at

__all__ = ["degenerate_faces", "merge_degenerate_faces"]

# An edge this many times longer than the tolerated altitude still counts as the short edge of a needle: all that lies
# within it moves by no more than that.
_SHORT = 3.0
# The last resort: a degenerate face whose shortest edge is below this share of its surroundings loses that edge, if an
# end of it is neither on the border nor on a feature line.
_LAST_RESORT = 0.1
# A mesh with more degenerate faces than this number and this share of all is not merged: it would take minutes.
_TOO_MANY, _TOO_LARGE_A_SHARE = 200, 0.25
_MOST_ROUNDS = 20


def _vertex_scale(vertices: FloatArray, faces: IntArray | HalfEdges) -> FloatArray:
    """Return #V, the mean length [m] of the edges at each vertex."""
    edges = half_edges(faces).edges
    a, b = points_at(vertices, edges.T).transpose(1, 0, 2)
    length = norm(a - b)
    total = sum(np.bincount(ends, weights=length, minlength=len(vertices)) for ends in edges.T)
    count = np.bincount(edges.ravel(), minlength=len(vertices))
    return total / np.maximum(count, 1)


def _width(points: FloatArray) -> FloatArray:
    """Return the least width [m] of faces given as 3 by 3 or 4 corners by any shape (see :func:`degenerate_faces`)."""
    corners = points.shape[1]
    sides = [norm(points[:, (k + 1) % corners] - points[:, k]) for k in range(corners)]
    if corners == 3:
        area2 = norm(cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]))
        longest = np.maximum.reduce(sides)
        return np.asarray(area2 / np.where(longest > 0, longest, 1.0))
    one, two = points[:, 2] - points[:, 0], points[:, 3] - points[:, 1]
    longest = np.maximum(norm(one), norm(two))
    return np.minimum(np.minimum.reduce(sides), norm(cross(one, two)) / np.where(longest > 0, longest, 1.0))


def degenerate_faces(vertices: FloatArray, faces: IntArray | HalfEdges, tolerance: float = 1e-3) -> IntArray:
    """Return the faces whose least width is at most `tolerance` times the mean length of the edges at their corners.

    The width of a triangle is its smallest altitude; of a quad, its shortest edge or twice its area over its longer
    diagonal.
    """
    scale = _vertex_scale(vertices, faces)
    faces = faces.faces if isinstance(faces, HalfEdges) else faces
    width = np.empty(len(faces))
    around = np.empty(len(faces))
    for sides, chosen in ((3, faces[:, 3] < 0), (4, faces[:, 3] >= 0)):
        corners = faces[chosen, :sides]
        width[chosen] = _width(points_at(vertices, corners.T))
        around[chosen] = scale[corners].mean(axis=1)
    return np.flatnonzero(width <= tolerance * around).astype(np.int32)


def merge_degenerate_faces(
    vertices: FloatArray,
    made: HalfEdges,
    lines: dict[str, list[int]],
    tolerance: float = 1e-3,
) -> tuple[IntArray, IntArray, dict[str, list[int]], IntArray, IntArray]:
    """Merge degenerate faces into their neighbours (see :func:`degenerate_faces`).

    Args:
        vertices: #V by 3, positions [m]; none is moved, some may no longer be used afterwards.
        made: the half-edges of the faces, #F by 4, manifold, consistently wound, one component.
        lines: feature lines, vertex indices along edges; one that ran along a merged edge follows it.
        tolerance: share of the surrounding edge length.

    Returns:
        faces, #F' by 4; #F', the face of the argument that each comes from; the lines; the degenerate faces that were
        merged; and those that could not be.
    """
    faces = made.faces
    of = np.arange(len(faces), dtype=np.int32)
    merged, left = of[:0], of[:0]
    # Merging changes the scale around: what had only small neighbours may now be degenerate beside larger ones.
    for _ in range(_MOST_ROUNDS):
        found = degenerate_faces(vertices, made if faces is made.faces else faces, tolerance)
        if len(found) == 0:
            break
        if len(found) > max(_TOO_MANY, _TOO_LARGE_A_SHARE * len(faces)):
            left = of[found]
            break
        # One round, with fixed edge lengths around.
        patch = _Patch(vertices, faces, lines, tolerance)
        waiting = sorted(found.tolist(), key=patch.width)
        # Edges only get shorter and fewer, so this ends; the limit is for what rounding may do to that.
        steps_left = 100 + 20 * len(waiting)
        progress = True
        while waiting and progress and steps_left > 0:
            progress = False
            for face in waiting:
                if patch.is_degenerate(face) and patch.remove_degenerate(face):
                    progress = True
                    steps_left -= 1
            waiting = sorted((f for f in patch.touched | set(waiting) if patch.is_degenerate(f)), key=patch.width)
            patch.touched.clear()
        remaining = np.unique([patch.origin.get(f, f) for f in waiting]).astype(np.int32)
        (faces, origin), lines = patch.result(), patch.lines
        merged, left = np.union1d(merged, np.setdiff1d(of[found], of[remaining])), of[remaining]
        of = of[origin]
        if len(left):
            break
    return faces, of, lines, merged.astype(np.int32), left


class _Patch:
    """A mesh that changes in few places: changed faces are kept beside the arrays.

    Attributes:
        scale: #V, mean length of the edges at each vertex before the changes [m].
        changed: the corners of each changed face; None for one that is gone.
        origin: the face that each new face comes from.
        touched: faces changed since it was last cleared.
    """

    def __init__(self, vertices: FloatArray, faces: IntArray, lines: dict[str, list[int]], tolerance: float) -> None:
        self.vertices = vertices
        self.faces = faces
        self.lines = {name: list(line) for name, line in lines.items()}
        self.tolerance = tolerance
        self.scale = _vertex_scale(vertices, faces)
        self.changed: dict[int, tuple[int, ...] | None] = {}
        self.origin: dict[int, int] = {}
        self.next_face = len(faces)
        self.touched: set[int] = set()
        he = half_edges(faces)
        order = np.argsort(he.tail, kind="stable")
        self._face_of = he.face[order]
        self._start = np.searchsorted(he.tail[order], np.arange(len(vertices) + 1))
        self._around: dict[int, set[int]] = {}

    def corners(self, face: int) -> tuple[int, ...]:
        """Return the vertices of a face, or () if it is gone."""
        if face in self.changed:
            return self.changed[face] or ()
        row = self.faces[face].tolist()
        return tuple(row if row[3] >= 0 else row[:3])

    def around(self, vertex: int) -> set[int]:
        """Return the faces at a vertex."""
        if vertex not in self._around:
            self._around[vertex] = set(self._face_of[self._start[vertex] : self._start[vertex + 1]].tolist())
        return self._around[vertex]

    def neighbours(self, vertex: int) -> dict[int, int]:
        """Return the vertices joined to `vertex` by an edge, and the number of faces at each of these edges."""
        count: dict[int, int] = {}
        for face in self.around(vertex):
            ring = self.corners(face)
            at = ring.index(vertex)
            for other in (ring[at - 1], ring[(at + 1) % len(ring)]):
                count[other] = count.get(other, 0) + 1
        return count

    def on_border(self, vertex: int) -> bool:
        return 1 in self.neighbours(vertex).values()

    def width(self, face: int) -> float:
        ring = self.corners(face)
        return float(_width(points_at(self.vertices, np.array(ring)))) if ring else np.inf

    def normal(self, ring: Iterable[int]) -> FloatArray:
        p = self.vertices[list(ring)]
        return np.cross(p[2] - p[0], p[-1] - p[1] if len(p) == 4 else p[2] - p[1])

    def is_narrow(self, ring: tuple[int, ...], factor: float = 1.0) -> bool:
        points = np.array(ring)
        return bool(_width(points_at(self.vertices, points)) <= factor * self.tolerance * self.scale[points].mean())

    def is_degenerate(self, face: int) -> bool:
        ring = self.corners(face)
        return bool(ring) and self.is_narrow(ring)

    def replace_face(self, face: int | None, ring: tuple[int, ...] | None, origin: int = -1) -> None:
        """Give a face (None: a new one, part of `origin`) the corners `ring` (None: remove it)."""
        if face is None:
            face = self.next_face
            self.next_face += 1
            self.origin[face] = self.origin.get(origin, origin)
        for vertex in self.corners(face) if face in self.changed or face < len(self.faces) else ():
            self.around(vertex).discard(face)
        # Collected before the face changes: a vertex that is asked for the first time is looked up in the arrays.
        places = [self.around(vertex) for vertex in ring or ()]
        self.changed[face] = ring
        for place in places:
            place.add(face)
        if ring:
            self.touched.add(face)

    def remove_degenerate(self, face: int) -> bool:
        """Take one step that rids the mesh of a degenerate face; return false if there is none."""
        ring = self.corners(face)
        points = self.vertices[list(ring)]
        length = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
        around = float(self.scale[list(ring)].mean())
        short, long = int(np.argmin(length)), int(np.argmax(length))
        ends = ring[short], ring[(short + 1) % len(ring)]
        if length[short] <= _SHORT * self.tolerance * around and self.collapse(*ends, anywhere=True):
            return True
        if len(ring) == 4:
            at = 0 if np.linalg.norm(points[2] - points[0]) <= np.linalg.norm(points[3] - points[1]) else 1
            turned = ring[at:] + ring[:at]
            self.replace_face(face, turned[:3])
            self.replace_face(None, (turned[0], turned[2], turned[3]), origin=face)
            return True
        if (
            self.remove_cap(face, long)
            or self.remove_cap_pair(face, long, around)
            or self.remove_cap_beside(face, long)
        ):
            return True
        return bool(length[short] <= _LAST_RESORT * around) and self.collapse(*ends, anywhere=False)

    def collapse(self, a: int, b: int, *, anywhere: bool) -> bool:
        """Merge one end of the edge a-b into the other, and return whether that was possible.

        Args:
            a, b: vertices.
            anywhere: true to merge also along the border and feature lines.
        """
        on_line = [any(v in line for line in self.lines.values()) for v in (a, b)]
        border = [self.on_border(v) for v in (a, b)]
        tries = sorted([(on_line[0], border[0], -a, a, b), (on_line[1], border[1], -b, b, a)])
        for line, edge, _, gone, kept in tries:
            if (line or edge) and not anywhere:
                continue
            if edge and self.neighbours(gone)[kept] != 1:
                continue
            # Every line through `gone` must also run through `kept` next to it.
            through = [row for row in self.lines.values() if gone in row] if line else []
            if not all(any({x, y} == {gone, kept} for x, y in pairwise(row)) for row in through):
                continue
            new = self._faces_after_collapse(gone, kept) if self._may_collapse(gone, kept) else None
            if new is None:
                # That would spoil the surface.
                continue
            for face, ring in new.items():
                self.replace_face(face, ring)
            for name, row in self.lines.items():
                moved = [kept if v == gone else v for v in row]
                self.lines[name] = [v for i, v in enumerate(moved) if i == 0 or v != moved[i - 1]]
            return True
        return False

    def _may_collapse(self, gone: int, kept: int) -> bool:
        """Return whether the surface stays manifold, with the same border, when the edge between two vertices is collapsed."""
        apexes = set()
        for face in self.around(gone) & self.around(kept):
            ring = self.corners(face)
            if (ring.index(gone) - ring.index(kept)) % len(ring) not in (1, len(ring) - 1):
                return False
            if len(ring) == 3:
                apexes |= set(ring) - {gone, kept}
        # The link condition: else the collapse would glue parts of the surface that are apart.
        of_gone, of_kept = self.neighbours(gone), self.neighbours(kept)
        if set(of_gone) & set(of_kept) != apexes or any(of_gone[x] + of_kept[x] < 3 for x in apexes):
            return False
        return self.on_border(kept) or not self.on_border(gone)

    def _faces_after_collapse(self, gone: int, kept: int) -> dict[int, tuple[int, ...] | None] | None:
        """Return the new corners of the faces at `gone` (None: the face vanishes); None if one of them would be degenerate or turn over."""
        both = self.around(gone) & self.around(kept)
        new: dict[int, tuple[int, ...] | None] = {}
        for face in self.around(gone):
            ring = self.corners(face)
            if face in both:
                new[face] = tuple(v for v in ring if v != gone) if len(ring) == 4 else None
            else:
                new[face] = tuple(kept if v == gone else v for v in ring)
            corners = new[face]
            if corners is None:
                continue
            if self.is_narrow(ring):
                # It may stay narrow, but become no narrower.
                old_width, width = (_width(points_at(self.vertices, np.array(each))) for each in (ring, corners))
                if len(corners) != len(ring) or width < old_width:
                    return None
            elif self.is_narrow(corners) or float(self.normal(ring) @ self.normal(corners)) <= 0:
                return None
        nothing_left = all(ring is None for ring in new.values()) and len(self.around(kept)) == len(both)
        return None if nothing_left else new

    def remove_cap(self, face: int, side: int, *, check: bool = True) -> bool:
        """Remove a cap: the neighbour across its longest edge (the one from corner `side`) becomes a fan around its far corner."""
        ring = self.corners(face)
        p, q, c = ring[side], ring[(side + 1) % 3], ring[(side + 2) % 3]
        along = [line for line in self.lines.values() if any({x, y} == {p, q} for x, y in pairwise(line))]
        if any(c in line for line in along):
            return False
        beside = self._across(face, p, q)
        if beside is None:
            if self.on_border(c):
                return False
            self.replace_face(face, None)
        else:
            # The cap, and the face across its longest edge, are replaced by a fan of triangles around c.
            far = self.corners(beside)
            at = far.index(p)
            chain = far[at:] + far[:at]
            if c in far or any(v in self.neighbours(c) for v in chain[1:-1]):
                return False
            new = [(c, x, y) for x, y in pairwise(chain)]
            if check:
                # Some may be narrow, too, if the edge that is given up is longer than the new ones. So the process ends, at a face
                # that is not narrow.
                narrow = [self.is_narrow(t) for t in new]
                places = self.vertices[[c, *chain]]
                lengths = np.linalg.norm(places[2:-1] - places[0], axis=1)
                if any(narrow) and (lengths >= np.linalg.norm(places[-1] - places[1])).any():
                    return False
                facing = self.normal(chain)
                if self.is_narrow(chain, _SHORT):
                    # Such a face does not tell the side.
                    facing = np.sum([self.normal(self.corners(f)) for v in (c, *chain) for f in self.around(v)], axis=0)
                if not all(thin or float(self.normal(t) @ facing) > 0 for t, thin in zip(new, narrow, strict=True)):
                    return False
            self.replace_face(face, None)
            self.replace_face(beside, new[0])
            for triangle in new[1:]:
                self.replace_face(None, triangle, origin=beside)
        for line in along:
            for i in range(len(line) - 1, 0, -1):
                if {line[i - 1], line[i]} == {p, q}:
                    line.insert(i, c)
        return True

    def remove_cap_beside(self, face: int, side: int) -> bool:
        """Remove the cap across a side of a face, which is narrow or almost so, and whose longest edge is another one."""
        ring = self.corners(face)
        beside = self._across(face, ring[side], ring[(side + 1) % 3])
        far = self.corners(beside) if beside is not None else ()
        if beside is None or len(far) != 3 or not self.is_narrow(far, _SHORT):
            return False
        points = self.vertices[list(far)]
        long = int(np.argmax(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)))
        return not {far[long], far[(long + 1) % 3]} <= set(ring) and self.remove_cap(beside, long)

    def remove_cap_pair(self, face: int, side: int, around: float) -> bool:
        """Remove two caps back to back, whose corners lie at almost the same place on their common longest edge."""
        ring = self.corners(face)
        p, q, c = ring[side], ring[(side + 1) % 3], ring[(side + 2) % 3]
        beside = self._across(face, p, q)
        if beside is None or len(self.corners(beside)) != 3:
            return False
        (d,) = set(self.corners(beside)) - {p, q}
        if np.linalg.norm(self.vertices[c] - self.vertices[d]) > _SHORT * self.tolerance * around:
            return False
        before = copy.deepcopy((self.changed, self.origin, self._around, self.lines, self.touched, self.next_face))
        if self.remove_cap(face, side, check=False) and self.collapse(c, d, anywhere=True):
            return True
        self.changed, self.origin, self._around, self.lines, self.touched, self.next_face = before
        return False

    def _across(self, face: int, p: int, q: int) -> int | None:
        """Return the face beside `face` at its side p-q."""
        for other in self.around(p) & self.around(q) - {face}:
            ring = self.corners(other)
            if ring[(ring.index(q) + 1) % len(ring)] == p:
                return other
        return None

    def result(self) -> tuple[IntArray, IntArray]:
        """Return all faces, in the order of the faces they come from, and these."""
        total = self.next_face
        faces = np.full((total, 4), -1, dtype=np.int32)
        faces[: len(self.faces)] = self.faces
        origin = np.arange(total, dtype=np.int32)
        keep = np.ones(total, dtype=bool)
        for face, ring in self.changed.items():
            keep[face] = ring is not None
            faces[face] = (*(ring or ()), *[-1] * (4 - len(ring or ())))
            origin[face] = self.origin.get(face, face)
        faces, origin = faces[keep], origin[keep]
        order = np.argsort(origin, kind="stable")
        return faces[order], origin[order]
