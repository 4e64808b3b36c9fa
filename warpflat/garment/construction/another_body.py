"""A worn garment on another body: carried there by the body that is fitted to both."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from warpflat.core import FloatArray, InputError, make_file_name, nearest, quote_value
from warpflat.flat import METRES_PER_UNIT, RawMesh, Surface, read_scan, triangulate
from warpflat.garment.construction.carry import carry
from warpflat.garment.construction.graded import graded_layout, stretches_worn
from warpflat.garment.construction.level_ease import level_ease, widened
from warpflat.garment.construction.read_pieces import make_piece_name
from warpflat.garment.construction.sewn_panels import SewnPanel, sewn_panels, with_cuts
from warpflat.garment.mannequin.body_model import finer_body
from warpflat.garment.mannequin.closest import Mesh
from warpflat.garment.mannequin.common_body import CommonBody
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.scan_pose import ScanOptions

__all__ = ["BESIDE", "Carried", "FitJob"]

#: A garment lies on a body if half of its cloth, or of its borders, is nearer to it than this [m].
BESIDE = 0.2
# Ease is kept if it is by this [m] what it was, or what was asked.
_KEPT = 0.01
# Cloth that lies so deep in the body [m] is within it; more than this share of it is told.
_WITHIN, _TOLD = 0.002, 0.01
# A texture that may be a normalised one is a pattern where so much of the worn cloth at most is stretched against it, in nine of ten cells.
_AS_WORN = 0.1
# Axes of a garment's front, and how it is turned to face +Z. One that is turned around must fit by so much better.
_FRONTS = {"+z": (1.0, 0.0), "-z": (-1.0, 0.0), "+x": (0.0, 1.0), "-x": (0.0, -1.0)}
_BACKWARDS = 1.15


@dataclass(frozen=True, kw_only=True, eq=False)
class Carried:
    """A garment on another body.

    Attributes:
        body: that it was carried to.
        vertices: of the file's mesh [m], in the file's axes.
        skin: #V by 3 [m], the body in the pose of the first one, in the file's axes.
        before, after: girths of garment and body by level [m], on the first body and on this one.
        notes: one sentence each.
    """

    body: str
    vertices: FloatArray
    skin: FloatArray
    before: Mapping[str, tuple[float, float]]
    after: Mapping[str, tuple[float, float]]
    wished: Mapping[str, float]
    notes: tuple[str, ...] = ()

    @property
    def skin_faces(self) -> NDArray[np.int64]:
        """The triangles of the skin, #T by 3."""
        return finer_body()[1]

    def kept(self) -> tuple[float, bool]:
        """Return the greatest difference of an ease from what it was or was asked for [m], and whether that is little."""
        differences = [
            abs(girths[0] - girths[1] - self.wished.get(level, self.before[level][0] - self.before[level][1]))
            for level, girths in self.after.items()
            if level in self.before or level in self.wished
        ]
        worst = max(differences, default=0.0)
        return worst, worst <= _KEPT

    def verdict(self) -> str:
        """Return in one line how the garment fits the body."""
        if not self.after:
            return f"{self.body}: carried; it goes around no level of the trunk, so there is no ease to compare"
        worst, good = self.kept()
        told = ", ".join(f"{level} {1e3 * (girths[0] - girths[1]):+.0f} mm" for level, girths in self.after.items())
        return f"{self.body}: ease {'kept' if good else 'NOT kept'} within {1e3 * worst:.0f} mm ({told})"

    def as_dict(self) -> dict[str, Any]:
        """Return the entry `fit` of `metrics.json`."""
        levels = {
            level: {
                "garment_mm": 1e3 * girths[0],
                "body_mm": 1e3 * girths[1],
                "ease_mm": 1e3 * (girths[0] - girths[1]),
                "ease_before_mm": 1e3 * (self.before[level][0] - self.before[level][1])
                if level in self.before
                else None,
                "ease_asked_mm": 1e3 * self.wished[level] if level in self.wished else None,
            }
            for level, girths in self.after.items()
        }
        return {"body": self.body, "levels": levels, "kept": self.kept()[1], "notes": list(self.notes)}


