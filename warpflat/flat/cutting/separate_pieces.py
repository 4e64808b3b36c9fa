"""A piece that cuts have parted becomes several pieces here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpflat.flat.cutting.cut_plan import CutPlan, CutSurface, make_cuts
from warpflat.flat.cutting.refine_piece import network_on_faces
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.model.strain import strain_energy
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.surface.connectivity import border_of
from warpflat.flat.surface.cut.crack import Crack
from warpflat.flat.surface.cut.pieces import CutPart, split_pieces
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.paths.edge_paths import EdgeGraph, path_length

__all__ = ["cut_surfaces", "separate"]

# Of a part's border so many places may be ends of its datum.
_ENDS = 400


def separate(result: Flattening) -> tuple[Flattening, ...]:
    """Separate a result into one per piece that the cuts have left, each with its own name, network, measures and cuts.

    One piece is returned as it is. Names end in where the pieces lie to each other (see
    :func:`warpflat.flat.surface.cut.pieces.split_pieces`). The last stage has the energies of the piece, the earlier ones those of the
    whole.
    """
    made = make_cuts(result.surface, [CutPlan.from_applied(one) for one in result.cuts])
    return tuple(_part(result, piece) for piece in _split(result.surface, made)) or (result,)


def cut_surfaces(surface: Surface, plans: Sequence[CutPlan]) -> tuple[Surface, ...]:
    """Return the surfaces of the pieces that all cuts will leave, with their names and lines; nothing is flattened.

    Raises:
        InputError: as :func:`cut`.
    """
    made = make_cuts(surface, plans)
    return tuple(piece.surface for piece in _split(surface, made)) or (made.surface,)


def _split(surface: Surface, made: CutSurface) -> tuple[CutPart, ...]:
    """Return the pieces that cuts leave; none if it is still one."""
    if made.cut is None or made.cut.component_count == made.cut.components_before == 1:
        return ()
    # A cut by several paths that parts the cloth is named by place like any other.
    kind = "split" if made.cut.kind == "network" else made.cut.kind
    return split_pieces(surface, replace(made.cut, kind=kind))


def _part(result: Flattening, piece: CutPart) -> Flattening:
    used = np.unique(piece.vertex_origin)
    number = np.full(len(result.surface.vertices), -1, dtype=np.int32)
    number[used] = np.arange(len(used), dtype=np.int32)
    origin = number[piece.vertex_origin]
    corners = piece.surface.faces
    glued = replace(
        piece.surface,
        vertices=result.surface.vertices[used],
        faces=np.where(corners >= 0, origin[corners], -1).astype(np.int32),
        lines={name: origin[line] for name, line in piece.surface.lines.items()},
        input_index=result.surface.input_index[used],
    )
    # The cut surface keeps the numbers of the uncut one first, then the copies.
    first = {int(v): i for i, v in reversed(list(enumerate(origin.tolist())))}
    originals = [first[v] for v in range(len(used))]
    order = np.array(originals + sorted(set(range(len(origin))) - set(originals)), dtype=np.int64)
    place = np.empty(len(order), dtype=np.int32)
    place[order] = np.arange(len(order), dtype=np.int32)
    cut_surface = replace(
        piece.surface,
        vertices=piece.surface.vertices[order],
        faces=np.where(corners >= 0, place[corners], -1).astype(np.int32),
        lines={name: place[line] for name, line in piece.surface.lines.items()},
        input_index=piece.surface.input_index[order],
    )
    positions = result.positions[piece.vertex_index[order]]
    network = network_on_faces(result, cut_surface, positions, piece.face_index)
    in_piece = np.full(len(result.positions), -1, dtype=np.int32)
    in_piece[piece.vertex_index[order]] = np.arange(len(order), dtype=np.int32)
    # The parts of cuts whose sides both lie in this piece.
    cuts = []
    for made in result.cuts:
        seams = tuple(
            Crack(path=number[seam.path], left=in_piece[seam.left], right=in_piece[seam.right])
            for seam in made.seams
            if (in_piece[seam.left] >= 0).all() and (in_piece[seam.right] >= 0).all()
        )
        if seams:
            paths = tuple(seam.path for seam in seams)
            cuts.append(replace(made, seams=seams, paths=paths, length=path_length(glued, paths)))
    datum = glued.lines.get(result.datum_name, np.empty(0, dtype=np.int32))
    has_line = len(datum) > 1
    if not has_line:
        # What the part has of the whole's datum, so that the grain of its layout stays when it is relaxed further.
        own = number[result.datum]
        runs = np.split(own, np.flatnonzero((own[1:] < 0) | (own[:-1] < 0)) + 1)
        datum = max((run for run in runs if run[0] >= 0), key=len, default=own[:0])
    if len(datum) <= 1:
        # Else a way through it that runs as upright. All places of a fine mesh would make millions of pairs.
        border, layout = border_of(glued), positions[: len(used)]
        loop = border[:: len(border) // _ENDS + 1]
        way = layout[loop] - layout[loop][:, None]
        # Of the chords that are half as tall as the part.
        tall = way[..., 1] >= 0.5 * np.ptp(layout[:, 1])
        low, high = np.unravel_index(
            np.where(tall, np.abs(way[..., 0]) / np.where(tall, way[..., 1], 1.0), np.inf).argmin(), tall.shape
        )
        datum = EdgeGraph(glued).path(int(loop[low]), int(loop[high]))
    energies = Relaxation(network, RelaxOptions(), start=positions).energies()
    last = replace(
        result.stages[-1],
        model_energy_j=energies.potential,
        guard_energy_j=energies.guard,
        strain_energy_j=strain_energy(network, positions),
    )
    return replace(
        result,
        surface=glued,
        network=network,
        positions=positions,
        datum=datum,
        datum_name=result.datum_name if has_line else "datum",
        development=replace(result.development, positions=result.development.positions[used]),
        stages=(*result.stages[:-1], last),
        cuts=tuple(cuts),
        # They were found for the whole.
        remedies=(),
        close=None if result.close is None else result.close[piece.face_index],
        unsewn=None if result.unsewn is None else _part(result.unsewn, piece),
    )
