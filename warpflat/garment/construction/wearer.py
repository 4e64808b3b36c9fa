"""The fit of a garment on the wearer's body, place by place: ease where the cloth is larger, strain and pressure where it is smaller.

The form is the body moved outwards, so strain against the form says nothing about the wearer. Here every closed row of the grid
is a tape. Where the sewn cloth along it is longer than a tape around the body, it hangs with ease and without strain. Where it is
shorter, it touches: cloth slides around the body until its tension T is the same all around, and it presses by T over the tape's
radius (Laplace's law).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core import FloatArray, IntArray, weighted_percentiles
from warpflat.garment.construction.tapes import PieceEdges, stretch_tape
from warpflat.garment.mannequin.layout import QUARTERS
from warpflat.garment.mannequin.slicer import UP
from warpflat.pattern import face_areas

if TYPE_CHECKING:
    from warpflat.flat import Fabric
    from warpflat.garment.mannequin.forms import FormResult
    from warpflat.garment.mannequin.mannequin import Mannequin

__all__ = ["BodyFit", "WearerFit", "assess_wearer", "body_rows", "tension_around"]

#: A row that lies nearer to a level than this [m] is called by its name alone.
_AT_LEVEL = 2e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyFit:
    """A piece on the wearer's body; arrays are #F and not a number where no row of the grid goes all around.

    Attributes:
        strain: around the body; below 0 it is ease, as a share of the pattern.
        pressure: on the skin [Pa].
    """

    strain: FloatArray
    pressure: FloatArray

    def as_dict(self) -> dict[str, FloatArray]:
        """Return both as maps for a picture."""
        return {"body_strain": self.strain, "body_pressure": self.pressure}


@dataclass(frozen=True, kw_only=True)
class _Row:
    """A tape around the body and the cloth along it.

    Attributes:
        vertices: #R, of the grid.
        level: its name if it is one, else "".
        place: in words.
        ease: of the whole row [m].
        strain: all around; 0 where there is ease.
        pressure: #R, at each vertex [Pa].
        looseness: #R, at each vertex the share by which the cloth of its side is longer than the body.
        sides: by name, the ease of its cloth [m] and the highest pressure on it [Pa].
    """

    vertices: IntArray
    level: str
    place: str
    ease: float
    strain: float
    pressure: FloatArray
    looseness: FloatArray
    sides: Mapping[str, Mapping[str, float]]

    def as_dict(self) -> dict[str, Any]:
        """Return the row as a level in `metrics.json`."""
        return {"ease_m": self.ease, "strain": self.strain, "sides": {name: dict(s) for name, s in self.sides.items()}}


@dataclass(frozen=True, kw_only=True, eq=False)
class WearerFit:
    """A garment on the wearer's body.

    Attributes:
        rows: those of the trunk from the top down, then those of arms and legs.
        limit: of the cloth's strain.
        pieces: by name.
        areas: by name, #F [m2], of the flat faces.
    """

    rows: tuple[_Row, ...]
    limit: float
    pieces: Mapping[str, BodyFit]
    areas: Mapping[str, FloatArray]

    @property
    def is_stretched(self) -> bool:
        """True if the cloth is smaller than the body anywhere."""
        return any(row.strain > 0.0 for row in self.rows)

    def as_dict(self) -> dict[str, Any]:
        """Return the entry `wearer` of `wear` in `metrics.json`."""
        strain, pressure = (
            np.concatenate([getattr(piece, key) for piece in self.pieces.values()]) for key in ("strain", "pressure")
        )
        area = np.concatenate(list(self.areas.values()))
        around = float(area[np.isfinite(strain)].sum())
        touching = strain > 0.0
        worst = max(self.rows, key=lambda row: row.strain)
        found: dict[str, Any] = {
            "strain_limit": self.limit,
            "levels": {row.level: row.as_dict() for row in self.rows if row.level},
            "touching": float(area[touching].sum()) / max(around, 1e-300),
        }
        if touching.any():
            middle, high = weighted_percentiles(pressure[touching], area[touching], [0.5, 0.95])
            hardest = max(self.rows, key=lambda row: float(row.pressure.max()))
            side = max(hardest.sides, key=lambda name: hardest.sides[name]["pressure_pa"])
            found["most_stretched"] = {"place": worst.place, "strain": worst.strain}
            found["pressure_pa"] = {
                "p50": middle, "p95": high, "max": float(hardest.pressure.max()),
                "place": f"{hardest.place}, {side.replace('-', ' ')}",
            }  # fmt: skip
        return found


def assess_wearer(
    mannequin: Mannequin,
    form: FormResult,
    positions: Mapping[str, FloatArray],
    fabric: Fabric,
    *,
    grain_angle: float = 0.0,
) -> WearerFit | None:
    """Return how a garment fits the body itself; None if its pieces go around nothing.

    Args:
        mannequin: the body.
        form: on it.
        positions: by piece, #V by 2, its pattern [m].
        fabric: the cloth.
        grain_angle: of the warp against the upright, degrees.
    """
    edges = PieceEdges(mannequin.layout, form)
    rows = []
    for name, vertices, sides, axis in body_rows(mannequin):
        cloth = edges.along(vertices, axis)
        if cloth is None:
            continue
        tape = stretch_tape(mannequin.vertices[vertices], axis)
        lengths = cloth.lengths(positions, len(vertices))
        strain = max(0.0, tape.girth / float(lengths.sum()) - 1.0)
        pressure = tension_around(fabric, grain_angle, strain) * tape.curvature
        looseness = np.zeros(len(vertices))
        by_side = {}
        for side, columns in sides.items():
            length, body = float(lengths[columns].sum()), float(tape.edges[columns].sum())
            looseness[columns] = max(0.0, 1.0 - body / length)
            by_side[side] = {"ease_m": length - body, "pressure_pa": float(pressure[columns].max())}
        level, place = name
        ease = float(lengths.sum()) - tape.girth
        rows.append(
            _Row(
                vertices=vertices, level=level, place=place, ease=ease, strain=strain, pressure=pressure, looseness=looseness,
                sides=by_side,
            )
        )  # fmt: skip
    if not rows:
        return None
    # Strain and pressure on the faces of every piece: means of those at their corners that lie on a row.
    count = mannequin.layout.vertex_count
    taut, pressed = np.full(count, np.nan), np.full(count, np.nan)
    for row in rows:
        taut[row.vertices] = row.strain if row.strain > 0.0 else -row.looseness
        pressed[row.vertices] = row.pressure
    pieces = {}
    for key, piece in form.pieces.items():
        corners = piece.grid_vertices[piece.surface.faces]
        known = np.isfinite(taut[corners])
        having = np.where(known.any(axis=1), known.sum(axis=1), np.nan)
        of_faces = [np.where(known, values[corners], 0.0).sum(axis=1) / having for values in (taut, pressed)]
        pieces[key] = BodyFit(strain=of_faces[0], pressure=of_faces[1])
    areas = {name: face_areas(positions[name], np.asarray(piece.surface.faces)) for name, piece in form.pieces.items()}
    return WearerFit(rows=tuple(rows), limit=fabric.strain_limit, pieces=pieces, areas=areas)


def tension_around(fabric: Fabric, grain_angle: float, strain: float) -> float:
    """Return the tension [N/m] of cloth stretched around the body and free to narrow along it.

    Args:
        fabric: the cloth.
        grain_angle: of the warp against the upright, degrees.
        strain: 0 or more.
    """
    sine, cosine = np.sin(np.deg2rad(grain_angle)), np.cos(np.deg2rad(grain_angle))
    if min(abs(sine), abs(cosine)) < 1e-6:
        return float(fabric.tension(strain, "weft" if abs(cosine) > 0.5 else "warp"))
    cross = 1.0 / fabric.shear_stiffness - 2.0 * fabric.poisson_ratio / fabric.stiffness_warp
    compliance = cosine**4 / fabric.stiffness_weft + sine**4 / fabric.stiffness_warp + (sine * cosine) ** 2 * cross
    return float(strain / compliance)


def body_rows(mannequin: Mannequin) -> Iterator[tuple[tuple[str, str], IntArray, dict[str, slice], FloatArray]]:
    """Yield the closed rows: (level, place in words), vertices, the columns of each side, and the axis that it is level to."""
    layout = mannequin.layout
    quarter = layout.quarter
    quarters = {name: slice(number * quarter, (number + 1) * quarter) for number, name in enumerate(QUARTERS)}
    last = layout.level_row["bust"]
    levels = {name: row for name, row in layout.level_row.items() if row <= last}
    heights = mannequin.vertices[layout.rings[: last + 1], 1].mean(axis=1)
    for row in range(last, -1, -1):
        yield _row_name(levels, row, heights), layout.rings[row], quarters, UP
    limbs = (
        ("arms", layout.arms, layout.arm_row, "biceps", None),
        ("legs", layout.legs, layout.leg_row, "leg_thigh", layout.to_outseam),
    )
    for _, grids, level_row, first_level, half in limbs:
        first = level_row[first_level]
        for body_side, grid in grids.items():
            middle = grid.shape[1] // 2 if half is None else half
            sides = {f"front-{body_side}": slice(0, middle), f"back-{body_side}": slice(middle, None)}
            levels = {
                f"{name.removeprefix('leg_')} {body_side}": row for name, row in level_row.items() if row >= first
            }
            centres = mannequin.vertices[grid].mean(axis=1)
            away = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(centres, axis=0), axis=1))])
            for row in range(first, len(grid)):
                points = mannequin.vertices[grid[row]]
                yield (
                    _row_name(levels, row, -away),
                    grid[row],
                    sides,
                    np.asarray(np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][2]),
                )


def _row_name(levels: Mapping[str, int], row: int, heights: FloatArray) -> tuple[str, str]:
    """Return the name of the level that a row is, or "", and its place in words."""
    nearest = min(levels, key=lambda name: abs(float(heights[levels[name]] - heights[row])))
    away = float(heights[row] - heights[levels[nearest]])
    place = (
        nearest if abs(away) < _AT_LEVEL else f"{1e3 * abs(away):.0f} mm {'above' if away > 0.0 else 'below'} {nearest}"
    )
    return nearest if levels[nearest] == row else "", place