@dataclass(frozen=True, kw_only=True, eq=False)
class FitJob:
    """A garment on its body, ready to be carried to others.

    Attributes:
        path: the garment's file.
        surfaces: its layers, as the file has them.
        raw: its mesh as it stands, of `scale` metres per unit.
        layers: of the garment, vertices (#V by 3 [m]) in the body's axes, and triangles (#T by 3), outward.
        body: on which it lies.
        turn, shift: points of the file [m] come to the body's axes as points @ turn + shift.
        panels: of the sewn pattern that the file's texture is; none where it is no pattern.
        notes: one sentence each.
        sources: files that were read.
    """

    path: Path
    surfaces: Sequence[Surface]
    raw: RawMesh
    scale: float
    layers: Sequence[tuple[FloatArray, NDArray[np.int64]]]
    body: CommonBody
    turn: FloatArray
    shift: FloatArray
    panels: Sequence[SewnPanel]
    notes: tuple[str, ...]
    sources: tuple[Path, ...] = ()

    @classmethod
    def start(
        cls,
        path: Path,
        surfaces: Sequence[Surface],
        raw: RawMesh,
        scale: float,
        *,
        name: str | None = None,
        front: str | None = None,
        body: str | None = None,
    ) -> FitJob:
        """Find the body of a garment that has been read, or fit one inside it.

        Args:
            path, surfaces, raw, scale: of the garment, see above.
            name: of its pieces; the file's if not given.
            front: where the front of a garment without a body is, "+z" or "-z", "+x", "-x"; the better of the first two if not given.
            body: a size, or the file of a scan in whose axes the garment lies.

        Raises:
            InputError: the body's file cannot be read, is no body, or does not lie in the garment.
        """
        if front is not None and front not in _FRONTS:
            raise InputError(f"--front {quote_value(front)}: {nearest(front, _FRONTS)}")
        points = [layer.vertices for layer in surfaces]
        corners = [triangulate(layer.faces)[0].astype(np.int64) for layer in surfaces]
        notes: list[str] = []
        if body is not None:
            worn = _common_body(body, "--from")
            unit = float(np.cbrt(abs(np.linalg.det(worn.turn))))
            turn, shift = worn.turn / unit, worn.shift
            layers = _outward(points, corners, turn, shift)
        else:
            # The same cloth all around: what fits better is the front.
            tried = []
            for axis in [front] if front else ["+z", "-z"]:
                cosine, sine = _FRONTS[axis]
                turn = np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]]).T
                layers = _outward(points, corners, turn, np.zeros(3))
                joined = _joined(layers)
                inside = CommonBody.inside(*joined, name="the body inside")
                tried.append((inside.far * (1.0 if axis in ("+z", front) else _BACKWARDS), axis, turn, layers, inside))
            _, axis, turn, layers, worn = min(tried, key=lambda each: each[0])
            shift = np.zeros(3)
            stature = float(np.ptp(worn.vertices[:, 1]))
            notes.append(
                f"a body {stature:.2f} m tall was fitted inside the garment, which faces {axis}; --from BODY says which one it is"
            )
        cloth = np.concatenate([vertices for vertices, _ in layers])
        far = np.linalg.norm(worn.skin.closest(cloth)[2] - cloth, axis=1)
        if np.median(far) > BESIDE:
            raise InputError(
                f"{path}: half of it lies more than {100 * np.median(far):.0f} cm off {body or 'any body inside it'}; give the body on "
                "which it was made, in the same axes and place, its unit with --units, or leave --from out"
            )
        # A texture in millimetres or centimetres has been measured. One that fits in another unit may be a normalised one by chance:
        # it must lay the cloth nearly as it is worn.
        try:
            panels = sewn_panels(raw, scale, name=make_piece_name(name or path.stem))
        except InputError:
            panels = []
        if panels and panels[0].unit not in ("mm", "cm"):
            stretched = np.concatenate([np.abs(stretches_worn(panel.surface, panel.cut) - 1.0) for panel in panels])
            panels = panels if float(np.percentile(stretched, 90)) <= _AS_WORN else []
        return cls(
            path=path, surfaces=surfaces, raw=raw, scale=scale, layers=layers, body=worn, turn=turn, shift=shift,
            panels=panels, notes=tuple(notes),
        )  # fmt: skip

    def to(self, body: str, ease: Mapping[str, float], *, keep_pose: bool = False) -> Carried:
        """Carry the garment to another body.

        Args:
            body: a size, or a scan's file.
            ease: by level [m]; what is not named is kept.
            keep_pose: whether it ends on that body as its scan is posed; the ease is that of the body standing as the first one.

        Raises:
            InputError: it is no body, or the garment does not go around a level.
        """
        posed = _common_body(body, "--to", keep_pose=keep_pose)
        wearer = posed.in_pose_of(self.body)
        cloths = [
            replace(
                layer,
                vertices=vertices,
                faces=np.column_stack([triangles, np.full(len(triangles), -1)]).astype(np.int32),
            )
            for (vertices, triangles), layer in zip(self.layers, self.surfaces, strict=True)
        ]
        moved = [carry(one, self.body.vertices, wearer.vertices, CommonBody.skin_triangles()) for one in cloths]
        faces = [triangles for _, triangles in self.layers]
        before, after = level_ease(self.body, self.layers), level_ease(wearer, list(zip(moved, faces, strict=True)))
        for level in ease:
            if level not in after:
                goes = ", ".join(after) or "no level"
                raise InputError(
                    f"--ease {level}: on {wearer.name} the garment is open or ends there; it goes around {goes}"
                )
        # What little the way there has changed of the ease is undone.
        wished = {
            level: ease.get(level, before[level][0] - before[level][1])
            for level in after
            if level in before or level in ease
        }
        for _ in range(2):
            moved = widened(wearer, list(zip(moved, faces, strict=True)), wished)
        after = level_ease(wearer, list(zip(moved, faces, strict=True)))
        cloth, was = np.concatenate(moved), np.concatenate([vertices for vertices, _ in self.layers])
        deep = []
        for points, body_on in ((was, self.body), (cloth, wearer)):
            face, _, place = body_on.skin.closest(points)
            deep.append(float((np.einsum("pa,pa->p", points - place, body_on.skin.normals[face]) < -_WITHIN).mean()))
        notes = []
        if deep[1] > deep[0] + _TOLD:
            notes.append(
                f"{100 * deep[1]:.0f} % of the cloth lies within {wearer.name}, {100 * deep[0]:.0f} % within {self.body.name}"
            )
        if keep_pose:
            down = float(wearer.vertices[:, 1].min() - posed.vertices[:, 1].min())
            sits = posed.vertices + np.array([0.0, down, 0.0])
            moved = [
                carry(replace(one, vertices=vertices), wearer.vertices, sits, CommonBody.skin_triangles())
                for one, vertices in zip(cloths, moved, strict=True)
            ]
            cloth, wearer = np.concatenate(moved), replace(wearer, vertices=sits)
        # The mesh as it stands in its file moves as its layers do; what they left out, as buttons, as the nearest cloth.
        raw = self.raw.vertices * self.scale @ self.turn + self.shift
        near = cKDTree(was).query(raw)[1]
        back = np.linalg.inv(self.turn)
        return Carried(
            body=wearer.name, vertices=(raw + (cloth - was)[near] - self.shift) @ back,
            skin=(wearer.vertices - self.shift) @ back, before=before, after=after, wished=ease, notes=tuple(notes),
        )  # fmt: skip

    def mesh_on(self, carried: Carried, *, patterned: bool) -> RawMesh:
        """Return the file's mesh for a carried garment; its own pattern, if it is kept, is graded by the growth of the cloth."""
        if not patterned:
            return self.raw
        # In the unit that the file's own texture has.
        per_unit = METRES_PER_UNIT[self.panels[0].unit]
        cuts = [
            graded_layout(panel.surface, carried.vertices[panel.of_file], panel.cut) / per_unit for panel in self.panels
        ]
        return with_cuts(self.raw, self.panels, cuts)

    def map_to(self, carried: Carried) -> Callable[[FloatArray], FloatArray]:
        """Return the map from places on the garment, as its file has it, to those on the carried cloth, each #P by 3 [m]."""
        layers = [(layer.vertices, triangulate(layer.faces)[0].astype(np.int64)) for layer in self.surfaces]
        cloth, triangles = _joined(layers)
        worn, there = Mesh(cloth, triangles), np.concatenate(self.layers_on(carried))

        def moved(points: FloatArray) -> FloatArray:
            triangle, weights, _ = worn.closest(points)
            return np.asarray(np.einsum("pk,pka->pa", weights, there[triangles[triangle]]))

        return moved

    def layers_on(self, carried: Carried) -> list[FloatArray]:
        """Return where the vertices of each layer are on the carried garment, #V by 3 [m]."""
        tree = cKDTree(self.raw.vertices * self.scale)
        return [carried.vertices[tree.query(layer.vertices)[1]] for layer in self.surfaces]


