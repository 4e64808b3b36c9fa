"""A garment whose sewn pattern is known and taken as it is, compared with what flattening gives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np

from warpflat.core import FloatArray, IntArray, guarded
from warpflat.flat import DEFAULT_FABRIC, Fabric, Surface, area_vectors, as_fabric, triangulate
from warpflat.garment.construction.garment import Garment
from warpflat.garment.construction.laid_as_cut import CutPattern, distances_laid, laid_as_cut
from warpflat.garment.construction.sew_pieces import meeting_borders, name_seams
from warpflat.garment.construction.sewn_panels import SewnPanel, read_sewn_panels
from warpflat.garment.construction.to_pattern import pattern_of_garment
from warpflat.pattern import Pattern, Seam

__all__ = ["WornPattern", "garment_as_cut", "read_cut_pattern", "worn_at"]

# A piece is in front or behind, or a face of it below, where it faces there by this share.
_FACES = 0.5
# What goes around an arm has this share of its cloth below, and that lies out by this share of how far what is above does.
_ENCLOSES, _ABOUT_AS_FAR = 0.15, 0.45


def garment_as_cut(
    panels: Sequence[SewnPanel],
    surfaces: Sequence[Surface],
    *,
    fabric: Fabric,
    name: str,
    flattened: Garment | None = None,
    device: str | None = None,
) -> Garment:
    """Return the garment of panels as they were cut, sewn where their borders meet as it is worn.

    Args:
        panels: with their patterns.
        surfaces: theirs, with their lines.
        fabric: of all of them.
        name: of the garment.
        flattened: the same pieces as flattening gives them, to be compared.
        device: Warp device.
    """
    pieces = {
        surface.name: laid_as_cut(surface, panel.cut, fabric=fabric, device=device)
        for panel, surface in zip(panels, surfaces, strict=True)
    }
    borders = meeting_borders({surface.name: surface for surface in surfaces})
    seams = [replace(pair.as_laid(pieces), sides=pair.pieces) for pair in borders]
    compared = CutPattern(
        unit=panels[0].unit,
        area_ratio=sum(panel.area for panel in panels) / sum(panel.worn_area for panel in panels),
        distances={
            each: distances_laid(flattened.pieces[each].positions, piece.positions) for each, piece in pieces.items()
        }
        if flattened is not None
        else {},
    )
    return Garment(name=name, pieces=pieces, stitching=seams, as_cut=compared)


@dataclass(frozen=True, kw_only=True, eq=False)
class WornPattern:
    """The sewn pattern of a worn garment's file.

    Attributes:
        pattern: pieces and seams.
        surfaces: by piece how it is worn: #V by 3 [m], the same vertices in the pattern, #V by 2 [m], and triangles, #T by 3.
    """

    pattern: Pattern
    surfaces: Mapping[str, tuple[FloatArray, FloatArray, IntArray]]


def read_cut_pattern(path: str | PathLike[str], *, units: str | None, name: str) -> WornPattern:
    """Read the sewn pattern that a worn garment's file has as its texture; its pieces name no cloth.

    Args:
        path: of a mesh.
        units: of its points, where it does not say.
        name: of the pattern.

    Raises:
        InputError: one line that names the file.
    """
    panels = read_sewn_panels(path, units=units, name=name)
    surfaces = name_seams([panel.surface for panel in panels])
    garment = garment_as_cut(panels, surfaces, fabric=as_fabric(DEFAULT_FABRIC), name=name)
    with guarded(Path(path), "mesh"):
        pattern, _ = pattern_of_garment({"": garment}, name=name, twice=False)
    worn = {
        each: (piece.surface.vertices, piece.positions, triangulate(piece.surface.faces)[0])
        for each, piece in garment.pieces.items()
    }
    at = worn_at({each: (points, corners) for each, (points, _, corners) in worn.items()}, pattern.seams)
    pattern = pattern.with_each(lambda piece: replace(piece, fabric="", at=at.get(piece.name, "")))
    return WornPattern(pattern=pattern, surfaces=worn)


def worn_at(worn: Mapping[str, tuple[FloatArray, IntArray]], seams: Sequence[Seam]) -> dict[str, str]:
    """Return for pieces where they are worn: "front", "back", "left arm" or "right arm"; others hang between those.

    What goes around an arm lies on one side of the garment, and what of it faces inwards or down lies about as far out as what faces
    outwards or up: of a leg it lies near the middle, and half a front has none.

    Args:
        worn: by piece its vertices (#V by 3 [m]), upright and facing +z, and triangles (#T by 3), outward.
        seams: between them.
    """
    middle = {name: points[corners].mean(axis=1) for name, (points, corners) in worn.items()}
    vector = {name: area_vectors(points, corners) for name, (points, corners) in worn.items()}
    every = np.concatenate(list(middle.values()))
    centre = 0.5 * (every[:, 0].min() + every[:, 0].max())
    side = {}
    for name, (points, _) in worn.items():
        off = points[:, 0] - centre
        if (off > 0.0).all() or (off < 0.0).all():
            side[name] = "left" if off[0] > 0.0 else "right"
    # A sleeve of several pieces: they are sewn to each other around it.
    group = {name: {name} for name in side}
    for seam in seams:
        a, b = (chain[0].piece for chain in seam.sides)
        if a not in group or b not in group or side[a] != side[b]:
            continue
        # They face more away from each other than alike.
        one, other = vector[a].sum(axis=0), vector[b].sum(axis=0)
        if float(one @ other) < 0.5 * float(np.linalg.norm(one) * np.linalg.norm(other)):
            both = group[a] | group[b]
            group |= dict.fromkeys(both, both)
    at = {}
    for name, row in vector.items():
        facing = row.sum(axis=0)[2] / max(float(np.linalg.norm(row, axis=1).sum()), 1e-300)
        if abs(facing) > _FACES:
            at[name] = "front" if facing > 0.0 else "back"
    for name, which in side.items():
        sign = 1.0 if which == "left" else -1.0
        rows = np.concatenate([vector[each] for each in group[name]])
        out = sign * (np.concatenate([middle[each] for each in group[name]])[:, 0] - centre)
        weight = np.linalg.norm(rows, axis=1)
        up = (rows @ [sign, 1.0, 0.0]) / np.maximum(np.sqrt(2.0) * weight, 1e-300)
        below, above = up < -_FACES, up > _FACES
        if weight[below].sum() < _ENCLOSES * weight.sum() or not weight[above].any():
            continue
        if np.average(out[below], weights=weight[below]) > _ABOUT_AS_FAR * np.average(
            out[above], weights=weight[above]
        ):
            at[name] = f"{which} arm"
    return at
