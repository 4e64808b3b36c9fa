"""One mesh for all bodies: the body model, fitted to each and laid on it, so that a vertex is the same place on every body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core import FloatArray
from warpflat.flat import triangulate
from warpflat.garment.mannequin.body_landmarks import height_of, model_places
from warpflat.garment.mannequin.body_model import BodyModel, Person, finer_body
from warpflat.garment.mannequin.closest import Mesh
from warpflat.garment.mannequin.fit_body import fit_body
from warpflat.garment.mannequin.fit_inside import fit_inside
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.read_body import read_body
from warpflat.garment.mannequin.scan_levels import TRUNK
from warpflat.garment.mannequin.scan_pose import ScanOptions
from warpflat.garment.mannequin.slicer import UP, Slicer, largest
from warpflat.garment.mannequin.stand_body import lay_on_scan

__all__ = ["CommonBody"]


# Levels that a mannequin and the model both have.
_LEVELS = ("ankle", "knee", "hip", "waist", "underbust", "bust")
# How far out an armhole's top and lowest place lie beside the model's, and how high the latter [m], of EU 38; and how far below the trunk
# follows [m]; and how often they are moved.
_BESIDE_ARM, _BELOW_ARM, _MOVES = (0.043, -0.010, -0.0045), 0.12, 2


@dataclass(frozen=True, kw_only=True, eq=False)
class CommonBody:
    """A body as a mesh whose vertices are the same places on every body.

    Attributes:
        name: what it is called.
        person: of the body model.
        vertices: #V by 3 [m], the finer model's, laid on the body.
        above: how far a level lies above the model's landmark of its name [m]; 0 of those left out.
        turn, shift: points of the body's file come here as points @ turn + shift.
        far: mean distance of the fitted model from the body; inside a garment that by which fits are compared [m].
    """

    name: str
    person: Person
    vertices: FloatArray
    above: Mapping[str, float] = field(default_factory=dict)
    turn: FloatArray = field(default_factory=lambda: np.eye(3))
    shift: FloatArray = field(default_factory=lambda: np.zeros(3))
    far: float = 0.0

    @classmethod
    def of_scan(
        cls, vertices: FloatArray, faces: NDArray[np.integer[Any]], *, name: str, options: ScanOptions | None = None
    ) -> CommonBody:
        """Return the body of a scan, in the scan's pose.

        Args:
            vertices: #V by 3, any unit. faces: #F by 3 or 4 (-1 in the last column for a triangle).
            name: of the body.
            options: what is known of the scan.

        Raises:
            InputError: it is no standing body with arms and legs.
        """
        read = read_body(np.asarray(vertices, float), np.asarray(faces, dtype=np.int64), options or ScanOptions())
        turn, shift = read.placed
        return cls(
            name=name,
            person=read.laid.fit.person,
            vertices=read.posed,
            above={level: read.found[level].height - height_of(level, read.body.vertices) for level in TRUNK},
            turn=turn,
            shift=shift,
            far=read.laid.fit.far,
        )

    @classmethod
    def of_mannequin(cls, mannequin: Mannequin, *, name: str) -> CommonBody:
        """Return the body of a mannequin of a size or of measurements; head, hands and feet, which it lacks, are the model's."""
        triangles = triangulate(np.asarray(mannequin.layout.faces))[0].astype(np.int64)
        # Without head and feet the model would slide up or down.
        levels = mannequin.levels()
        fit = fit_body(mannequin.vertices, triangles, {name: levels[name].height for name in _LEVELS})
        mesh = Mesh(mannequin.vertices, triangles)
        vertices, _ = lay_on_scan(finer_body()[0] @ BodyModel.load().vertices(fit.person), mesh)
        # Laid on the mannequin its levels are some millimetres off: they go where the mannequin has them, and what lies between follows.
        places, heights = model_places(), vertices[:, 1]
        for _ in range(_MOVES):
            own = np.array(
                [np.mean([height_of(name, vertices, side) for side in ("left", "right")]) for name in _LEVELS]
            )
            move = np.interp(heights, own, [levels[name].height for name in _LEVELS] - own)
            vertices = vertices + np.outer(np.where(places.strips["arms"], 0.0, move), [0.0, 1.0, 0.0])
            vertices, _ = lay_on_scan(vertices, mesh)
            heights = vertices[:, 1]
        # So would the ends of its shoulders and its underarms: a table may have both where no body of that girth has them. An armhole lies
        # on the trunk, and the model's arm begins beside it, farther in at the top: as far as on a woman of EU 38.
        corners = finer_body()[1]
        ends = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
        still = places.strips["leg left"] | places.strips["leg right"] | places.strips["head"]
        for _ in range(_MOVES):
            moves = np.zeros_like(vertices)
            for side, sign in (("left", 1.0), ("right", -1.0)):
                arm = places.strips[f"arm {side}"]
                across = ends[arm[ends[:, 0]] != arm[ends[:, 1]]]
                hole, begins = mannequin.line(f"armhole {side}"), vertices[across].mean(axis=1)
                top, from_top = hole[hole[:, 1].argmax()], begins[begins[:, 1].argmax()]
                low, from_low = hole[hole[:, 1].argmin()], begins[begins[:, 1].argmin()]
                at_top = np.array([top[0] - from_top[0] - sign * _BESIDE_ARM[0], 0.0, 0.0])
                at_low = np.array([
                    low[0] - from_low[0] - sign * _BESIDE_ARM[1], low[1] - from_low[1] - _BESIDE_ARM[2], 0.0,
                ])  # fmt: skip
                height = (vertices[:, 1] - from_low[1]) / max(float(from_top[1] - from_low[1]), 1e-9)
                # Arms go along as they are; the trunk follows the more, the farther out it is, down to a hand's length below the underarm.
                out = np.clip(sign * vertices[:, 0] / abs(from_top[0]), 0.0, 1.0) ** 2
                follows = out * np.clip(1.0 - (from_low[1] - vertices[:, 1]) / _BELOW_ARM, 0.0, 1.0)
                follows[still] = 0.0
                follows[arm] = 1.0
                follows[sign * vertices[:, 0] <= 0.0] = 0.0
                moves += follows[:, None] * (at_low + np.clip(height, 0.0, 1.0)[:, None] * (at_top - at_low))
            vertices, _ = lay_on_scan(vertices + moves, mesh)
        return cls(name=name, person=fit.person, vertices=vertices, far=fit.far)

    @classmethod
    def inside(cls, vertices: FloatArray, triangles: NDArray[np.int64], *, name: str) -> CommonBody:
        """Return the body that may wear a garment (#V by 3 [m], Y up, front +Z; #T by 3, outward)."""
        fit = fit_inside(vertices, triangles)
        model, finer = BodyModel.load(), finer_body()[0]
        return cls(name=name, person=fit.person, vertices=finer @ model.vertices(fit.person), far=fit.cost)

    @staticmethod
    @lru_cache(maxsize=1)
    def skin_triangles() -> NDArray[np.int64]:
        """Return the triangles of the common mesh that cloth lies over: without head, hands and feet."""
        triangles = finer_body()[1]
        return triangles[model_places().plain[triangles].all(axis=1)]

    @cached_property
    def skin(self) -> Mesh:
        """What cloth lies over."""
        return Mesh(self.vertices, self.skin_triangles())

    def level(self, name: str) -> float:
        """Return the height [m] of a level of the trunk: bust, underbust, waist or hip, where its mannequin has it."""
        return height_of(name, self.vertices) + self.above.get(name, 0.0)

    def middle_in_file(self, name: str) -> FloatArray:
        """Return the middle of a level of the trunk, in the body's file [its unit]."""
        trunk = largest(Slicer(self.vertices, finer_body()[1]).cut(UP, self.level(name)))
        return np.asarray((trunk.points.mean(axis=0) - self.shift) @ np.linalg.inv(self.turn))

    def in_pose_of(self, other: CommonBody) -> CommonBody:
        """Return this body as it stands where another one does, and with its joints bent as the other's."""
        model, finer = BodyModel.load(), finer_body()[0]
        posed = replace(self.person, bend=other.person.bend, turn=other.person.turn, place=other.person.place)
        vertices = model.rebend(self.person, posed, finer, self.vertices)
        # It stands on the same floor.
        down = np.array([0.0, float(other.vertices[:, 1].min() - vertices[:, 1].min()), 0.0])
        return replace(
            self,
            person=replace(posed, place=posed.place + down),
            vertices=vertices + down,
            turn=other.turn,
            shift=other.shift,
        )
