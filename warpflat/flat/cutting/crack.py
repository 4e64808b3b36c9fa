"""The price of a cut without a trial: what a crack in a laid-out piece releases, by the linear response of the cloth around it.

The cloth is at rest in the plane with the stiffness K, the tangent of its own law. A crack along a row of vertices gives the
faces on its right a second copy of each, at x + d. To second order the energy falls by

    f . u + g . d - 1/2 (u, d) . [K B; B^T C] (u, d),

f the forces of all faces at the vertices, g those of the faces on the right at the copies, B and C the stiffness of these. u is eliminated
by one factor of K, whatever is cut: S = C - B^T K^-1 B, S d = g - B^T K^-1 f. Every dart, dart with two tips and seam along the row is a
block of S.

Both sides are sewn to each other again, so they stay equally long: between nodes of the row they turn against each other like links of a
chain. In this model they may lie over each other, too. Their opening is negative there, and nobody cuts so.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.polyline import arc_lengths
from warpflat.core.vectors import turned_left, unit
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.model.strain import area_beyond, corner_strain, worn_cell_strain
from warpflat.flat.solver.metric import StiffnessFactor, cell_forces, cell_stiffness
from warpflat.flat.surface.connectivity import border_of, join_labels
from warpflat.flat.surface.half_edges import half_edges_of, opposite_half_edges
from warpflat.flat.surface.paths.edge_paths import EdgeGraph

__all__ = ["ElasticCrack", "LaidCloth", "Parted", "Price"]

Ids = NDArray[np.int64]

# A row has so many nodes at most.
_NODES = 10
# Strains of a displacement are the difference of those of this share of it to either side.
_STEP = 1e-3
# The sides of what opens lie over each other by no more than this [m], or than this share of its opening.
_OVER, _OVER_SHARE = 1e-3, 0.05
# How much dearer a path is that strays from its line by its edges' mean length, and one that touches a border.
_STRAY, _AT_BORDER = 3.0, 1e3
# Mouths of darts are looked for in so many directions. A dart so much longer than its tip is away from the border leaves a flap.
_DIRECTIONS, _FLAP = 12, 2.0
# What holds an opening that nothing resists, as a share of the mean stiffness of all.
_HELD = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class Parted:
    """What a part of a crack does.

    Attributes:
        released: strain energy [J].
        openings: of each row, how far the sides part at each node [m]; negative where they would lie over each other.
        turned: by how much each mode of the crack moves.
    """

    released: float
    openings: list[FloatArray]
    turned: FloatArray


@dataclass(frozen=True, kw_only=True)
class Price:
    """What a cut would do, without a trial.

    Attributes:
        released: strain energy [J].
        relieved: cloth that comes back within its limits, less what leaves them [m2].
        length: of all its rows [m].
        opening: the widest gap between its sides [m].
        opens: whether it does, rather than that its sides lie over each other; what parts the piece is laid apart.
    """

    released: float
    relieved: float
    length: float
    opening: float
    opens: bool

    @property
    def per_metre(self) -> float:
        """Strain energy released for its length [J/m]."""
        return self.released / max(self.length, np.finfo(float).tiny)


class LaidCloth:
    """A piece that lies at rest in the plane: rows of its vertices, and cracks along them.

    Attributes:
        network, positions: the piece and its layout, #V by 2 [m].
        border: #V, true at borders.
    """

    def __init__(self, network: SpringNetwork, positions: FloatArray) -> None:
        """Factor the stiffness of a piece in a layout (#V by 2 [m]).

        A network of springs is read as the membrane of its cloth.
        """
        if network.model != "membrane":
            network = SpringNetwork.build(
                network.surface,
                network.fabric,
                positions,
                grain_angle=network.grain_angle,
                model="membrane",
                stretch=network.stretch,
            )
        self.network, self.positions = network, np.asarray(positions)
        cells, part = network.cell_arrays, network.cell_models[0]
        self.corner = cells.corner
        self.stiffness = cell_stiffness(network, self.positions, part)
        self.solve = StiffnessFactor(network, self.positions, cells=self.stiffness).solve
        self.force = cell_forces(network, self.positions, part)
        used = cells.faces >= 0
        pull = np.zeros_like(self.positions)
        np.add.at(pull, cells.faces[used], self.force[used])
        # How it would move on to the rest of this model: a layout is at rest only nearly.
        self.drift = self.solve(pull)
        strain = worn_cell_strain(network, self.positions, "membrane")
        self._strain, self._area = strain[0].numpy(), np.maximum(strain[3].numpy(), 0.0)
        self.before = self.beyond(self.drift[self.corner])
        self.border = np.zeros(network.vertex_count, dtype=bool)
        self.border[border_of(network.surface)] = True
        self.half_edges = half_edges_of(network.surface)
        self._opposite = opposite_half_edges(self.half_edges)
        tail, head = self.half_edges.tail.astype(np.int64), self.half_edges.head.astype(np.int64)
        key = tail * network.vertex_count + head
        self._order = np.argsort(key, kind="stable")
        self._key = key[self._order]

    def beyond(self, moved: FloatArray) -> float:
        """Return how much cloth is beyond its limits where the corners of cells move (#C by 3 by 2 [m]), to first order [m2]."""
        at = self.positions[self.corner]
        ahead, back = (corner_strain(self.network, at + step * moved) for step in (_STEP, -_STEP))
        strain = self._strain + (ahead - back) / (2.0 * _STEP)
        return area_beyond(self.network.fabric, strain, self._area)

    def nearest(self, among: Ids, place: FloatArray) -> int:
        """Return which of some vertices lies nearest to a place in the layout (2 [m])."""
        return int(among[np.linalg.norm(self.positions[among] - place, axis=1).argmin()])

    def row(self, start: int, end: int, off: FloatArray) -> Ids | None:
        """Return the vertices of a path along edges near to a line that does not touch a border on its way; None if there is none.

        Args:
            start, end: its first and last vertex.
            off: #V, how far each vertex lies from the line [m].
        """
        edges = self.half_edges.edges
        long = np.linalg.norm(np.diff(self.positions[edges], axis=1)[:, 0], axis=1)
        cost = long * (1.0 + _STRAY * off[edges].sum(axis=1) / long.mean())
        rim = self.border.copy()
        rim[[start, end]] = False
        cost = np.where(rim[edges].any(axis=1) | (self.half_edges.count < 2), _AT_BORDER * (cost + long.mean()), cost)
        found = EdgeGraph(self.network.surface).path(start, end, cost).astype(np.int64)
        return None if len(found) == 0 or rim[found].any() else found

    def row_of(self, origin: IntArray, path: IntArray) -> Ids | None:
        """Return a path as vertices of the layout, in which cuts have doubled some; None if it touches the border on its way.

        Args:
            origin: #V, for each vertex of the layout what the path calls it.
            path: along edges, from border to border or to a place inside.
        """
        order, edges = np.argsort(origin, kind="stable"), self.half_edges.edges
        inner = order[np.searchsorted(origin, path[1:-1], sorter=order)]
        if len(inner) == 0 or self.border[inner].any():
            return None
        # Of the copies of an end the one beside the path.
        first, last = (
            np.intersect1d(np.flatnonzero(origin == end), edges[(edges == beside).any(axis=1)])[:1]
            for end, beside in ((path[0], inner[0]), (path[-1], inner[-1]))
        )
        return np.concatenate([first, inner, last]).astype(np.int64)

    def price(self, rows: Sequence[Ids]) -> Price:
        """Return what a cut along rows of vertices would do, such as a row and its mirror image."""
        crack = ElasticCrack(self, rows)
        parted = crack.part([(0, len(at) - 1) for at in crack.at])
        widest = max(float(opening.max()) for opening in parted.openings)
        over = max(-float(opening.min()) for opening in parted.openings)
        return Price(
            released=parted.released,
            relieved=crack.relieved(parted),
            length=sum(float(at[-1]) for at in crack.at),
            opening=widest,
            opens=all(self.border[row[[0, -1]]].all() for row in rows) or over <= max(_OVER, _OVER_SHARE * widest),
        )

    def dart(self, mouth: int, tip: int) -> Ids | None:
        """Return the vertices of a straight dart in the layout; None if it meets the border, or runs along it and would leave a flap."""
        way, points = self.positions[tip] - self.positions[mouth], self.positions
        if np.linalg.norm(way) >= _FLAP * np.linalg.norm(points[self.border] - points[tip], axis=1).min():
            return None
        along = unit(way)
        return self.row(mouth, tip, np.abs((points - points[mouth]) @ [along[1], -along[0]]))

    def mouths(self, tip: int) -> Iterator[int]:
        """Yield the vertices of the border from which darts could run to a tip inside: in each of twelve directions the nearest."""
        rim = np.flatnonzero(self.border)
        ways = self.positions[rim] - self.positions[tip]
        far = np.linalg.norm(ways, axis=1)
        for angle in np.arange(_DIRECTIONS) * 2.0 * np.pi / _DIRECTIONS:
            seen = np.flatnonzero(ways @ [np.sin(angle), np.cos(angle)] > np.cos(np.pi / _DIRECTIONS) * far)
            if len(seen):
                yield int(rim[seen[far[seen].argmin()]])

    def sides(self, row: Ids) -> tuple[Ids, Ids]:
        """Return the corners of faces on the right of a row: the half-edge that begins in each, and its vertex's place in the row.

        A row's end inside of the piece has none: both sides hang together there.
        """
        he, place = self.half_edges, np.full(self.network.vertex_count, -1)
        place[row] = np.arange(len(row))
        corners = np.flatnonzero(place[he.tail] >= 0)
        count, local = self.network.vertex_count, np.full(len(he.tail), -1)
        local[corners] = np.arange(len(corners))
        key = row[:-1] * count + row[1:]
        # Half-edges along the row have their faces on the left.
        ahead = self._order[np.searchsorted(self._key, key)]
        back = self._opposite[ahead]
        cut = np.zeros(len(he.tail), dtype=bool)
        cut[ahead] = cut[back] = True
        crossed = corners[(self._opposite[corners] >= 0) & ~cut[corners]]
        fan = join_labels(len(corners), local[crossed], local[he.next[self._opposite[crossed]]])
        left = fan[local[np.concatenate([ahead, he.next[ahead]])]]
        right = fan[local[np.concatenate([back, he.next[back]])]]
        chosen = corners[np.isin(fan, np.setdiff1d(right, left))]
        return chosen, place[he.tail[chosen]]


class ElasticCrack:
    """A crack along rows of vertices of a laid piece, such as one row and its mirror image.

    Between `nodes` of a row the two sides turn against each other like links of a chain, so that both stay equally long.

    Attributes:
        rows: of vertices.
        nodes: of each row, places in it.
        at: of each row, how far along it its nodes lie [m].
    """

    def __init__(self, cloth: LaidCloth, rows: Sequence[Ids]) -> None:
        """Prepare what all parts of a crack have in common."""
        self.cloth, self.rows = cloth, [np.asarray(row) for row in rows]
        network, he = cloth.network, cloth.half_edges
        size, faces, face = network.vertex_count, network.cell_arrays.faces, network.cell_arrays.face
        self.nodes = [np.unique(np.rint(np.linspace(0, len(row) - 1, _NODES)).astype(int)) for row in self.rows]
        self.at, self._moves, begin = list[FloatArray](), list[FloatArray](), [0]
        # Way of the faces' corners in each mode.
        way = np.zeros((network.face_count, 4, sum(len(at) + 1 for at in self.nodes), 2))
        for row, at in zip(self.rows, self.nodes, strict=True):
            points = cloth.positions[row]
            arc = arc_lengths(points)
            # The modes of a row: what lies before the end of a link turns with it, by one radian; and both shifts.
            moves = np.zeros((len(row), len(at) + 1, 2))
            for k, (i, j) in enumerate(pairwise(at)):
                moves[: j + 1, k] = turned_left(points[np.maximum(np.arange(j + 1), i)] - points[j])
            moves[:, -2:] = np.eye(2)
            corner, place = cloth.sides(row)
            first, last = begin[-1], begin[-1] + moves.shape[1]
            way[he.face[corner], he.slot[corner], first:last] = moves[place]
            begin.append(last)
            self.at.append(arc[at])
            self._moves.append(moves[at])
        self._begin = begin
        touched = np.flatnonzero(np.asarray(way.any(axis=(1, 2, 3)))[face])
        slot = (faces[face[touched]][:, None, :] == cloth.corner[touched][:, :, None]).argmax(axis=2)
        self._touched, self._way = touched, way[face[touched][:, None], slot]
        pulled = np.einsum("ckilj,clmj->ckim", cloth.stiffness[touched], self._way, optimize=True)
        forces = np.zeros((size, 2, begin[-1]))
        np.add.at(forces, cloth.corner[touched], pulled)
        right_side = forces.reshape(2 * size, -1)
        self._back = cloth.solve(right_side)
        self._stiffness = np.einsum("ckmi,ckin->mn", self._way, pulled) - right_side.T @ self._back
        self._force = np.einsum("fkmi,fki->m", way, cloth.force) - right_side.T @ cloth.drift.ravel()

    def part(self, spans: Sequence[tuple[int, int]]) -> Parted:
        """Part the sides of each row between two of its nodes, given by number.

        They hang together at both nodes, but at an end of the row that lies on the border.
        """
        ways = []
        for number, (first, last) in enumerate(spans):
            moves, begin, row = self._moves[number], self._begin[number], self.rows[number]
            ends = ((0, first, 0), (-1, last, len(moves) - 1))
            held = [node for end, node, stop in ends if node != stop or not self.cloth.border[row[end]]]
            modes = [*range(first, last), len(moves) - 1, len(moves)]
            # Ways of these modes in which the sides hang together where they are to.
            free = null_space(moves[held][:, modes].transpose(0, 2, 1).reshape(-1, len(modes)))
            wide = np.zeros((len(self._force), free.shape[1]))
            wide[[begin + mode for mode in modes]] = free
            ways.append(wide)
        basis = np.concatenate(ways, axis=1)
        inner, force = basis.T @ self._stiffness @ basis, basis.T @ self._force
        inner += np.eye(len(force)) * (_HELD * np.trace(inner) / max(len(force), 1))
        turned = basis @ np.linalg.solve(inner, force)
        openings = []
        for number in range(len(spans)):
            own = turned[self._begin[number] : self._begin[number + 1]]
            points = self.cloth.positions[self.rows[number][self.nodes[number]]]
            along = np.gradient(points, axis=0)
            across = -turned_left(unit(along))
            openings.append((np.einsum("nmi,m->ni", self._moves[number], own) * across).sum(axis=1))
        return Parted(released=0.5 * float(self._force @ turned), openings=openings, turned=turned)

    def relieved(self, parted: Parted) -> float:
        """Return how much cloth comes back within its limits, less what leaves them [m2]."""
        cloth = self.cloth
        moved = (cloth.drift - (self._back @ parted.turned).reshape(-1, 2))[cloth.corner]
        moved[self._touched] += np.einsum("ckmi,m->cki", self._way, parted.turned)
        return cloth.before - cloth.beyond(moved)
