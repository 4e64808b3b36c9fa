"""The sections of a body that is laid on a scan: of the trunk and of each leg, level, and of each arm, across its own line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from warpflat.core import BoolArray, FloatArray, InputError, arc_lengths, unit
from warpflat.garment.mannequin.body_landmarks import ARM_PLACES, model_places, near_place, value_at
from warpflat.garment.mannequin.body_model import finer_body
from warpflat.garment.mannequin.profiles import convex_girth
from warpflat.garment.mannequin.sampled import smooth
from warpflat.garment.mannequin.slicer import HOLED, UP, Slicer, plane_axes
from warpflat.garment.mannequin.stand_body import StandingBody

__all__ = ["OUTLINES", "ArmSections", "BodySections", "LegSections", "TrunkSections", "tape_around"]

#: Distances from the midplane at which the outline of the front is followed, as shares of the stature.
OUTLINES = np.linspace(0.03, 0.08, 11)
# Points of the scan so near to an arm's section [m] are of it.
_BESIDE = 0.010
# An arm is sliced at so many places between these distances from the elbow on the mean body [m].
_ARM, _ARM_COUNT = (-0.125, 0.165), 37


def tape_around(points: FloatArray, across: FloatArray) -> tuple[float, float]:
    """Return the middle's height and the convex girth [m] of a section's points, #P by 3, in the plane across a direction."""
    return float(0.5 * (points[:, 1].min() + points[:, 1].max())), convex_girth(points @ plane_axes(across).T)


@dataclass(frozen=True, kw_only=True, eq=False)
class TrunkSections:
    """Level sections of the trunk (of both legs together below the crotch), arms left out, from low to high.

    Attributes:
        y: #S, heights [m].
        girth: #S, hull girth [m].
        length: #S, length of the section itself [m], hollows followed; of both legs below the crotch.
        left, right: #S, extent towards +x and -x [m].
        front, back: #S, extent forward and backward [m].
        apex: #S, distance of the foremost points from the midplane [m].
        outlines: #S by 11, z of the front at the distances OUTLINES of the stature from the midplane, the mean of left and right [m].
        hulls: for each section its hull, counter-clockwise seen from below, #P by 2 (x, z) [m].
        holed: #S, whether the section runs over what the scan does not show.
    """

    y: FloatArray
    girth: FloatArray
    length: FloatArray
    left: FloatArray
    right: FloatArray
    front: FloatArray
    back: FloatArray
    apex: FloatArray
    outlines: FloatArray
    hulls: tuple[FloatArray, ...]
    holed: BoolArray


@dataclass(frozen=True, kw_only=True, eq=False)
class LegSections:
    """Level sections of both legs below the crotch, from low to high.

    Attributes:
        y: #S, heights [m].
        hulls: by side, for each section its hull, #P by 2 (x, z) [m].
        girths: by side #S, the hulls' girths [m].
    """

    y: FloatArray
    hulls: Mapping[str, tuple[FloatArray, ...]]
    girths: Mapping[str, FloatArray]


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmSections:
    """One arm, by the distance [m] along its line from near the shoulder.

    Attributes:
        slicer: of the arm of the body on the scan.
        scan: of what the scan shows of it.
        s: #S, where the arm was sliced.
        line: #S by 3, middles of the sections [m].
        way: #S by 3, unit directions of the line towards the hand.
        elbow, wrist: distances.
    """

    slicer: Slicer
    scan: Slicer
    s: FloatArray
    line: FloatArray
    way: FloatArray
    elbow: float
    wrist: float

    def cut(self, at: FloatArray, across: FloatArray) -> FloatArray:
        """Return the arm's section through a point across a unit direction, the scan's with it, #P by 3 [m].

        Raises:
            InputError: if the arm has none there.
        """
        parts = [p.points for p in self.slicer.cut(across, float(at @ across)) if len(p.points) > 6]
        if not parts:
            raise InputError(f"scan: an arm has no section at {at[1]:.2f} m; its mesh is broken there")
        # A bent arm is cut twice, and near the shoulder so is the trunk.
        nearest = min(parts, key=lambda p: float(np.linalg.norm(0.5 * (p.min(axis=0) + p.max(axis=0)) - at)))
        shown = [p.points for p in self.scan.cut(across, float(at @ across))]
        if not shown:
            return nearest
        points = np.concatenate(shown)
        return np.concatenate([nearest, points[cKDTree(nearest).query(points)[0] < _BESIDE]])

    def frame(self, s: float) -> tuple[FloatArray, FloatArray]:
        """Return the line's point [m] and unit direction at a distance."""
        at, way = (np.array([np.interp(s, self.s, values[:, k]) for k in range(3)]) for values in (self.line, self.way))
        return at, unit(way)

    def tape(self, s: float) -> tuple[float, float]:
        """Return height and girth [m] of a tape across the arm at a distance."""
        at, across = self.frame(s)
        return tape_around(self.cut(at, across), across)


