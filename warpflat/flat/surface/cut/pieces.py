"""A surface after a cut: its vertices, its feature lines, and the pieces it falls into."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from warpflat.core.arrays import IntArray
from warpflat.core.errors import InputError
from warpflat.flat.surface.cut.cut_mesh import Cut, faces_at
from warpflat.flat.surface.half_edges import half_edges, sides_of
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.normals import flat_areas
from warpflat.flat.surface.triangles import corner_triangles

__all__ = ["CutPart", "apply_cut", "lines_after_cut", "split_pieces"]

_PART = re.compile(r"\.(left|right|\d+)(\.\d+)?$")


@dataclass(frozen=True, kw_only=True, eq=False)
class CutPart:
    """One connected part of a cut surface.

    Attributes:
        surface: the part as a surface of its own.
        vertex_index: #v, for each of its vertices the vertex of the cut mesh.
        vertex_origin: #v, for each of its vertices the vertex of the uncut mesh.
        face_index: #f, for each of its faces the face of the (cut and uncut) mesh.
    """

    surface: Surface
    vertex_index: IntArray
    vertex_origin: IntArray
    face_index: IntArray


def apply_cut(surface: Surface, cut: Cut) -> Surface:
    """Return the surface with the vertices along a cut doubled, still as one object, with its feature lines.

    Args:
        surface: the uncut surface.
        cut: made from its faces.
    """
    origin = cut.vertex_origin
    return replace(
        surface,
        vertices=surface.vertices[origin],
        faces=cut.faces,
        lines=lines_after_cut(surface.lines, surface.faces, cut),
        input_index=surface.input_index[origin],
    )


def lines_after_cut(lines: Mapping[str, IntArray], faces: IntArray, cut: Cut) -> dict[str, IntArray]:
    """Return feature lines in the numbering of the cut mesh.

    The part along the cut becomes two lines, NAME.left and NAME.right (of the line's own direction, seen from outside).
    The rest keeps its name; where the cut parts it into several, they are NAME.1, NAME.2, ... in the line's order.

    Args:
        lines: name to vertices of the uncut mesh, along its edges; a closed line repeats its first vertex.
        faces: #F by 4, the uncut mesh.
        cut: made from `faces`.
    """
    doubled = np.unique(np.concatenate([seam.path for seam in cut.seams]))
    near = faces_at(faces, doubled)
    # Slots of the faces are the same before and after the cut, so the half-edges correspond one to one.
    old, new = (zip(*(end.tolist() for end in sides_of(of[near])), strict=True) for of in (faces, cut.faces))
    new_side = dict(zip(old, new, strict=True))
    on_cut = set(doubled.tolist())
    renumbered: dict[str, IntArray] = {}
    taken = set(lines)
    for name, line in lines.items():
        if len(line) > 1 and on_cut.isdisjoint(line.tolist()):
            renumbered[name] = np.asarray(line, dtype=np.int32)
            continue
        found: dict[str, list[tuple[int, int] | None]] = {"": [], ".left": [], ".right": []}
        for a, b in pairwise(line.tolist()):
            left, backward = new_side.get((a, b)), new_side.get((b, a))
            right = backward[::-1] if backward else None
            if left is None and right is None:
                if a in on_cut or b in on_cut:
                    raise InputError(f"line {name!r} leaves the mesh between vertices {a} and {b}: they share no edge")
                left = (a, b)
            along = left is not None and right is not None and left != right
            found[""].append(None if along else left or right)
            found[".left"].append(left if along else None)
            found[".right"].append(right if along else None)
        for suffix, edges in found.items():
            # A gap (None) or a doubled vertex ends a chain of vertices.
            chains: list[list[int]] = []
            previous: tuple[int, int] | None = None
            for edge in edges:
                if edge is not None:
                    if previous is not None and previous[1] == edge[0]:
                        chains[-1].append(edge[1])
                    else:
                        chains.append(list(edge))
                previous = edge
            if len(chains) > 1 and edges[0] is not None and edges[-1] is not None and chains[-1][-1] == chains[0][0]:
                chains[0] = chains.pop()[:-1] + chains[0]
            runs = [np.array(chain, dtype=np.int32) for chain in chains]
            for number, run in enumerate(runs, start=1):
                label = name + suffix + (f".{number}" if len(runs) > 1 else "")
                while label != name and label in taken:
                    label += "'"
                taken.add(label)
                renumbered[label] = run
    return renumbered


def split_pieces(surface: Surface, cut: Cut) -> tuple[CutPart, ...]:
    """Return one surface per connected piece of the cut mesh, in the order of their first faces.

    Where a piece has only one part of a line, the part gets the line's plain name back. One piece keeps the surface's name; of two the
    names end in where they lie to each other (.upper/.lower, .left/.right as the wearer sees it, .front/.back for Y up and +Z to the front;
    .inner/.outer for a hole); more are numbered.

    Args:
        surface: the uncut surface.
        cut: made from its faces.
    """
    whole, count = apply_cut(surface, cut), cut.component_count
    if count == 1:
        places = [""]
    elif count > 2:
        places = [f".{number}" for number in range(1, count + 1)]
    elif cut.kind == "hole":
        he = half_edges(cut.faces)
        border = np.bincount(cut.face_component[he.face[he.count[he.edge] == 1]], minlength=2)
        places = [".inner", ".outer"] if border[0] <= border[1] else [".outer", ".inner"]
    else:
        triangles, face, weight = corner_triangles(cut.faces)
        area, middle = weight * flat_areas(whole.vertices, triangles), whole.vertices[triangles].mean(axis=1)
        side = cut.face_component[face]
        total = np.maximum(np.bincount(side, weights=area, minlength=2), np.finfo(float).tiny)
        moment = [np.bincount(side, weights=area * middle[:, axis], minlength=2) for axis in range(3)]
        apart = np.array([m[0] / total[0] - m[1] / total[1] for m in moment])
        axis = int(np.argmax(np.abs(apart)))
        # Facing +Z with Y up, the wearer's left hand is at +X.
        places = [[".left", ".right"], [".upper", ".lower"], [".front", ".back"]][axis]
        places = places if apart[axis] > 0 else places[::-1]
    pieces = []
    for label, place in enumerate(places):
        name = f"{whole.name}{place}"
        face_index = np.flatnonzero(cut.face_component == label).astype(np.int32)
        faces = whole.faces[face_index]
        used = np.unique(faces[faces >= 0]).astype(np.int32)
        number = np.full(len(whole.vertices) + 1, -1, dtype=np.int32)
        number[used] = np.arange(len(used), dtype=np.int32)
        held = {key: number[line] for key, line in whole.lines.items() if (number[line] >= 0).all()}
        plain = [name if name in surface.lines else _PART.sub("", name.rstrip("'")) for name in held]
        part = replace(
            whole,
            vertices=whole.vertices[used],
            faces=number[faces],
            lines={
                short if plain.count(short) == 1 else name: line
                for (name, line), short in zip(held.items(), plain, strict=True)
            },
            name=name,
            input_index=whole.input_index[used],
        )
        pieces.append(
            CutPart(surface=part, vertex_index=used, vertex_origin=cut.vertex_origin[used], face_index=face_index)
        )
    return tuple(pieces)
