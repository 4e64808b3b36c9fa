"""The line drawing of a garment, front and back, as its designed surface shows it; and its measures beside the body's."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from warpflat.garment.girths import pattern_girths
from warpflat.pattern.worn import Measure, NeededOpening, ViewedPiece, Worn
from warpflat.surface.connectivity import border_loops

if TYPE_CHECKING:
    from warpflat.flattening.result import Flattening
    from warpflat.garment.garment import Garment

__all__ = ["describe_worn"]

# Lines are drawn to within this [m]; what covers less [m2] is a sliver of the projection.
_WITHIN, _LEAST_AREA = 0.001, 1e-5
# A face whose normal points away from the viewer by more than this cosine is on the far side.
_NEAR_SIDE = -0.1


def describe_worn(garments: Mapping[str, Garment], sample: str) -> Worn:
    """Return the line drawing of a garment in its sample size, the measures of all sizes, and the openings that it needs.

    Args:
        garments: flattened, by size, on their bodies.
        sample: the size that is drawn.
    """
    garment = garments[sample]
    pieces, half = list(garment.pieces.values()), garment.form is not None and garment.form.half
    views = {}
    for name, sign in (("front", 1.0), ("back", -1.0)):
        # What hangs nearer to the viewer hides what lies behind it: the inside of a back shows above the neck of a front.
        ordered = sorted(pieces, key=lambda flat: sign * float(flat.surface.vertices[:, 2].mean()))
        seen = [_view(flat, sign, half=half) for flat in ordered]
        views[name] = tuple(piece for piece in seen if piece.outlines)
    measures = {}
    for size, each in garments.items():
        if each.form is not None and each.mannequin is not None:
            girths = pattern_girths(each.mannequin, each.form, each.positions)
            measures[size] = tuple(
                Measure(name=level, body=girth["body_m"], finished=girth["pattern_m"])
                for level, girth in girths.items()
            )
    needed = tuple(
        NeededOpening(
            ring=ring.name, length=ring.length, over=ring.over, girth=ring.girth, depth=ring.opening_needed_mm / 1000
        )
        for ring in garment.rings
        if ring.passes is False and ring.girth is not None
    )  # fmt: skip
    return Worn(views=views, measures=measures, needed=needed)


def _view(flat: Flattening, sign: float, *, half: bool) -> ViewedPiece:
    """Return a piece as it is seen from the front (1) or the back (-1); of a half garment with its mirror image."""
    import shapely

    faces, space = flat.faces, flat.surface.vertices[flat.vertex_origin]
    seen = space[:, :2] * [sign, 1.0]
    triangles = np.concatenate([faces[:, :3], faces[faces[:, 3] >= 0][:, [0, 2, 3]]])
    mirrored = [seen, seen * [-1.0, 1.0]] if half else [seen]
    shown = np.concatenate([points[triangles] for points in mirrored])
    covered = shapely.union_all(shapely.polygons(shown), grid_size=1e-6).simplify(_WITHIN)
    parts = [part for part in shapely.get_parts(covered) if part.geom_type == "Polygon" and part.area > _LEAST_AREA]
    corners = space[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = sign * normals[:, 2] / np.maximum(np.linalg.norm(normals, axis=1), 1e-30)
    near = {
        (int(a), int(b)): bool(cosine > _NEAR_SIDE)
        for triangle, cosine in zip(triangles, facing, strict=True)
        for a, b in zip(triangle, np.roll(triangle, -1), strict=True)
    }
    if half:
        # The fold is no line of the garment.
        near = {pair: side and bool(np.abs(seen[list(pair), 0]).max() > _WITHIN) for pair, side in near.items()}
    lines = []
    for loop in border_loops(faces):
        ends = list(zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True))
        # Begun where the line turns to the far side, so that no visible stretch is split.
        start = next((k for k, pair in enumerate(ends) if not near.get(pair, True)), 0)
        for visible, stretch in groupby([*ends[start:], *ends[:start]], key=lambda pair: near.get(pair, True)):
            if visible:
                pairs = list(stretch)
                ids = [pairs[0][0], *(pair[1] for pair in pairs)]
                lines += [np.asarray(shapely.LineString(points[ids]).simplify(_WITHIN).coords) for points in mirrored]
    return ViewedPiece(
        outlines=tuple(np.asarray(part.exterior.coords)[:-1] for part in parts), lines=tuple(lines)
    )  # fmt: skip
