"""Necklines wider and deeper than the neck base: the neck's row slides on the form's own surface, and its neighbours follow."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpflat.core import (
    BoolArray,
    FloatArray,
    InputError,
    IntArray,
    arc_lengths,
    nearest_on_polyline,
    points_at_lengths,
    polyline_length,
    unit,
)
from warpflat.flat import vertex_normals
from warpflat.garment.mannequin.exact_closest import Closest
from warpflat.garment.mannequin.layout import Layout
from warpflat.garment.mannequin.sheet import fill_sheet, sheet_laplacian
from warpflat.garment.mannequin.slicer import Slicer

__all__ = ["Neckline", "widen_neck"]

# The neckline behind goes off the base of the neck in steps of so much [m].
_STEP = 0.004
# How much more upright edges weigh than those across, as the rows below a neckline follow it; the first that folds nothing is taken.
_ALONG_COLUMNS = (1.0, 4.0, 16.0, 64.0, 256.0)
# Share of corners that may look aside: those of a scan do so in its hollows. Beside a V or a square any of them shows.
_FOLDED = 0.002
# A corner that was folded has this area [m2] of its parallelogram once it is turned back.
_TURNED_BACK = 1e-5
# Brought back to the surface some fold again; so many times at most they are turned back.
_TURNS_BACK = 5
# A neckline deeper than this [cm] may fold the cloth below it.
_DEEP = 8.0


@dataclass(frozen=True, kw_only=True)
class Neckline:
    """How far a neckline lies from the base of the neck, along the form.

    Attributes:
        side_cm: along the shoulder seams [cm].
        front_cm, back_cm: along the centre lines [cm].
        side_share: what is added to `side_cm`, as a share of the shoulder seams.
        front_share, back_share: what is added to `front_cm` and `back_cm`, as a share of the centre lines down to the bust.
        front_power: of the superellipse in front: 2 is round, 1 a V, 6 nearly square.
    """

    side_cm: float = 0.0
    front_cm: float = 0.0
    back_cm: float = 0.0
    side_share: float = 0.0
    front_share: float = 0.0
    back_share: float = 0.0
    front_power: float = 2.0

    @staticmethod
    def ranges() -> dict[str, tuple[float, float]]:
        """Return the least and the greatest valid value of every number."""
        return {
            "side_cm": (0.0, 8.0), "front_cm": (0.0, 15.0), "back_cm": (0.0, 15.0), "side_share": (0.0, 0.6),
            "front_share": (0.0, 0.8), "back_share": (0.0, 0.8), "front_power": (1.0, 8.0),
        }  # fmt: skip

    @property
    def is_round(self) -> bool:
        """Whether it is neither a V nor a square."""
        return self.front_power == Neckline.front_power

    def in_cm(self, layout: Layout, vertices: FloatArray) -> Neckline:
        """Return the same neckline without shares.

        Args:
            layout, vertices: of the body or form (#V by 3 [m]) whose lines they are shares of.
        """
        side = np.mean([polyline_length(vertices[layout.lines[f"shoulder {each}"]]) for each in ("left", "right")])
        below = layout.level_row["bust"]
        front, back = (polyline_length(vertices[line[: len(line) - below]]) for line in _centres(layout).values())
        return Neckline(
            side_cm=self.side_cm + self.side_share * 100.0 * float(side),
            front_cm=self.front_cm + self.front_share * 100.0 * float(front),
            back_cm=self.back_cm + self.back_share * 100.0 * float(back),
            front_power=self.front_power,
        )


def widen_neck(layout: Layout, vertices: FloatArray, neckline: Neckline) -> FloatArray:
    """Return a form's vertices (#V by 3 [m]) with the neck's row moved to a wider neckline on the same surface.

    In front each half is a quarter of a superellipse from the centre line to the shoulder seam, in the plane into which the chest unrolls,
    its upright sections side by side. Behind, the neckline lies beside the base of the neck. What lies between
    it, the armholes and the bust follows smoothly.

    Raises:
        InputError: the neckline takes a whole shoulder seam, or is so deep that the cloth folds below it.
    """
    from scipy import sparse

    ids, laplacian, local = sheet_laplacian(layout, layout.level_row["bust"])
    quads = layout.faces[np.isin(layout.faces, ids).all(axis=1)]
    surface = _Surface(vertices, quads)
    neckline = neckline.in_cm(layout, vertices)
    seams, centres = [layout.lines[f"shoulder {side}"] for side in ("left", "right")], _centres(layout)
    out, neck, side = vertices.copy(), layout.neck[0], 0.01 * neckline.side_cm
    for seam in seams:
        # The seam begins later; its outer end stays.
        at = arc_lengths(vertices[seam])
        if side > at[-1] - 0.02:
            raise InputError(f"neckline: side_cm is {100 * side:g}, but the shoulder is {100 * at[-1]:.1f} cm long")
        out[seam] = points_at_lengths(vertices[seam], side + (at[-1] - side) * at / at[-1])
    for face, patch, depth_cm in (("front", layout.front, neckline.front_cm), ("back", layout.back, neckline.back_cm)):
        patches = [patch, *(layout.yokes[f"{face}-{each}"] for each in ("left", "right"))]
        half = _Surface(vertices, quads[np.isin(quads, np.concatenate([p.ravel() for p in patches])).all(axis=1)])
        top, depth = centres[face][0], 0.01 * depth_cm
        out[top] = points_at_lengths(vertices[centres[face]], [depth])[0]
        for seam in seams:
            # The shorter part of the neck's closed row between the centre line and the seam.
            first, last = (int(np.flatnonzero(neck == vertex)[0]) for vertex in (top, seam[0]))
            parts = (np.arange((last - first) % len(neck) + 1), -np.arange((first - last) % len(neck) + 1))
            quarter = np.asarray(neck[(first + min(parts, key=len)) % len(neck)])
            ends = out[quarter[0]], out[quarter[-1]]
            if face == "back":
                out[quarter] = half.beside(vertices[quarter], depth, side, ends)
            else:
                share = arc_lengths(vertices[quarter]) / arc_lengths(vertices[quarter])[-1]
                out[quarter[1:-1]] = half.superellipse(share[1:-1], neckline.front_power, ends)
    fixed = [layout.neck[0], *seams, layout.rings[layout.level_row["bust"]], *(arm[0] for arm in layout.arms.values())]
    moved = np.setdiff1d(ids, np.concatenate(fixed))
    upright, few = _corners_upright(vertices, quads), (_FOLDED if neckline.is_round else 0.0) * quads.size

    def laid(wished: FloatArray) -> tuple[FloatArray, int]:
        """Return the vertices with those that follow laid on the surface near to where they are wished, and how many corners are folded."""
        placed = out.copy()
        placed[moved] = surface.nearest(wished[moved])
        # What lies on a centre line stays on it.
        for line in centres.values():
            for vertex in np.intersect1d(line, moved):
                placed[vertex] = nearest_on_polyline(placed[vertex], vertices[line])
        return placed, int((upright & ~_corners_upright(placed, quads, along=vertices)).sum())

    # Smooth as far as that keeps every quad upright; below a deep neckline each column of the grid is drawn together by itself instead.
    best, fewest = out, quads.size + 1
    for stiffness in _ALONG_COLUMNS:
        operator = laplacian
        if stiffness != 1.0:
            # Upright edges weigh more.
            pairs = (laplacian - sparse.diags(laplacian.diagonal())).tocoo()
            edge = vertices[ids][pairs.row] - vertices[ids][pairs.col]
            steep = edge[:, 1] ** 2 / (edge**2).sum(axis=1)
            entries = 1.0 + (stiffness - 1.0) * steep, (pairs.row, pairs.col)
            weights = sparse.coo_matrix(entries, laplacian.shape).tocsr()
            operator = weights - sparse.diags(np.asarray(weights.sum(axis=1)).ravel())
        shift = out - vertices
        fill_sheet(shift, layout, ids, operator[local[moved]], local[moved])
        placed, folded = laid(vertices + shift)
        if folded < fewest:
            best, fewest = placed, folded
        if folded <= few:
            break
    # Where something is folded still, around the tip of a V or on the narrow shoulder of a scan, it is turned back by itself.
    for _ in range(_TURNS_BACK):
        if fewest <= few:
            break
        placed, folded = laid(_unfolded(best, quads, moved, vertices))
        if folded >= fewest:
            break
        best, fewest = placed, folded
    # A round one that is not deep, as forms ask for by themselves, is drawn as well as it can be on anybody.
    is_deep = max(neckline.front_cm, neckline.back_cm) > _DEEP or not neckline.is_round
    if fewest > few and is_deep:
        raise InputError("neckline: the cloth folds below it; make it less deep: a smaller front_cm or back_cm")
    return best


def _centres(layout: Layout) -> dict[str, IntArray]:
    """Return the centre lines in front and behind, from the base of the neck down to the ankle."""
    return {face: layout.lines[f"centre {face}"][-len(layout.neck) :: -1] for face in ("front", "back")}


def _corners_upright(points: FloatArray, quads: IntArray, along: FloatArray | None = None) -> BoolArray:
    """Return whether every corner of every quad looks the way that the quad looks, or looked `along` (#F by 4)."""
    corners = points[quads]
    before = corners if along is None else along[quads]
    normal = np.cross(before[:, 2] - before[:, 0], before[:, 3] - before[:, 1])
    ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    return np.asarray((np.cross(ahead, behind) * normal[:, None]).sum(axis=2) > 0.0)


def _unfolded(points: FloatArray, quads: IntArray, moved: IntArray, along: FloatArray) -> FloatArray:
    """Return points moved as little as it takes until every corner of every quad looks `along` as it did.

    Least squares of what the area of each corner's parallelogram lacks; Escobar et al., Comput. Methods Appl. Mech. Eng. 192 (2003),
    untangle so.
    """
    from scipy.optimize import minimize

    before = along[quads]
    normal = np.cross(before[:, 2] - before[:, 0], before[:, 3] - before[:, 1])
    normal = (normal / np.linalg.norm(normal, axis=1)[:, None])[:, None]
    out = points.copy()

    def lacking(row: FloatArray) -> tuple[float, FloatArray]:
        out[moved] = row.reshape(-1, 3)
        corners = out[quads]
        ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
        short = np.maximum(0.0, _TURNED_BACK - (np.cross(ahead, behind) * normal).sum(axis=2)) / _TURNED_BACK
        pull = -2.0 * short[:, :, None] / _TURNED_BACK
        to_ahead, to_behind = pull * np.cross(behind, normal), pull * np.cross(normal, ahead)
        gradient = np.zeros_like(out)
        np.add.at(gradient, np.roll(quads, -1, axis=1), to_ahead)
        np.add.at(gradient, np.roll(quads, 1, axis=1), to_behind)
        np.add.at(gradient, quads, -(to_ahead + to_behind))
        return float((short**2).sum()), gradient[moved].ravel()

    found = minimize(
        lacking, points[moved].ravel(), jac=True, method="L-BFGS-B", options={"maxiter": 300, "ftol": 1e-12}
    )
    out[moved] = found.x.reshape(-1, 3)
    return out


class _Surface:
    """A quad mesh that points are brought back to; four triangles around the middle of each quad keep mirror images alike."""

    def __init__(self, vertices: FloatArray, quads: IntArray) -> None:
        middles = len(vertices) + np.arange(len(quads))
        triangles = [np.column_stack([quads[:, [k, (k + 1) % 4]], middles]) for k in range(4)]
        self.vertices = np.vstack([vertices, vertices[quads].mean(axis=1)])
        self.triangles = np.concatenate(triangles).astype(np.int64)
        self._closest = Closest(self.vertices, self.triangles)
        normals = vertex_normals(vertices, quads)
        self._normals = np.vstack([normals, normals[quads].mean(axis=1)])

    def _at(self, values: FloatArray, points: FloatArray) -> FloatArray:
        """Return what goes with the vertices (#V by 3) at the places nearest to points (#P by 3)."""
        triangle, weights, _ = self._closest(points)
        return np.asarray((values[self.triangles[triangle]] * weights[:, :, None]).sum(axis=1))

    @cached_property
    def _slicer(self) -> Slicer:
        return Slicer(self.vertices, self.triangles)

    def nearest(self, points: FloatArray) -> FloatArray:
        """Return the nearest points of the surface (#P by 3 [m])."""
        return self._at(self.vertices, points)

    def beside(self, line: FloatArray, first: float, last: float, ends: tuple[FloatArray, FloatArray]) -> FloatArray:
        """Return a line on the surface beside another one (#P by 3 [m]): square to it, so far [m] from its first and its last point.

        Args:
            line: on the surface; the new one lies on the side where the surface is.
            first, last: distances [m]; in between they change as a sine squared.
            ends: where the new line's ends lie.
        """
        count = max(1, math.ceil(max(first, last) / _STEP))
        share = arc_lengths(line) / arc_lengths(line)[-1]
        step = (first + (last - first) * np.sin(0.5 * np.pi * share) ** 2) / count
        inner = self.vertices[self.triangles].mean(axis=(0, 1))
        out = line
        for _ in range(count):
            square = unit(np.cross(self._at(self._normals, out), np.gradient(out, axis=0)))
            square *= np.sign((square * (inner - out)).sum())
            out = self.nearest(out + step[:, None] * square)
        share = (arc_lengths(out) / arc_lengths(out)[-1])[:, None]
        out = self.nearest(out + (1.0 - share) * (ends[0] - out[0]) + share * (ends[1] - out[-1]))
        out[[0, -1]] = ends
        return out

    def superellipse(self, share: FloatArray, power: float, ends: tuple[FloatArray, FloatArray]) -> FloatArray:
        """Return points of a quarter of a superellipse between two ends, drawn where the surface unrolls (#P by 3 [m]).

        Args:
            share: #P, of its length.
            power: of the superellipse.
            ends: in the centre and at the shoulder [m].
        """
        centre, shoulder = ends
        turn = 0.5 * np.pi * share
        if power != Neckline.front_power:
            # A V and a square are not turned through evenly as they are walked along.
            fine = np.linspace(0.0, 0.5 * np.pi, 513)
            wide, high = np.abs(shoulder - centre)[:2]
            walked = arc_lengths(
                np.column_stack([wide * np.sin(fine) ** (2.0 / power), -high * np.cos(fine) ** (2.0 / power)])
            )
            turn = np.interp(share * walked[-1], walked, fine)
        across, up = np.sin(turn) ** (2.0 / power), 1.0 - np.cos(turn) ** (2.0 / power)
        # Just beside the seams, so that the sections do not run along edges of the mesh.
        sides = centre[0] + (shoulder[0] - centre[0]) * np.clip([0.0, *across, 1.0], 0.01, 0.99)
        sections = [self.upright(float(x)) for x in sides]
        low, high = (
            float(np.interp(end[1], section[:, 1], arc_lengths(section)))
            for end, section in ((centre, sections[0]), (shoulder, sections[-1]))
        )
        wished = zip(sections[1:-1], low + (high - low) * up, strict=True)
        return self.nearest(np.array([points_at_lengths(section, [length])[0] for section, length in wished]))

    def upright(self, x: float) -> FloatArray:
        """Return the section at `x` [m], #P by 3 from low to high."""
        line = self._slicer.points(np.array([1.0, 0.0, 0.0]), x)
        return line[np.argsort(line[:, 1])]