class BodySections:
    """The sections of a body in one pose.

    Args:
        vertices: #V by 3 [m], of the finer body model, its floor at y = 0.
        laid: the body on the scan.
        scan: the scan in the same pose.
        crotch: how far the crotch lies above the body's vertex there [m].
    """

    def __init__(self, vertices: FloatArray, laid: StandingBody, scan: Slicer, crotch: float) -> None:
        from scipy.spatial import ConvexHull

        self.vertices, self.scan = vertices, scan
        #: The lowest point between the legs, and the height below which they are apart [m].
        self.lowest = float(vertices[laid.crotch, 1])
        self.crotch = float(vertices[laid.crotch, 1]) + crotch
        self.armpits = {side: vertices[vertex] for side, vertex in laid.armpits.items()}
        self.stature = float(vertices[:, 1].max())
        triangles = finer_body()[1]
        self.slicer = Slicer(vertices, triangles)
        places = model_places()
        both = np.concatenate([scan.vertices, vertices])
        unseen = ~laid.seen[triangles].all(axis=1)

        def shown(part: BoolArray) -> Slicer:
            """Return the scan's own surface of a part of the body; the body's, as patches, where the scan does not show it."""
            own = scan.triangles[(laid.shown >= 0) & part[laid.shown]]
            return Slicer(both, np.concatenate([own, triangles[part & unseen] + len(scan.vertices)]), scanned=len(own))

        #: By side, trunk, leg and head without the arm.
        self.halves = {side: shown(part) for side, part in places.halves.items()}
        # Trunk and legs in level sections, the left and the right half by itself.
        heights = np.arange(0.04, 0.93, 0.0025) * self.stature
        rows: list[list[float]] = []
        hulls: list[FloatArray] = []
        holed: list[bool] = []
        leg_heights: list[float] = []
        of_legs: dict[str, list[FloatArray]] = {"left": [], "right": []}
        girths: dict[str, list[float]] = {"left": [], "right": []}
        for y in heights:
            of_sides = {side: half.cut(UP, float(y)) for side, half in self.halves.items()}
            parts = [part for of_side in of_sides.values() for part in of_side]
            if y <= self.crotch and all(of_sides.values()):
                leg_heights.append(float(y))
                for side, of_side in of_sides.items():
                    flat = np.concatenate([p.points for p in of_side])[:, [0, 2]]
                    hull = ConvexHull(flat)
                    of_legs[side].append(flat[hull.vertices])
                    girths[side].append(float(hull.area))
            if not parts:
                raise InputError(f"scan: nothing of the body at {y:.2f} m above the floor; its mesh is broken there")
            flat = np.concatenate([p.points for p in parts])[:, [0, 2]]
            hull = ConvexHull(flat)
            z_front, z_back = float(flat[:, 1].max()), float(flat[:, 1].min())
            ahead = flat[flat[:, 1] > 0.5 * (z_front + z_back)]
            ahead = ahead[np.argsort(ahead[:, 0])]
            outline = 0.5 * sum(
                np.interp(side * OUTLINES * self.stature, ahead[:, 0], ahead[:, 1]) for side in (1.0, -1.0)
            )
            rows.append([
                hull.area, sum(p.length for p in parts), flat[:, 0].max(), -flat[:, 0].min(), z_front, z_back,
                float(np.abs(flat[flat[:, 1] > z_front - 0.004 * self.stature][:, 0]).mean()), *outline,
            ])  # fmt: skip
            hulls.append(flat[hull.vertices])
            holed.append(sum(p.patched for p in parts) > HOLED * rows[-1][1])
        table = np.array(rows).T
        self.trunk = TrunkSections(
            y=heights, girth=table[0], length=table[1], left=table[2], right=table[3], front=table[4], back=table[5],
            apex=table[6], outlines=table[7:].T, hulls=tuple(hulls), holed=np.array(holed),
        )  # fmt: skip
        self.legs = LegSections(
            y=np.array(leg_heights), hulls={side: tuple(each) for side, each in of_legs.items()},
            girths={side: np.array(each) for side, each in girths.items()},
        )  # fmt: skip
        self.arms = dict[str, ArmSections]()
        at_model = np.linspace(*_ARM, _ARM_COUNT)
        for side, part in places.arms.items():
            # An arm is sliced across the line through the middles of its vertices, and then of its sections.
            line = np.array([value_at(near_place(float(at), side), vertices) for at in at_model])
            arm = ArmSections(
                slicer=Slicer(vertices, triangles[part]), scan=shown(part & ~places.halves[side]),
                s=arc_lengths(line), line=line, way=_ways(line), elbow=0.0, wrist=0.0,
            )  # fmt: skip
            line = line.copy()
            for i, (at, way) in enumerate(zip(arm.line, arm.way, strict=True)):
                # Next to the armhole sections hold a part of the shoulder.
                if i >= 4:
                    cut = arm.cut(at, way)
                    line[i] = 0.5 * (cut.min(axis=0) + cut.max(axis=0))
            s = arc_lengths(line)
            elbow, wrist = (float(np.interp(ARM_PLACES[name], at_model, s)) for name in ("elbow", "wrist"))
            self.arms[side] = replace(arm, s=s, line=line, way=_ways(line), elbow=elbow, wrist=wrist)


def _ways(line: FloatArray) -> FloatArray:
    way = np.gradient(smooth(line, 2.0), axis=0)
    way[:4] = way[4]
    return unit(way)
