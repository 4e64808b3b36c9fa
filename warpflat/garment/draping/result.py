"""The result of a drape: the worn cloth, and its measures."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError, cKDTree

from warpflat.core import BoolArray, FloatArray, IntArray, short_repr, weighted_percentiles
from warpflat.flat import TOUCHING, Demand, shear_angles, triangulate, vertex_normals
from warpflat.garment.draping.body import Body
from warpflat.garment.draping.options import DrapeOptions
from warpflat.garment.draping.places import Place, find_places
from warpflat.garment.draping.relax_drape import DrapedCloth
from warpflat.garment.draping.sewn_cloth import SewnCloth

__all__ = ["HOLLOW_REACH", "Drape", "hollow_depths", "spread"]

# Distances up to this are not looked into [m].
_NEGLIGIBLE = 1e-3
# A smaller place that stands off or is sheared is told, and does not spoil the fit [m2].
_MISFIT_AREA = 1e-3
# Edges that lie on the body whatever the garment.
_JUDGED_EDGES = ("neck", "armhole", "waist")
# Ease has moved where cloth within this distance stands off by no more than so much in the mean [m].
_BESIDE, _MOVED = 0.08, 3e-3
# Cloth hangs from what is above it within 60 degrees of the plumb line.
_ABOVE = 0.5
#: Cloth bridges a hollow that has the surface on all sides within this distance [m].
HOLLOW_REACH = 0.12
# A cut within this distance of a place may take it up [m].
_NEAR_CUT = 0.15


@dataclass(frozen=True, kw_only=True, eq=False)
class Drape:
    """A sewn garment at rest on a body.

    Distances are of the worn cloth's vertices from the designed surface. Of each the *bridged* part is what taut cloth over
    that surface's hollows may stand off, and *misfit* is the rest.

    Attributes:
        cloth: the sewn cloth.
        worn: where it lies.
        body: what it lies on.
        designed: the designed surface.
        options: friction, tolerance and limits.
        sources: the files that its surface was read from; none of them is ever replaced.
        frames: #V by 3 each, where the cloth was on its way to rest [m].
        hangs_below: the height under which cloth hangs freely [m]: that of a mannequin's hip.
        cuts: by piece those that were advised for it: what to cut, and where on the designed surface (#P by 3 [m]).
        drafted: pieces that have no designed surface, such as bands and collars; they misfit nowhere.
        threaded: lines along which an elastic gathers the cloth.
    """

    __repr__ = short_repr

    cloth: SewnCloth
    worn: DrapedCloth
    body: Body
    designed: Body
    options: DrapeOptions
    sources: tuple[Path, ...] = ()
    frames: tuple[NDArray[np.float32], ...] = ()
    hangs_below: float = -np.inf
    cuts: Mapping[str, Sequence[tuple[str, FloatArray]]] = field(default_factory=dict)
    drafted: Collection[str] = ()
    threaded: Collection[str] = ()

    @property
    def converged(self) -> bool:
        """True if the cloth is at rest."""
        return self.worn.converged

    @property
    def positions(self) -> FloatArray:
        """#V by 3, the worn vertices [m]."""
        return self.worn.positions

    @cached_property
    def areas(self) -> FloatArray:
        """#V, the flat areas of the vertices [m2]."""
        return self.cloth.vertex_areas()

    @cached_property
    def gap(self) -> FloatArray:
        """#V, the distance from the body, negative inside [m]."""
        return self.body.gaps(self.positions)

    @cached_property
    def designed_gap(self) -> FloatArray:
        """#V, the distance of the designed surface from the body, negative inside [m]."""
        return self.body.gaps(self.cloth.designed)

    @cached_property
    def _off(self) -> FloatArray:
        """#V, the distance from the designed surface, negative on its inner side [m]."""
        return self.designed.gaps(self.positions)

    @property
    def distance(self) -> FloatArray:
        """#V, the distance from the designed surface [m]."""
        return np.abs(self._off)

    @cached_property
    def bridged(self) -> FloatArray:
        """#V, the part of the distance by which taut cloth may stand off a hollow [m]."""
        bridged = np.zeros(len(self._off))
        at = np.flatnonzero(self._off > _NEGLIGIBLE)
        triangles, _ = triangulate(self.cloth.faces)
        designed = self.cloth.designed
        normals = vertex_normals(designed, triangles)
        bridged[at] = np.minimum(self._off[at], hollow_depths(designed, normals, at.astype(np.int32)))
        return bridged

    @cached_property
    def meant_to_touch(self) -> BoolArray:
        """#V, true where cloth that is meant to lie on the body should lie closer to it.

        Cloth that was designed to leave the body hangs from there on. Ease that has moved stands off here, and lies closer beside.
        """
        free, designed = self.designed_gap > TOUCHING, self.cloth.designed
        triangles, _ = triangulate(self.cloth.faces)
        below, above = triangles[:, [[0, 1], [1, 2], [2, 0], [1, 0], [2, 1], [0, 2]]].reshape(-1, 2).T
        rise = designed[above] - designed[below]
        up = rise[:, 1] > _ABOVE * np.linalg.norm(rise, axis=1)
        below, above = below[up], above[up]
        while not free[below[free[above]]].all():
            free[below[free[above]]] = True
        lift = self.gap - self.designed_gap
        meant = ~free & (lift >= 0.0) & (designed[:, 1] >= self.hangs_below)
        at = np.flatnonzero(meant & (self.distance > _NEGLIGIBLE))
        for vertex, near in zip(at, cKDTree(designed).query_ball_point(designed[at], _BESIDE), strict=True):
            meant[vertex] = np.average(lift[near], weights=self.areas[near]) > _MOVED
        return meant

    @property
    def misfit(self) -> FloatArray:
        """#V, the distance that no hollow explains [m]."""
        found = np.asarray(self.distance - self.bridged)
        for name in self.drafted:
            found[self.cloth.welded[self.cloth.piece_vertices[name]]] = 0.0
        return found

    @cached_property
    def strains(self) -> dict[str, FloatArray]:
        """Strain of each face along warp and weft, and shear, the angle by which they are off the right angle [degrees], #F each."""
        _, face, _, area = self.cloth.cells()
        warp, weft = self.cloth.threads(self.positions)
        along = [np.linalg.norm(threads, axis=1) - 1.0 for threads in (warp, weft)]
        shear = shear_angles(np.column_stack([*along, (warp * weft).sum(axis=1)]))
        strains = {"warp": along[0], "weft": along[1], "shear": shear}
        return {name: np.bincount(face, area * values) / self.face_areas for name, values in strains.items()}

    @cached_property
    def demand(self) -> Demand:
        """What is asked of each face, as shares of the cloth's limits."""
        return Demand.of(self.cloth.fabric, *(self.strains[name] for name in ("warp", "weft", "shear")))

    @cached_property
    def face_areas(self) -> FloatArray:
        """#F, flat areas [m2]."""
        _, face, _, area = self.cloth.cells()
        return np.bincount(face, area).astype(np.float64)

    @property
    def pressure(self) -> FloatArray:
        """#V, normal force on the body over area [Pa]."""
        return np.asarray(self.worn.pressing / self.areas)

    @property
    def compared_with(self) -> str:
        """What distances are from: the designed surface, or the body, where a pattern of a file was designed on none."""
        return "body" if self.designed is self.body else "designed surface"

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """The worst places, the worst first; a misfit near an advised cut names it."""
        gathered = np.zeros(len(self.areas), dtype=bool)
        for line in self.threaded:
            gathered[self.cloth.lines[line]] = True
        found = find_places(
            self.cloth, self.areas, misfit=self.misfit, meant_to_touch=self.meant_to_touch, bridged=self.bridged,
            lift=self.gap - self.designed_gap, gap=self.gap, strains=self.strains, gathered=gathered,
            compared_with=self.compared_with,
        )  # fmt: skip
        places = []
        for place in found:
            at = self.cloth.designed[place.vertex]
            near = [
                (float(np.linalg.norm(path - at, axis=1).min()), words)
                for words, path in self.cuts.get(place.line.partition(".")[0], ())
            ]
            distance, words = min(near, default=(np.inf, ""))
            # A hollow that is bridged asks for no cut, nor does cloth that hangs.
            if place.kind not in ("bridged", "hang") and distance <= _NEAR_CUT:
                place = replace(place, words=f"{place.words}; {words} may take it up")
            places.append(replace(place, fails=self._fails(place)))
        return tuple(places)

    def _fails(self, place: Place) -> bool:
        """Return whether a garment does not fit because of a place: it is held beyond a limit, or gapes at the neck or an armhole.

        Cloth of less than 10 cm2 that gapes or is sheared is told, as are folds, and how it hangs elsewhere. Against a body alone, ease is
        no misfit.
        """
        if place.kind == "strain":
            return place.worst > 0.0
        if place.kind == "misfit" and (self.designed is self.body or not place.gapes):
            return False
        edge = place.line.rpartition(".")[2].partition(" ")[0]
        judged = place.kind == "shear" or (place.kind == "misfit" and edge in _JUDGED_EDGES)
        return judged and place.area >= _MISFIT_AREA

    def measures(self) -> dict[str, Any]:
        """Return the entry `drape` of `metrics.json`."""
        fabric, areas = self.cloth.fabric, self.areas
        found: dict[str, Any] = {
            "converged": self.worn.converged,
            "residual": self.worn.residual,
            "steps": self.worn.steps,
            "stalled": self.worn.stalled,
            "seconds": self.worn.seconds,
            "vertices": len(self.positions),
            "friction": self.options.friction,
            "bending_n_m": fabric.bending,
            "compared_with": self.compared_with,
            "distance_m": spread(self.distance, areas),
            "misfit_m": spread(self.misfit, areas),
            "bridged_m": spread(self.bridged, areas),
            "deepest_m": max(0.0, -float(self.gap.min())),
            "gap_m": {line: float(self.gap[ids].max()) for line, ids in self.cloth.lines.items()},
            "strain_limit": fabric.strain_limit,
            "shear_limit": None if fabric.is_isotropic else fabric.shear_limit,
            "outside": self.demand.outside(self.face_areas),
        }
        for name, values in self.strains.items():
            low, high = weighted_percentiles(values, self.face_areas, [0.05, 0.95])
            key = name if name == "shear" else f"strain_{name}"
            found[key] = {"p5": low, "p95": high, "min": float(values.min()), "max": float(values.max())}
        touching = self.worn.pressing > 0.0
        pressure = (
            spread(self.pressure[touching], areas[touching]) if touching.any() else spread(np.zeros(1), np.ones(1))
        )
        found["pressure_pa"] = {**pressure, "touching": float(areas[touching].sum() / areas.sum())}
        found["places"] = [place.as_dict() for place in self.places]
        return found


def spread(values: FloatArray, weights: FloatArray) -> dict[str, float]:
    """Return mean, 95th percentile by area and maximum."""
    mean = float((values * weights).sum() / weights.sum())
    return {"mean": mean, "p95": weighted_percentiles(values, weights, [0.95])[0], "max": float(values.max())}


def hollow_depths(points: FloatArray, normals: FloatArray, at: IntArray) -> FloatArray:
    """Measure how far the convex hull of a surface's neighbourhood lies above its vertices, along their normals.

    The neighbourhood is the surface within `HOLLOW_REACH` whose normal points to the same side. Cloth that is drawn taut
    over it lies within that hull, so that it may stand off by this much without being too large.

    Args:
        points: #V by 3, the surface's vertices [m].
        normals: #V by 3, unit normals.
        at: #A, the vertices to measure at.

    Returns:
        #A, depths [m]; 0 where the surface bulges.
    """
    depths, tree = np.zeros(len(at)), cKDTree(points)
    for number, (vertex, near) in enumerate(
        zip(at.tolist(), tree.query_ball_point(points[at], HOLLOW_REACH), strict=True)
    ):
        near = np.asarray(near)
        near = near[normals[near] @ normals[vertex] > 0.0]
        if len(near) <= 4:
            continue
        try:
            equations = ConvexHull(points[near] - points[vertex], qhull_options="QJ").equations
        except QhullError:  # all in one plane
            continue
        slope = equations[:, :3] @ normals[vertex]
        up = slope > 1e-9
        if up.any():
            depths[number] = max(float((-equations[up, 3] / slope[up]).min()), 0.0)
    return depths
