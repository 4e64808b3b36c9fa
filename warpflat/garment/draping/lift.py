"""From a pattern in the plane to the surface that it was made of: of a run's folder, or of a mesh whose texture is its pattern."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from warpflat.core import (
    FARTHEST,
    FloatArray,
    InputError,
    IntArray,
    make_file_name,
    reading,
    reflected,
    turned_left,
    unit,
)
from warpflat.flat import SUFFIXES, read_mesh_file
from warpflat.garment.construction.another_body import BESIDE
from warpflat.garment.construction.as_cut import read_cut_pattern
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.pattern import MIRRORED, Pattern, Piece, read_pattern

__all__ = ["Lift", "lifts_on_scan", "moved_lift", "read_lift", "read_lifted", "surface_lift", "whole_lifts"]

#: The places on a surface (#P by 3 [m]) of points of its pattern (#P by 2 [m]); or what else is linear in its triangles.
Lift = Callable[[FloatArray], FloatArray]

# Triangles around a point that are tried.
_TRIED = 16


def read_lifted(path: Path, *, units: str | None, allowance: float | None) -> tuple[Pattern, dict[str, Lift]]:
    """Read a pattern, and by piece the way to its designed surface, which a run's folder and a mesh with its sewn pattern have.

    Args:
        path: a run's folder, a mesh whose texture is its sewn pattern, or a file of a pattern.
        units: of a mesh that does not say.
        allowance: from the boundary to the sewing line [m], where a file has none.

    Raises:
        InputError: a file cannot be read, or units are given of what says its own.
    """
    if path.suffix.lower() in SUFFIXES and not path.is_dir():
        worn = read_cut_pattern(path, units=units, name=make_file_name(path.stem))
        return worn.pattern, {name: surface_lift(*each) for name, each in worn.surfaces.items()}
    if units is not None:
        raise InputError(f"--units: is for a mesh whose texture is its pattern; {path} says its own")
    if not path.is_dir():
        return read_pattern(path, allowance=allowance), {}
    pattern = read_pattern(path / "pattern.json", allowance=allowance)
    files = {piece.name: path / f"{piece.name}.obj" for piece in pattern.pieces[pattern.sample]}
    return pattern, {name: read_lift(file) for name, file in files.items() if file.is_file()}


def read_lift(path: Path) -> Lift:
    """Return the map from a pattern to its surface in an OBJ file with the surface as `v` and the pattern as `vt`.

    A point beside the pattern, where an edge was smoothed, belongs to the triangle next to it.

    Raises:
        InputError: the file cannot be read, or has no pattern.
    """
    with reading(path, "piece"):
        _, mesh, _, _ = read_mesh_file(path, units="m", prim=None, name=None)
        polygons, texture = mesh.polygons, mesh.texture
        if texture is None or np.isnan(texture[polygons >= 0]).any():
            raise InputError("has faces without a pattern, 'f v/vt'; run the scene again")
        if not max(np.abs(mesh.vertices).max(), np.abs(texture[polygons >= 0]).max()) < FARTHEST:
            raise InputError(f"a vertex lies farther than {FARTHEST:g} m off; run the scene again")
        surface, pattern = [], []
        for k in range(1, polygons.shape[1] - 1):
            fan, rows = [0, k, k + 1], polygons[:, k + 1] >= 0
            surface.append(mesh.vertices[polygons[rows][:, fan]])
            pattern.append(texture[rows][:, fan])
        return _lift(np.concatenate(surface), np.concatenate(pattern))


def surface_lift(space: FloatArray, flat: FloatArray, triangles: IntArray) -> Lift:
    """Return the map from a pattern to its surface.

    Args:
        space: #V by 3, the surface [m]; or #V by any number, what goes with its vertices.
        flat: #V by 2, the pattern [m].
        triangles: #T by 3, of both.
    """
    return _lift(space[triangles], flat[triangles])


def moved_lift(lift: Lift, turn: FloatArray, shift: FloatArray) -> Lift:
    """Return the map to a surface that was moved: its points @ turn (3 by 3) + shift [m]."""
    return lambda points: lift(points) @ turn + shift


def lifts_on_scan(body: Mannequin, lifts: Mapping[str, Lift], pattern: Pattern) -> dict[str, Lift] | None:
    """Return the lifts to designed surfaces [m] that lie on a scan as their files stand, in the axes of its mannequin; None if they do not.

    Args:
        body: of a scan, in its pose.
        lifts: by piece.
        pattern: of the pieces.
    """
    assert body.placed is not None
    assert body.scan is not None
    turn, shift = body.placed
    # The surface is in metres, whatever the scan's unit.
    turn = turn / np.cbrt(np.linalg.det(turn))
    moved = {name: moved_lift(lift, turn, shift) for name, lift in lifts.items()}
    pieces = [piece for piece in pattern.pieces[pattern.sample] if piece.name in moved]
    borders = [moved[piece.name](edge.points) for piece in pieces for edge in piece.edges]
    far = cKDTree(body.scan[0]).query(np.concatenate(borders))[0]
    return moved if np.median(far) <= BESIDE else None


def _lift(surface: FloatArray, pattern: FloatArray) -> Lift:
    """Return the map of triangles in the pattern (#T by 3 by 2) to those in space (#T by 3 by 3)."""
    inverse = np.linalg.pinv(np.stack([pattern[:, 1] - pattern[:, 0], pattern[:, 2] - pattern[:, 0]], axis=-1))
    tree = cKDTree(pattern.mean(axis=1))

    def lift(points: FloatArray) -> FloatArray:
        near = np.asarray(tree.query(points, k=min(_TRIED, len(pattern)))[1]).reshape(len(points), -1)
        share = np.einsum("ptij,ptj->pti", inverse[near], points[:, None] - pattern[near, 0])
        weight = np.concatenate([1.0 - share.sum(axis=-1, keepdims=True), share], axis=-1)
        best = weight.min(axis=-1).argmax(axis=1)
        rows = np.arange(len(points))
        return np.asarray(np.einsum("pc,pcj->pj", weight[rows, best], surface[near[rows, best]]))

    return lift


def whole_lifts(pieces: Iterable[Piece], lifts: Mapping[str, Lift]) -> dict[str, Lift]:
    """Return the lifts of whole pieces, as of :func:`warpflat.pattern.drafting.whole_pieces.whole_pieces`: bodies are mirrored at x = 0."""
    found: dict[str, Lift] = {}
    for piece in pieces:
        if piece.name in lifts:
            lift = lifts[piece.name]
            found[piece.name] = _unfolded(piece, lift) if piece.on_fold else lift
            found[piece.name + MIRRORED] = _turned(lift)
    return found


def _turned(lift: Lift) -> Lift:
    return lambda points: lift(points * [-1.0, 1.0]) * [-1.0, 1.0, 1.0]


def _unfolded(piece: Piece, lift: Lift) -> Lift:
    start, end = next(edge for edge in piece.edges if edge.kind == "fold").points[[0, -1]]
    # The outline runs counter-clockwise: the half lies on the left of its fold.
    inwards = turned_left(unit(end - start)[None])[0]

    def unfolded(points: FloatArray) -> FloatArray:
        beyond = (points - start) @ inwards < 0.0
        found = lift(np.where(beyond[:, None], reflected(points, inwards, start @ inwards), points))
        found[beyond, 0] *= -1.0
        return found

    return unfolded
