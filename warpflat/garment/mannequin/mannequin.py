"""The mannequin: feature profiles and lines around a body, and the bricks between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core import FloatArray, InputError, nearest, polyline_length, short_repr
from warpflat.flat import Surface
from warpflat.garment.mannequin.bricks import Brick, brick, select_bricks
from warpflat.garment.mannequin.builder import build_trunk, build_vertices
from warpflat.garment.mannequin.layout import ARM_LEVELS, LEG_LINES, RING_LEVELS, TRUNK_RINGS, Layout, make_layout
from warpflat.garment.mannequin.measurements import Measurements, measurements_from_size, measurements_from_values
from warpflat.garment.mannequin.nearest_size import SizeDifference, difference_to_size, nearest_size
from warpflat.garment.mannequin.profiles import convex_girth
from warpflat.garment.mannequin.table_body import blueprint_from_measurements, replace_chest

if TYPE_CHECKING:
    from warpflat.garment.mannequin.forms import Form, FormResult
    from warpflat.garment.mannequin.scan_measures import ScanMeasure
    from warpflat.garment.mannequin.scan_pose import ScanOptions

__all__ = ["Level", "Mannequin"]

# So often chest and back are set and measured.
_ROUNDS = 6


@dataclass(frozen=True, kw_only=True)
class Level:
    """One feature profile.

    Attributes:
        height: of its middle above the floor [m].
        girth: as a tape measures it [m]: convex for level profiles, along the curve for neck and armholes.
        section: for a scan, the length of the body's own section at that height, hollows followed [m]; else None.
    """

    height: float
    girth: float
    section: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Mannequin:
    """A body covered by bricks. Metres, Y up, facing +Z; the body's left is +X.

    Attributes:
        layout: the grid, the same for every body of one resolution.
        vertices: layout.vertex_count by 3, positions [m].
        source: where the body comes from: a size, measurements, or a scan.
        notes: completions and repairs, one sentence each.
        sections: for a scan, the length [m] of the body's own section at each level.
        measures: for a scan, tapes around the scan itself, by name.
        lengths: for a body of a size or of measurements, all of these by name [m].
        scan: for a scan, its vertices (#P by 3 [m]) upright with the legs moved together, and its triangles; else None.
        placed: for a scan, how its file's points come upright, before the legs move: points @ placed[0] + placed[1] [m]; else None.
        sources: files from which a scan was read; none of them is ever replaced by what is made of it.
    """

    __repr__ = short_repr

    layout: Layout
    vertices: FloatArray
    source: str
    notes: tuple[str, ...] = ()
    sections: Mapping[str, float] = field(default_factory=dict)
    measures: Mapping[str, ScanMeasure] = field(default_factory=dict)
    lengths: Mapping[str, float] = field(default_factory=dict)
    scan: tuple[FloatArray, NDArray[np.int64]] | None = None
    placed: tuple[FloatArray, FloatArray] | None = None
    sources: tuple[Path, ...] = ()

    @classmethod
    def from_size(cls, size: str, *, resolution_mm: float = 10.0, **lengths: float) -> Mannequin:
        """Return a mannequin of a size of the tables: ``EU 38``, ``UK 10``, ``US 8``, ``JIS 9AR``, ``men 50``, ``men 50/182``.

        Args:
            size: its name.
            resolution_mm: wished quad edge [mm].
            lengths: measurements [m] instead of the size's, by name; what follows from them follows (see `notes`).

        Raises:
            InputError: if no table has the size, or for a measurement that is unknown, outside its valid range, or that no body of
                that size has.
        """
        return cls._from(measurements_from_size(size, **lengths), resolution_mm)

    @classmethod
    def from_measurements(cls, *, table: str | None = None, resolution_mm: float = 10.0, **lengths: float) -> Mannequin:
        """Return a mannequin to given measurements [m]; the missing ones are completed by `table`'s proportions (see `notes`).

        Raises:
            InputError: for an unknown measurement, one outside its valid range, or two that no body has together.
        """
        return cls._from(measurements_from_values(table=table, **lengths), resolution_mm)

    @classmethod
    def from_scan(
        cls, vertices: FloatArray, faces: Any, *, options: ScanOptions | None = None, resolution_mm: float = 10.0
    ) -> Mannequin:
        """Return a mannequin on a body scan: levels found from the body's shape, hollows bridged as a tape does.

        Args:
            vertices: #V by 3, in any unit and pose that can be found from the shape (see :class:`ScanOptions`).
            faces: #F by 3 or 4 (-1 in the last column for a triangle).
            options: unit, facing, landmarks, symmetry.
            resolution_mm: wished quad edge [mm].

        Raises:
            InputError: if the mesh is not a standing body with arms and legs that can be told apart.
        """
        from warpflat.garment.mannequin.scan import attributes_on_scan
        from warpflat.garment.mannequin.scan_pose import ScanOptions

        points, options = np.asarray(vertices, float), options or ScanOptions()
        return Mannequin(**attributes_on_scan(points, np.asarray(faces), options, make_layout(resolution_mm)))

    @classmethod
    def _from(cls, measurements: Measurements, resolution_mm: float) -> Mannequin:
        layout = make_layout(resolution_mm)
        # The sheet rounds the across-chest rows between armholes that are set by their width: set, measure, set again.
        wished = {"chest_width": "chest front", "back_width": "chest back"}
        lengths = dict(measurements.lengths)
        before: dict[str, tuple[float, float]] = {}
        blueprint = blueprint_from_measurements(measurements)
        trunk = build_trunk(layout, blueprint)
        for _ in range(_ROUNDS):
            vertices = build_vertices(layout, replace_chest(blueprint, replace(measurements, lengths=lengths)), trunk)
            worst = 0.0
            for name, line in wished.items():
                found = polyline_length(vertices[layout.lines[line]])
                miss = found - measurements.lengths[name]
                worst = max(worst, abs(miss))
                slope = 1.0
                if name in before and abs(lengths[name] - before[name][0]) > 1e-7:
                    slope = (miss - before[name][1]) / (lengths[name] - before[name][0])
                before[name] = (lengths[name], miss)
                lengths[name] -= miss / min(max(slope, 0.3), 2.0)
            if worst < 0.0002:
                break
        return cls(
            layout=layout, vertices=vertices, source=measurements.source, notes=measurements.notes,
            lengths=measurements.lengths,
        )  # fmt: skip

    def brick(self, name: str) -> Brick:
        """Return a brick with its vertices, faces and neighbours.

        Raises:
            InputError: if there is no such brick.
        """
        return brick(self.layout, name)

    def select(self, *patterns: str) -> list[str]:
        """Return names of the bricks that patterns such as ``waist-hip/front-*`` cover."""
        return select_bricks(self.layout, patterns)

    def line(self, name: str) -> FloatArray:
        """Return #P by 3, positions [m] along a feature profile or line; a closed one repeats its first point.

        Raises:
            InputError: if there is no such line.
        """
        if name not in self.layout.lines:
            raise InputError(f"mannequin line {name!r} is unknown: {nearest(name, self.layout.lines)}")
        return self.vertices[self.layout.lines[name]]

    def lines(self) -> dict[str, FloatArray]:
        """Return every feature profile and line by name, #P by 3 [m]."""
        return {name: self.vertices[ids] for name, ids in self.layout.lines.items()}

    def levels(self) -> dict[str, Level]:
        """Return height and girth of every feature profile, from the neck down, then arms and legs.

        ``thigh``, ``knee`` and ``ankle`` are around both legs, as a skirt hangs; ``thigh left`` is around one.
        """
        found: dict[str, Level] = {}
        for name in ("neck", "shoulder left", "shoulder right", "chest front", "chest back"):
            points = self.line(name)
            found[name] = Level(height=float(points[:, 1].mean()), girth=polyline_length(points))
        for name in reversed(RING_LEVELS):
            points = self.line(name)[:-1]
            found[name] = Level(
                # In front and behind: under the arms the rows dip towards the armholes.
                height=float(points[0, 1]),
                girth=convex_girth(points),
                # Below the hip a section is of two legs, and a skirt's profile goes around both.
                section=self.sections.get(name) if name in TRUNK_RINGS else None,
            )
        for side in ("left", "right"):
            for level in ARM_LEVELS:
                points = self.line(f"{level} {side}")
                found[f"{level} {side}"] = Level(height=float(points[:, 1].mean()), girth=polyline_length(points))
        for side in ("left", "right"):
            for level in LEG_LINES.values():
                points = self.line(f"{level} {side}")[:-1]
                found[f"{level} {side}"] = Level(height=float(points[:, 1].mean()), girth=convex_girth(points))
        for name in ("crotch front", "crotch back"):
            points = self.line(name)
            found[name] = Level(height=float(points[:, 1].min()), girth=polyline_length(points))
        return found

    def extremity(self, name: str) -> float | None:
        """Return the girth [m] of "head", "hand left" or "foot left"; None where neither a table nor the scan gives it."""
        if name in self.measures:
            return self.measures[name].girth
        return self.lengths.get(name.split(" ")[0])

    def surface(self) -> Surface:
        """Return the body as one surface with every feature line on it; the tube around both legs is no part of it."""
        used, faces = np.unique(self.layout.body_faces, return_inverse=True)
        local = np.full(len(self.vertices), -1, np.int32)
        local[used] = np.arange(len(used))
        return Surface(
            vertices=self.vertices[used], faces=np.reshape(faces, (-1, 4)).astype(np.int32),
            lines={name: local[ids] for name, ids in self.layout.body_lines.items()}, name="mannequin",
            input_vertices=self.vertices, input_index=used.astype(np.int32), notes=self.notes,
        )  # fmt: skip

    def form(self, form: str | Form, *, half: bool = False, before: FormResult | None = None) -> FormResult:
        """Return the pieces of a form on this body, and their seams.

        Args:
            form: a shipped form's name (see :func:`warpflat.garment.mannequin.forms.form_names`) or one of your own. The shipped forms'
                long sleeves have a dart at an elbow that is bent.
            half: symmetric pieces as their left half, on the fold.
            before: a form on this body that may have much in common with it, to save time.

        Raises:
            InputError: for an unknown form, brick, line or profile in it.
        """
        from warpflat.garment.mannequin.forms import realise, shipped_form
        from warpflat.garment.mannequin.shapes import shaped_form

        recipe = shaped_form(self.layout, shipped_form(form), "none", self.vertices) if isinstance(form, str) else form
        return realise(self.layout, self.vertices, recipe, half=half, before=before)

    def metrics(self) -> dict[str, Any]:
        """Return the mannequin's entry of ``metrics.json``: its source, and each level's height and girth [m].

        ``girth_m`` is what a tape reads, which bridges hollows. A scan's trunk adds ``section_m``, the length of its section
        there, hollows followed; a scan also adds ``nearest_size`` and, by level, what it has more than that size, and
        ``measures``, the tapes around the scan itself.
        """
        found = self.levels()
        levels: dict[str, dict[str, float]] = {}
        for name, level in found.items():
            levels[name] = {"height_m": level.height, "girth_m": level.girth}
            if level.section is not None:
                levels[name]["section_m"] = level.section
        entry: dict[str, Any] = {"source": self.source, "notes": list(self.notes), "levels": levels}
        difference = self.size_difference()
        if difference is not None:
            entry["nearest_size"] = difference.size
            for name, girth in difference.girths.items():
                levels[name]["girth_over_size_m"] = girth
            for name, height in difference.heights.items():
                levels[name]["height_over_size_m"] = height
        over = self.measure_difference()
        if over is not None:
            measures: dict[str, dict[str, float | str]] = {}
            for name, measure in self.measures.items():
                measures[name] = {"height_m": measure.height, "girth_m": measure.girth}
                if measure.guess is not None:
                    measures[name]["guess"] = measure.guess
                if name in over.heights:
                    measures[name]["height_over_size_m"] = over.heights[name]
                if name in over.girths:
                    measures[name]["girth_over_size_m"] = over.girths[name]
            entry["measures"] = measures
        return entry

    def size_difference(self) -> SizeDifference | None:
        """Return what a scan has more than the nearest size of the tables; None without a scan."""
        if not self.sections:
            return None
        levels = self.levels()
        return nearest_size({k: v.height for k, v in levels.items()}, {k: v.girth for k, v in levels.items()})

    def measure_difference(self) -> SizeDifference | None:
        """Return what the tapes around a scan have more than the nearest size; None without a scan."""
        nearest = self.size_difference()
        if nearest is None:
            return None
        heights = {name: measure.height for name, measure in self.measures.items()}
        return difference_to_size(nearest.size, heights, {name: m.girth for name, m in self.measures.items()})