@lru_cache(maxsize=4)
def _common_body(text: str, option: str, *, keep_pose: bool = False) -> CommonBody:
    """Return the body of a size, or of a scan's file, which may sit if its pose is to be kept."""
    if not Path(text).suffix:
        if keep_pose:
            raise InputError(
                f"--keep-pose: {option} {quote_value(text)} is a size, which stands; give the file of a scan"
            )
        try:
            return CommonBody.of_mannequin(Mannequin.from_size(text), name=text)
        except InputError as error:
            raise InputError(f"{option}: {error}; or give the file of a scan") from None
    vertices, faces = read_scan(text)
    try:
        options = ScanOptions(keep_pose=keep_pose)
        name = make_file_name(Path(text).stem)
        return CommonBody.of_scan(vertices, faces.astype(np.int64), name=name, options=options)
    except InputError as error:
        raise InputError(f"{option}: {text}: {error}") from None


def _outward(
    points: Sequence[FloatArray], corners: Sequence[NDArray[np.int64]], turn: FloatArray, shift: FloatArray
) -> list[tuple[FloatArray, NDArray[np.int64]]]:
    """Return layers in a body's axes, each with its triangles turned so that most normals point away from its upright axis."""
    out = []
    for vertices, triangles in zip(points, corners, strict=True):
        placed = vertices @ turn + shift
        a, b, c = placed[triangles].transpose(1, 0, 2)
        away = (a + b + c) / 3.0 - placed.mean(axis=0)
        away[:, 1] = 0.0
        outside = float(np.einsum("ta,ta->", np.cross(b - a, c - a), away)) * np.linalg.det(turn)
        out.append((placed, triangles if outside > 0.0 else triangles[:, ::-1].copy()))
    return out


def _joined(layers: Sequence[tuple[FloatArray, NDArray[np.int64]]]) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return the vertices and the triangles of layers as those of one mesh."""
    first = np.cumsum([0, *(len(vertices) for vertices, _ in layers)])
    triangles = [corners + start for (_, corners), start in zip(layers, first[:-1].tolist(), strict=True)]
    return np.concatenate([vertices for vertices, _ in layers]), np.concatenate(triangles)
