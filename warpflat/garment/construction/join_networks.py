"""Pieces side by side: their networks as one network, for one set of launches."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warpflat.core import FloatArray, IntArray, range_offsets
from warpflat.flat import CellArrays, SpringArrays, SpringNetwork, SpringsAround, VertexLists, join_surfaces

__all__ = ["join_networks"]


def join_networks(networks: Sequence[SpringNetwork]) -> SpringNetwork:
    """Return the networks as one; nothing is sorted or measured again.

    A single network is returned as it is.

    Args:
        networks: of one fabric, grain and device; all or none with an intended stretch. Nothing is sewn or fixed yet.
    """
    first = networks[0]
    if len(networks) == 1:
        return first
    vertex = range_offsets([net.vertex_count for net in networks])
    stretches = [net.stretch for net in networks if net.stretch is not None]
    held = [np.zeros((net.cell_count, 3)) if net.held_stiffness is None else net.held_stiffness for net in networks]
    is_membrane = any(net.model == "membrane" for net in networks)
    # Springs are numbered mesh edges first, then diagonals, as in each network.
    springs = [net.spring_arrays for net in networks]
    edge = range_offsets([s.edge_count for s in springs])
    diagonal = edge[-1] + range_offsets([s.count - s.edge_count for s in springs])
    around = [s.around for s in springs]
    numbers = [
        of.entry + np.where(of.entry < s.edge_count, edge[k], diagonal[k] - np.int32(s.edge_count))
        for k, (s, of) in enumerate(zip(springs, around, strict=True))
    ]
    spring_arrays = SpringArrays(
        around=SpringsAround(
            offset=_join_offsets([a.offset for a in around]),
            neighbor=np.concatenate([a.neighbor + at for a, at in zip(around, vertex, strict=False)]),
            entry=np.concatenate(numbers),
        ),
        listed_length=np.concatenate([s.listed_length for s in springs]),
        listed_stiffness=np.concatenate([s.listed_stiffness for s in springs]),
        edge_count=int(edge[-1]),
        shear_deficit=_join_face_values(networks, "shear_deficit", 2),
        hourglass=_join_face_values(networks, "hourglass", 4),
    )
    cells = [net.cell_arrays for net in networks]
    face, of_cells = range_offsets([len(c.faces) for c in cells]), range_offsets([len(c.laid) for c in cells])
    cell_arrays = CellArrays(
        faces=np.concatenate(
            [np.where(c.faces >= 0, c.faces + at, np.int32(-1)) for c, at in zip(cells, vertex, strict=False)]
        ),
        first=np.concatenate([c.first + at for c, at in zip(cells, of_cells, strict=False)]),
        laid=np.concatenate([c.laid for c in cells]),
        around=VertexLists(
            offset=_join_offsets([c.around.offset for c in cells]),
            entry=np.concatenate([a.entry + 4 * at for a, at in zip([c.around for c in cells], face, strict=False)]),
        ),
    )
    return SpringNetwork(
        surface=join_surfaces([net.surface for net in networks]),
        fabric=first.fabric,
        grain_angle=first.grain_angle,
        spring_arrays=spring_arrays,
        cell_arrays=cell_arrays,
        device=first.device,
        model="membrane" if is_membrane else "springs",
        stretch=np.concatenate(stretches) if stretches else None,
        held_stiffness=np.concatenate(held) if is_membrane else None,
        parts=tuple((net.model, net.face_count) for net in networks),
    )


def _join_face_values(networks: Sequence[SpringNetwork], name: str, depth: int) -> FloatArray | None:
    """Return the values of the faces that `SpringArrays` have under a name, #F by `depth`; None if no piece has any."""
    arrays = [getattr(net.spring_arrays, name) for net in networks]
    if not any(array is not None for array in arrays):
        return None
    return np.concatenate(
        [np.zeros((net.face_count, depth)) if of is None else of for net, of in zip(networks, arrays, strict=True)]
    )


def _join_offsets(offsets: Sequence[IntArray]) -> IntArray:
    first = range_offsets([int(offset[-1]) for offset in offsets])
    return np.concatenate([*(offset[:-1] + at for offset, at in zip(offsets, first, strict=False)), first[-1:]])
