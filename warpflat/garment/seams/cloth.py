"""A garment's cloth while seams are drawn on it: a triangle mesh that is split along the zero lines of fields.

Faces are split, not edges followed, so that a seam is as smooth as its field. Where a line would pass a vertex closely and leave a
sliver, the vertex moves onto the line, along an edge and so within the surface.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpflat.core import BoolArray, FloatArray, project_on_segments
from warpflat.flat import SurfacePath, are_joined, components, half_edges, join_labels, split_faces_along
from warpflat.garment.seams.fields import TriangleMesh

__all__ = [
    "ALIKE",
    "BESIDE_LINE",
    "FACES",
    "ISLAND",
    "LEVELS",
    "SAME_WAY",
    "Cloth",
    "PieceMesh",
    "are_among",
    "edge_components",
    "section",
]

Ids = NDArray[np.int64]

# A line that passes a vertex within this share of an edge takes the vertex with it.
_NEAR = 0.2
# A line keeps this share of an edge away from a vertex that must stay: no needles arise.
_CLEAR = 0.04
#: Pieces, and seams, are alike if what is measured of them agrees within this share.
ALIKE = 0.015
#: Directions are the same from this cosine on, and cloth faces a direction from the second on: within 60 degrees.
SAME_WAY, FACES = 0.97, 0.5
#: Cloth within this share of the size is beside a line: what moves with the line fades over it.
BESIDE_LINE = 0.05
#: Girths, and how far cloth reaches, are measured at so many heights.
LEVELS = 32
#: An island of the other sign of less than this share of its part is a wrinkle, and so is such a curve beside the longest one of a plane.
ISLAND = 0.06


@dataclass(frozen=True, kw_only=True, eq=False)
class PieceMesh(TriangleMesh):
    """One piece that the seams leave: its mesh, and where each vertex and face was before."""

    vertex_of: Ids
    face_of: Ids


@dataclass(frozen=True, kw_only=True, eq=False)
class Cloth(TriangleMesh):
    """Triangles with values at their vertices, labels of their faces, and the edges along which they are cut.

    Attributes:
        vertices: #V by 3 [m].
        faces: #F by 3, wound so that normals point out of the garment.
        values: fields by name, #V each; vertices that are added have those of their edge.
        labels: of faces by name, #F each; parts of a face have those of the whole.
        seams: edges by the name of their seam, #E by 2.
    """

    values: Mapping[str, FloatArray] = field(default_factory=dict)
    labels: Mapping[str, NDArray[np.int64]] = field(default_factory=dict)
    seams: Mapping[str, Ids] = field(default_factory=dict)

    def seam_edges(self) -> Ids:
        """#E by 2, the edges of all seams, the lower vertex first, each once."""
        if not self.seams:
            return np.empty((0, 2), dtype=np.int64)
        return np.unique(np.sort(np.concatenate(list(self.seams.values())), axis=1), axis=0)

    def new_edges(self, edges: Ids) -> Ids:
        """Return those of some edges (#E by 2) that are of no seam, and not at the border."""
        return edges[~(are_among(edges, self.border_edges) | are_among(edges, self.seam_edges()))]

    def with_seam(self, name: str, edges: Ids) -> Cloth:
        """Return the cloth with edges added to a seam."""
        own = np.sort(edges, axis=1)
        if name in self.seams:
            own = np.unique(np.concatenate([self.seams[name], own]), axis=0)
        return replace(self, seams={**self.seams, name: own})

    def seam_length(self, name: str) -> float:
        """Return the length of a seam [m]."""
        return float(np.linalg.norm(np.diff(self.vertices[self.seams[name]], axis=1), axis=2).sum())

    def without_seam(self, name: str) -> Cloth:
        """Return the cloth with a seam closed again."""
        return replace(self, seams={key: edges for key, edges in self.seams.items() if key != name})

    def with_values(self, **values: FloatArray | None) -> Cloth:
        """Return the cloth with other fields; one that is None is left out."""
        every = {**self.values, **values}
        return replace(self, values={name: value for name, value in every.items() if value is not None})

    def with_labels(self, **labels: Ids | None) -> Cloth:
        """Return the cloth with other labels; one that is None is left out."""
        every = {**self.labels, **labels}
        return replace(self, labels={name: label for name, label in every.items() if label is not None})

    def marked(self, faces: Ids) -> BoolArray:
        """Return #F, whether a face is among those of some numbers."""
        return np.isin(np.arange(len(self.faces)), faces)

    def only(self, faces: BoolArray) -> Cloth:
        """Return some of the faces (#F) alone, with the vertices that they use, and what of the seams runs along them."""
        used, place = np.unique(self.faces[faces], return_inverse=True)
        number = np.full(len(self.vertices), -1, dtype=np.int64)
        number[used] = np.arange(len(used))
        made = Cloth(
            vertices=self.vertices[used],
            faces=place.reshape(-1, 3).astype(np.int64),
            values={name: value[used] for name, value in self.values.items()},
            labels={name: label[faces] for name, label in self.labels.items()},
        )
        seams = {name: np.sort(number[edges], axis=1) for name, edges in self.seams.items()}
        kept = {name: edges[are_among(edges, made.half_edges.edges)] for name, edges in seams.items()}
        return replace(made, seams=kept)

    def sleeve_of(self, mesh: PieceMesh) -> int:
        """Return the number of the sleeve, or of the hood behind the last one, of which a piece is; -1 for the trunk."""
        return int(np.median(self.labels["sleeve"][mesh.face_of])) if "sleeve" in self.labels else -1

    def parted(self, level: str | FloatArray, within: BoolArray, *, keep: float = ISLAND) -> Parted:
        """Split the faces of a region along the zero line of a field without its islands.

        Args:
            level: the name of a field, or one (#V) that is needed for this line alone.
            within: #F, the region.
            keep: share of the region's area from which a part of one sign is no island.
        """
        name = level if isinstance(level, str) else "line"
        cloth = self if isinstance(level, str) else self.with_values(line=level)
        cloth, positive, within = cloth.without_islands(name, within, keep=keep).split(name, within)
        edges = cloth.line_between(positive, within)
        return Parted(cloth if isinstance(level, str) else cloth.with_values(line=None), positive, within, edges)

    def without_islands(self, level: str, within: BoolArray, *, keep: float = ISLAND) -> Cloth:
        """Return the cloth with islands of the other sign removed from a field: small parts of what they lie in.

        Args:
            level: its name.
            within: #F, the faces in which islands are looked for.
            keep: share of their area from which a part is no island.
        """
        f, faces = self.values[level], self.faces[within]
        if len(faces) == 0:
            return self
        mass = np.bincount(faces.ravel(), np.repeat(self.face_areas[within], 3), minlength=len(f)) / 3.0
        used = mass > 0.0
        label = TriangleMesh(vertices=self.vertices, faces=faces).connected(lambda a, b: (f[a] > 0.0) == (f[b] > 0.0))
        small = used & (np.bincount(label, mass)[label] < keep * mass.sum())
        if not small.any():
            return self
        scale = 1e-2 * float(np.abs(f[used]).max())
        made = f.copy()
        made[small] = np.where(f[small] > 0.0, -1.0, 1.0) * np.minimum(np.abs(f[small]), scale)
        return self.with_values(**{level: made})

    def split(self, level: str, within: BoolArray) -> tuple[Cloth, BoolArray, BoolArray]:
        """Split faces along the zero line of a field.

        Args:
            level: the name of the field.
            within: #F, the faces that are split; neighbours follow where a shared edge is.

        Returns:
            The cloth; #F, true for the faces in which the field is positive; and #F, true for those that were within.
        """
        cloth = self._snapped(level, within)
        f, faces, count = cloth.values[level], cloth.faces, len(cloth.vertices)
        sides = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2)
        crossing = within[:, None] & (f[sides[:, :, 0]] * f[sides[:, :, 1]] < 0.0)
        key = sides[:, :, 0] * count + sides[:, :, 1]
        known = np.unique(key[crossing])
        hit = np.isin(key, known)
        middle = np.where(hit, count + np.searchsorted(known, key), -1)
        a, b = known // count, known % count
        t = np.clip(f[a] / (f[a] - f[b]), _CLEAR, 1.0 - _CLEAR)[:, None]
        values = {
            name: np.concatenate([value, (1.0 - t[:, 0]) * value[a] + t[:, 0] * value[b]])
            for name, value in cloth.values.items()
        }
        values[level] = np.concatenate([f, np.zeros(len(known))])
        vertices = np.concatenate([cloth.vertices, (1.0 - t) * cloth.vertices[a] + t * cloth.vertices[b]])
        parts, parents = [faces[~hit.any(axis=1)]], [np.flatnonzero(~hit.any(axis=1))]
        once = np.flatnonzero(hit.sum(axis=1) == 1)
        if len(once):
            k = hit[once].argmax(axis=1)
            i, j, o = (faces[once, (k + n) % 3] for n in range(3))
            m = middle[once, k]
            parts += [np.stack([i, m, o], axis=1), np.stack([m, j, o], axis=1)]
            parents += [once, once]
        twice = np.flatnonzero(hit.sum(axis=1) >= 2)
        if len(twice):
            # The corner between both split edges is cut off; what is left is a quad, split along its shorter diagonal.
            k = (~hit[twice]).argmax(axis=1)
            j, o, i = (faces[twice, (k + n) % 3] for n in (0, 1, 2))
            p, q = middle[twice, (k + 1) % 3], middle[twice, (k + 2) % 3]
            # Edges: j-o whole, o-i split by p, i-j split by q.
            first = np.linalg.norm(vertices[j] - vertices[p], axis=1) <= np.linalg.norm(
                vertices[o] - vertices[q], axis=1
            )
            parts += [
                np.stack([i, q, p], axis=1),
                np.where(first[:, None], np.stack([j, o, p], axis=1), np.stack([j, o, q], axis=1)),
                np.where(first[:, None], np.stack([j, p, q], axis=1), np.stack([o, p, q], axis=1)),
            ]
            parents += [twice, twice, twice]
        parent = np.concatenate(parents)
        order = np.argsort(parent, kind="stable")
        parent, split = parent[order], np.concatenate(parts)[order]
        seams = {}
        for name, edges in cloth.seams.items():
            key = edges[:, 0] * count + edges[:, 1]
            cut = np.isin(key, known)
            m = count + np.searchsorted(known, key[cut])
            halves = [np.stack([edges[cut, 0], m], axis=1), np.stack([edges[cut, 1], m], axis=1)]
            seams[name] = np.concatenate([edges[~cut], *halves])
        made = Cloth(
            vertices=vertices,
            faces=split,
            values=values,
            labels={name: label[parent] for name, label in cloth.labels.items()},
            seams=seams,
        )
        return made, values[level][split].sum(axis=1) > 0.0, within[parent]

    def _snapped(self, level: str, within: BoolArray) -> Cloth:
        """Return the cloth with vertices that the zero line passes closely moved onto it."""
        f = self.values[level].copy()
        # A line that passes a vertex within rounding passes through it: a sliver beside it would have no area.
        f[np.abs(f) <= 1e-9 * np.abs(f[self.faces[within]]).max(initial=0.0)] = 0.0
        he = self.half_edges
        edges = he.edges.astype(np.int64)
        held = np.zeros(len(f), dtype=bool)
        fixed = (he.count == 1) | are_among(edges, self.seam_edges())
        held[edges[fixed]] = True
        inside = np.zeros(len(edges), dtype=bool)
        inside[he.edge[within[he.face]]] = True
        crossing = np.flatnonzero(inside & (f[edges[:, 0]] * f[edges[:, 1]] < 0.0))
        a, b = edges[crossing].T
        t = f[a] / (f[a] - f[b])
        vertex, other = np.where(t < 0.5, a, b), np.where(t < 0.5, b, a)
        share = np.minimum(t, 1.0 - t)
        # A vertex of the border or of a seam keeps to it.
        near = (share < _NEAR) & (~held[vertex] | fixed[crossing])
        order = np.flatnonzero(near)[np.argsort(share[near], kind="stable")]
        taken, first = np.unique(vertex[order], return_index=True)
        row = order[first]
        # A neighbour that moves, too, would be aimed at where it is no more.
        moves = np.zeros(len(f), dtype=bool)
        moves[taken] = True
        keep = ~(moves[other[row]] & (share[row] > 0.0) & (taken > other[row]))
        taken, row = taken[keep], row[keep]
        zero = f == 0.0
        zero[taken] = True
        flat = self.faces[zero[self.faces].all(axis=1)]
        if len(flat):
            # A face all of whose corners lay on the line would be on neither side.
            off = flat[np.arange(len(flat)), np.abs(f[flat]).argmax(axis=1)]
            stay = ~np.isin(taken, off)
            taken, row = taken[stay], row[stay]
        weight = share[row]
        values = {}
        for name, value in self.values.items():
            moved = f.copy() if name == level else value.copy()
            moved[taken] = (1.0 - weight) * value[taken] + weight * value[other[row]]
            values[name] = moved
        values[level][taken] = 0.0
        vertices = self.vertices.copy()
        vertices[taken] += weight[:, None] * (self.vertices[other[row]] - self.vertices[taken])
        return replace(self, vertices=vertices, values=values)

    def drawn(self, path: SurfacePath) -> tuple[Cloth, Ids]:
        """Draw a path over the cloth, along edges.

        Vertices that it passes closely move onto it; those of borders and of seams stay.

        Args:
            path: on the cloth's own surface (see `as_surface`).

        Returns:
            The cloth, and the path's edges (#E by 2), without those along a border or a seam.

        Raises:
            InputError: the path crosses itself, or is shorter than the edges around it.
        """
        owner = [(name, edge) for name, edges in self.seams.items() for edge in edges]
        lines = {str(number): edge.astype(np.int32) for number, (_, edge) in enumerate(owner)}
        split = split_faces_along(replace(self.as_surface(), lines=lines), path)
        pieces: dict[str, list[tuple[int, int]]] = {name: [] for name in self.seams}
        for number, (name, _) in enumerate(owner):
            pieces[name] += pairwise(split.surface.lines[str(number)].tolist())
        weights, support = split.vertex_weights, np.maximum(split.vertex_support, 0)
        made = Cloth(
            vertices=split.surface.vertices.copy(),
            faces=split.surface.faces[:, :3].astype(np.int64),
            values={name: (weights * value[support]).sum(axis=1) for name, value in self.values.items()},
            labels={name: label[split.face_origin] for name, label in self.labels.items()},
            seams={
                name: np.unique(np.sort(np.array(own, dtype=np.int64).reshape(-1, 2), axis=1), axis=0)
                for name, own in pieces.items()
            },
        )
        held = np.union1d(made.border_edges, made.seam_edges())
        row = split.path.astype(np.int64)
        free = np.setdiff1d(row[1:-1] if row[0] != row[-1] else row, held)
        if len(free):
            along = np.concatenate([path.points, path.points[:1]]) if path.closed else path.points
            share, off = project_on_segments(made.vertices[free][:, None], along[:-1], along[1:])
            best = off.argmin(axis=1)
            at = share[np.arange(len(free)), best][:, None]
            made.vertices[free] = (1.0 - at) * along[best] + at * along[best + 1]
        edges = np.unique(np.sort(np.stack([row[:-1], row[1:]], axis=1), axis=1), axis=0)
        return made, made.new_edges(edges)

    def line_between(self, sides: NDArray[np.generic], within: BoolArray) -> Ids:
        """Return the edges (#E by 2) between faces of different sides (#F), both of them in `within` (#F)."""
        he = self.half_edges
        inner = np.flatnonzero(he.count[he.edge] == 2)
        order = inner[np.argsort(he.edge[inner], kind="stable")].reshape(-1, 2)
        one, other = he.face[order].T
        apart = (sides[one] != sides[other]) & within[one] & within[other]
        return he.edges[he.edge[order[apart, 0]]].astype(np.int64)

    @cached_property
    def parts(self) -> NDArray[np.int64]:
        """#F, the piece of each face that the seams leave."""
        seam = self.seam_edges()
        return components(self.faces.astype(np.int32), barrier=seam.astype(np.int32)).astype(np.int64)

    def pieces(self, among: BoolArray | None = None) -> Iterator[PieceMesh]:
        """Yield the pieces that the seams leave, vertices doubled where a seam has cloth of one piece on both sides.

        Args:
            among: #F, only those pieces that have some of these faces; all if not given.
        """
        part, seam = self.parts, self.seam_edges()
        for number in np.unique(part if among is None else part[among]).tolist():
            chosen = np.flatnonzero(part == number)
            faces = self.faces[chosen]
            # Corners at a vertex are one vertex where faces share an edge there that is not cut.
            he = half_edges(faces.astype(np.int32))
            inner = np.flatnonzero((he.count[he.edge] == 2) & ~are_among(he.edges, seam)[he.edge])
            pair = inner[np.argsort(he.edge[inner], kind="stable")].reshape(-1, 2)
            a, b = pair.T
            fan = join_labels(len(he.tail), np.concatenate([a, he.next[a]]), np.concatenate([he.next[b], b]))
            _, first = np.unique(fan, return_index=True)
            vertex = he.tail[first].astype(np.int64)
            yield PieceMesh(
                vertices=self.vertices[vertex],
                faces=fan.reshape(-1, 3).astype(np.int64),
                vertex_of=vertex,
                face_of=chosen,
            )


