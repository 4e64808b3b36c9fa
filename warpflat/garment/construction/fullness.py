"""Fullness: more cloth than the body needs along an edge, to be eased or gathered into a shorter one.

The longer side of such a seam must not be stretched to its length, nor the shorter one compressed: the piece is meant
to be wider there. Its springs and cells are at rest at the body's lengths times a fullness s. The fullness is stated
along the edge and fades into the piece; log s is harmonic. For ease it fades near the edge. For gathers it fades down
to the next edge that is sewn plainly across the fullness, or runs through the whole piece if there is none, as in a
gathered skirt. Pattern makers get the same shape by slashing and spreading.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpflat.core import FloatArray, IntArray, polyline_length
from warpflat.flat import (
    Flattening,
    GrainAlignment,
    Relaxation,
    RelaxOptions,
    border_loops,
    given_options,
    grain_axes,
    make_stages,
    springs_of,
    step_matrix,
    stretch_factor,
    with_stiffness,
)
from warpflat.garment.construction.augmented_lagrangian import relax_under_equations
from warpflat.garment.construction.carry import falloff_weights

__all__ = ["FullEdge", "give_fullness", "measure_fullness"]


@dataclass(frozen=True, kw_only=True, eq=False)
class FullEdge:
    """An edge with more cloth than the body needs.

    Attributes:
        vertices: of the piece, along the edge.
        factor: length of the edge over its length on the body.
        gathered: the fullness runs on into the piece, along warp or weft, whichever is nearer to the edge's direction;
            otherwise it is eased in near the edge, equally in all directions.
    """

    vertices: IntArray
    factor: float
    gathered: bool


def give_fullness(
    piece: Flattening, edges: Sequence[FullEdge], sewn: Sequence[IntArray], *, options: RelaxOptions | None = None
) -> Flattening:
    """Give a piece fullness along some edges, and relax it again on its own.

    Args:
        piece: flattened, uncut.
        edges: which edges, and how much.
        sewn: vertices along each of its edges that are sewn, with fullness or without.
        options: of the relaxation.
    """
    options = given_options(options)
    plain = [row for row in sewn if not any(row is edge.vertices for edge in edges)]
    full = measure_fullness(piece, edges, plain)
    warp, weft = axes = grain_axes(piece.grain_angle)
    # Gathers slant the mesh's edges off the grain, and springs along them would be another cloth.
    is_membrane = piece.network.model == "membrane" or any(edge.gathered for edge in edges)
    # The network at rest where the layout is wider by its fullness.
    springs, surface = piece.network.spring_arrays, piece.network.surface
    before = (piece.positions[springs.ends[:, 1]] - piece.positions[springs.ends[:, 0]]) @ np.column_stack(axes)
    here = 0.5 * (full[springs.ends[:, 0]] + full[springs.ends[:, 1]])
    longer = springs.listed(springs.rest_length * stretch_factor(before, here))
    if not is_membrane:
        # By what factors a quad's first edges and its others become longer: only springs of a membrane keep their stiffness.
        of_quad, q = full[surface.faces].mean(axis=1), piece.positions[surface.faces] @ np.column_stack(axes)
        sides = q[:, 1] - q[:, 0] + q[:, 2] - q[:, 3], q[:, 2] - q[:, 1] + q[:, 3] - q[:, 0]
        wider = np.column_stack([stretch_factor(side, of_quad) for side in sides])
        springs = springs_of(
            surface, piece.network.fabric, piece.positions, grain_angle=piece.network.grain_angle, wider=wider
        )
    springs = replace(springs, listed_length=longer)
    # Cells whose shape on the body, E, becomes E D^-1 S D: at rest where the layout D has been widened by S.
    cells = piece.network.cell_arrays
    here = full[cells.corner].mean(axis=1)
    widen = sum(here[:, k, None, None] * np.outer(axis, axis) for k, axis in enumerate(axes))
    p = piece.positions[cells.corner]
    flat = np.stack([p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]], axis=-1)
    a, b = np.moveaxis(cells.edges @ np.linalg.solve(flat, widen @ flat), -1, 0)
    # The first side lies along x again: F matters only up to a rotation.
    length = np.maximum(np.linalg.norm(a, axis=1), np.finfo(np.float64).tiny)
    across = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / length
    cells = replace(cells, laid=np.column_stack([length, np.einsum("ij,ij->i", a, b) / length, across]))
    held, stretch = None, piece.network.stretch
    if is_membrane:
        meant = np.ones((len(cells.laid), 2)) if stretch is None else stretch[cells.face]
        weights, held = step_matrix(piece.fabric, axes, cells.corner, cells.edges, cells.area, piece.positions, meant)
        springs = with_stiffness(springs, cells, weights)
    network = replace(
        piece.network,
        spring_arrays=springs,
        cell_arrays=cells,
        model="membrane" if is_membrane else "springs",
        held_stiffness=held,
    )
    mean = full.mean(axis=0)
    widening = np.outer(warp, warp) * mean[0] + np.outer(weft, weft) * mean[1]
    alignment = GrainAlignment(lower=int(piece.datum[0]), upper=int(piece.datum[-1]))
    state = Relaxation(network, options, start=piece.positions @ widening, alignments=[alignment])
    outcome = relax_under_equations(state).outcome
    positions = state.positions()
    most = max(edge.factor for edge in edges)
    note = f"it has up to {100 * (most - 1.0):.3g} % more length than the body, to be eased or gathered in"
    notes = (*piece.notes, note)
    return replace(
        piece,
        network=network,
        positions=positions,
        stages=(*piece.stages, *make_stages("fullness", network, positions, outcome)),
        notes=notes,
        unsewn=piece.unsewn or piece,
    )


def measure_fullness(piece: Flattening, edges: Sequence[FullEdge], plain: Sequence[IntArray]) -> FloatArray:
    """Return by how much longer than on the body the cloth is meant to be along warp and weft (#V by 2)."""
    positions, faces = piece.positions, piece.faces
    axes = grain_axes(piece.grain_angle)
    log_full = np.zeros((len(positions), 2))
    for axis in (0, 1):
        along = [edge for edge in edges if edge.gathered and _runs_along(positions, edge.vertices, axes) == axis]
        if along:
            stops = [ids for ids in plain if _runs_along(positions, ids, axes) == axis]
            logs = [(edge.vertices, np.full(len(edge.vertices), np.log(edge.factor))) for edge in along]
            log_full[:, axis] += falloff_weights(faces, logs, stops, len(positions))
    # What an edge lacks where it runs across its gathers, as the flanks of a sleeve's cap do, all of what is eased in,
    # and the excess on slanting sides. A cap that lies flat is longer than over the round shoulder: that much of its ease it has.
    body, wanted = piece.network.surface.vertices, [(ids, 1.0) for ids in plain]
    for edge in edges:
        longer = polyline_length(positions[edge.vertices]) / polyline_length(body[edge.vertices])
        wanted.append((edge.vertices, edge.factor if edge.gathered else max(1.0, edge.factor / max(1.0, longer))))
    full, lacks = np.exp(log_full), []
    for ids, factor in wanted:
        across = np.diff(positions[ids], axis=0) @ np.column_stack(axes)
        here = 0.5 * (full[ids[1:]] + full[ids[:-1]])
        # The log of what is still missing of the factor, at each of the edge's vertices.
        lack = np.log(factor / stretch_factor(across, here))
        lacks.append((ids, 0.5 * (np.append(lack, lack[-1]) + np.append(lack[0], lack))))
    log_full += falloff_weights(faces, lacks, border_loops(faces), len(positions))[:, None]
    return np.asarray(np.exp(log_full))


def _runs_along(positions: FloatArray, line: IntArray, axes: tuple[FloatArray, FloatArray]) -> int:
    """Return 0 where the line's chord is nearer to the warp, 1 where it is nearer to the weft."""
    chord = positions[line[-1]] - positions[line[0]]
    return int(abs(float(chord @ axes[1])) > abs(float(chord @ axes[0])))
