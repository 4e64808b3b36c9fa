"""A path is worked into the edges of a flattened piece here, so that it can be cut along it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.flat.cutting.cut_plan import CutPlan, make_cuts
from warpflat.flat.flattening.result import Flattening, require_unsewn
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.surface.cut.split_faces import split_faces_along
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.paths.trace import SurfacePath

__all__ = ["network_on_faces", "refine_along"]


def refine_along(result: Flattening, name: str, path: SurfacePath) -> tuple[Flattening, IntArray]:
    """Work a path into the edges of a piece, whose layout stays; return the piece and the path's vertices.

    The refined mesh has springs of its own: compare energies with those of the refined piece, once it is relaxed.

    Raises:
        InputError: the name is taken, or the path crosses itself.
    """
    require_unsewn(result)
    if name in result.surface.lines:
        raise InputError(f"piece {result.surface.name!r} already has a line {name!r}; call the cut something else")
    old = result.surface
    # The cuts made so far and the datum are carried through as lines of their own.
    hidden = {f"\0{c}.{k}": row for c, made in enumerate(result.cuts) for k, row in enumerate(made.paths)}
    drawn = split_faces_along(replace(old, lines={**old.lines, **hidden, "\0datum": result.datum}), path)
    through = drawn.surface.lines
    kept = {key: line for key, line in through.items() if not key.startswith("\0")}
    surface = replace(drawn.surface, lines={**kept, name: drawn.path})
    plans = [
        replace(CutPlan.from_applied(made), paths=tuple(through[f"\0{c}.{k}"] for k in range(len(made.paths))))
        for c, made in enumerate(result.cuts)
    ]
    made = make_cuts(surface, plans)
    positions = np.zeros((len(made.surface.vertices), 2))
    for slot in range(4):
        face = np.flatnonzero(surface.faces[:, slot] >= 0)
        corner, base = surface.faces[face, slot], drawn.face_origin[face]
        place = np.zeros((len(face), 2))
        for k in range(3):
            vertex, weight = drawn.vertex_support[corner, k], drawn.vertex_weights[corner, k]
            at = np.argmax(old.faces[base] == vertex[:, None], axis=1)
            place += np.where(vertex >= 0, weight, 0.0)[:, None] * result.positions[result.faces[base, at]]
        positions[made.surface.faces[face, slot]] = place
    network = network_on_faces(result, made.surface, positions, drawn.face_origin)
    weight = np.where(drawn.vertex_support >= 0, drawn.vertex_weights, 0.0)
    developed = (weight[..., None] * result.development.positions[drawn.vertex_support]).sum(axis=1)
    refined = replace(
        result,
        surface=surface,
        network=network,
        development=replace(result.development, positions=developed),
        positions=positions,
        cuts=made.cuts,
        datum=through["\0datum"],
        close=None if result.close is None else result.close[drawn.face_origin],
    )
    return refined, drawn.path


def network_on_faces(
    result: Flattening, surface: Surface, positions: FloatArray, face_origin: IntArray
) -> SpringNetwork:
    """Build the network of a flattened piece on other faces, each of which is one of its own or a part of one.

    Args:
        result: the piece, with its fabric, grain and stretch.
        surface: with the other faces.
        positions: #P by 2, the layout of that surface [m].
        face_origin: for each of its faces the piece's own.
    """
    stretch = result.network.stretch
    return SpringNetwork.build(
        surface,
        result.fabric,
        positions,
        grain_angle=result.grain_angle,
        device=result.network.device,
        model="membrane" if result.network.model == "membrane" else None,
        stretch=None if stretch is None else stretch[face_origin],
    )