class Parted(NamedTuple):
    """A cloth that was split along the zero line of a field.

    Attributes:
        cloth: split.
        positive: #F, where the field is positive.
        within: #F, the region in which it was split.
        edges: #E by 2, the line.
    """

    cloth: Cloth
    positive: BoolArray
    within: BoolArray
    edges: Ids


def are_among(edges: NDArray[np.integer], others: NDArray[np.integer]) -> BoolArray:
    """Return #E, whether edges (#E by 2) are among others (#O by 2), whichever vertex is named first."""
    return are_joined(np.unique(np.sort(others, axis=1), axis=0), *edges.T)


def edge_components(edges: Ids, *, ends: Ids | None = None) -> list[Ids]:
    """Return the connected lines among edges (#E by 2), each as rows of edges.

    Args:
        edges: #E by 2.
        ends: vertices at which lines end, though others begin there.
    """
    if len(edges) == 0:
        return []
    passed = ~np.isin(edges, [] if ends is None else ends)
    # Edges are one line where they have a vertex in common that is no end.
    order = np.flatnonzero(passed.ravel())
    order = order[np.argsort(edges.ravel()[order], kind="stable")]
    same = edges.ravel()[order[1:]] == edges.ravel()[order[:-1]]
    label = join_labels(len(edges), order[1:][same] // 2, order[:-1][same] // 2)
    return [edges[label == number] for number in np.unique(label)]


def section(cloth: Cloth, f: FloatArray, within: BoolArray) -> tuple[float, FloatArray]:
    """Return length [m] and middle of the zero line of a field within some faces."""
    faces = cloth.faces[within]
    faces = faces[(f[faces].min(axis=1) < 0.0) & (f[faces].max(axis=1) >= 0.0)]
    ends = []
    for k in range(3):
        a, b = faces[:, k], faces[:, (k + 1) % 3]
        t = np.clip(f[a] / np.where(f[a] == f[b], 1.0, f[a] - f[b]), 0.0, 1.0)[:, None]
        cross = (f[a] >= 0.0) != (f[b] >= 0.0)
        ends.append(np.where(cross[:, None], (1.0 - t) * cloth.vertices[a] + t * cloth.vertices[b], np.nan))
    points = np.stack(ends, axis=1)
    low, high = np.nanmin(points, axis=1), np.nanmax(points, axis=1)
    steps = np.linalg.norm(high - low, axis=1)
    total = max(float(steps.sum()), 1e-300)
    return float(steps.sum()), (np.nanmean(points, axis=1) * steps[:, None]).sum(axis=0) / total
