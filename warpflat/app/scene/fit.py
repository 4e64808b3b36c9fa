"""A garment for another body: carried there by the body that is fitted to both, then flattened as any garment from a file."""

from __future__ import annotations

import csv
import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warpflat.app.review.faults import is_done
from warpflat.app.review.figures import count_pieces
from warpflat.app.scene.load import errors_named, make_scene, scene_fabric
from warpflat.app.scene.options import COMMAND_LINE, errors_of_options
from warpflat.app.scene.outside_pattern import BESIDE
from warpflat.core import (
    FloatArray,
    InputError,
    aligned,
    atomic_path,
    listening_to_reads,
    make_file_name,
    make_piece_name,
    nearest,
    quote_value,
)
from warpflat.flat import METRES_PER_UNIT
from warpflat.garment import EASE_LEVELS, EASE_RANGE

if TYPE_CHECKING:
    from warpflat.app.scene.run import SceneResult
    from warpflat.flat import RawMesh
    from warpflat.garment import CommonBody, GarmentFile, SewnPanel

__all__ = [
    "STUDY_FILES",
    "Carried",
    "FitJob",
    "Fitted",
    "check_tables",
    "ease_wishes",
    "fit_to",
    "study_table",
    "write_study",
]

#: What a study leaves, the table of several bodies last.
STUDY_FILES = ("fit.json", "fit.csv")
# Ease is kept if it is by this [m] what it was, or what was asked.
_KEPT = 0.01
# Cloth that lies so deep in the body [m] is within it; more than this share of it is told.
_WITHIN, _TOLD = 0.002, 0.01
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,2})?"
_LENGTH = re.compile(rf"\s*(?P<level>[a-z]+)\s*=\s*(?P<value>{_NUMBER})\s*(?P<unit>mm|cm|m|in)\s*", re.ASCII)
# A texture that may be a normalised one is a pattern where so much of the worn cloth at most is stretched against it, in nine of ten cells.
_AS_WORN = 0.1
#: Axes of a garment's front, and how it is turned to face +Z.
_FRONTS = {"+z": (1.0, 0.0), "-z": (-1.0, 0.0), "+x": (0.0, 1.0), "-x": (0.0, -1.0)}


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
        read: its layers and its mesh.
        layers: of the garment, vertices (#V by 3 [m]) in the body's axes, and triangles (#T by 3), outward.
        body: on which it lies.
        turn, shift: points of the file [m] come to the body's axes as points @ turn + shift.
        panels: of the sewn pattern that the file's texture is; none where it is no pattern.
        notes: one sentence each.
        sources: files that were read.
    """

    path: Path
    read: GarmentFile
    layers: Sequence[tuple[FloatArray, NDArray[np.int64]]]
    body: CommonBody
    turn: FloatArray
    shift: FloatArray
    panels: Sequence[SewnPanel]
    notes: tuple[str, ...]
    sources: tuple[Path, ...]

    @classmethod
    def start(
        cls,
        path: Path,
        *,
        units: str | None = None,
        prim: str | None = None,
        name: str | None = None,
        front: str | None = None,
        body: str | None = None,
    ) -> FitJob:
        """Read a garment, and its body, or fit one inside it.

        Args:
            path, units, prim, name: as :func:`warpflat.garment.seams.layers.read_garment` takes them.
            front: where the front of a garment without a body is, "+z" or "-z", "+x", "-x"; the better of the first two if not given.
            body: a size, or the file of a scan in whose axes the garment lies.

        Raises:
            InputError: a file cannot be read, is no body, or does not lie in the garment.
        """
        from warpflat.flat import triangulate
        from warpflat.garment import CommonBody, read_garment

        if front is not None and front not in _FRONTS:
            raise InputError(f"--front {quote_value(front)}: {nearest(front, _FRONTS)}")
        sources: list[Path] = []
        with listening_to_reads(sources.append):
            read = read_garment(path, units=units, prim=prim, name=name)
            points = [layer.vertices for layer in read.layers]
            corners = [triangulate(layer.faces)[0].astype(np.int64) for layer in read.layers]
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
                    tried.append(
                        (inside.far * (1.0 if axis in ("+z", front) else _BACKWARDS), axis, turn, layers, inside)
                    )
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
        return cls(
            path=path, read=read, layers=layers, body=worn, turn=turn, shift=shift, panels=_known_pattern(read, name or path.stem),
            notes=tuple(notes), sources=tuple(sources),
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
        from scipy.spatial import cKDTree

        from warpflat.garment import CommonBody, carry, level_ease, widened

        posed = _common_body(body, "--to", keep_pose=keep_pose)
        wearer = posed.in_pose_of(self.body)
        cloths = [
            replace(
                layer,
                vertices=vertices,
                faces=np.column_stack([triangles, np.full(len(triangles), -1)]).astype(np.int32),
            )
            for (vertices, triangles), layer in zip(self.layers, self.read.layers, strict=True)
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
        raw = self.read.raw.vertices * self.read.scale @ self.turn + self.shift
        near = cKDTree(was).query(raw)[1]
        back = np.linalg.inv(self.turn)
        return Carried(
            body=wearer.name, vertices=(raw + (cloth - was)[near] - self.shift) @ back,
            skin=(wearer.vertices - self.shift) @ back, before=before, after=after, wished=ease, notes=tuple(notes),
        )  # fmt: skip

    def keeps_pattern(self, tables: Mapping[str, Any]) -> bool:
        """Return whether the garment's own pattern is kept: it has one, and no table of a scene says how its pieces are to be cut."""
        cut = tables.get("seams_cut") or "bands" in tables or "find" in tables.get("find_seams", {})
        return bool(self.panels) and not cut

    def carry_cuts(self, carried: Carried, cuts: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """Return seams that are drawn on the garment as its file has it, as tables of `[[seams_cut]]` on the carried garment.

        A plane's curves, which are plane on the standing garment only, become lines of the places of the cloth that they cross.

        Raises:
            InputError: a plane misses the garment.
        """
        from scipy.spatial import cKDTree

        from warpflat.flat import triangulate
        from warpflat.garment import Mesh, plane_curves

        layers = self.read.layers
        now = [
            carried.vertices[cKDTree(self.read.raw.vertices * self.read.scale).query(layer.vertices)[1]]
            for layer in layers
        ]
        cloth, triangles = _joined([(layer.vertices, triangulate(layer.faces)[0].astype(np.int64)) for layer in layers])
        worn = Mesh(cloth, triangles)
        everywhere = np.concatenate(now)

        def moved(places: Sequence[Any]) -> list[Any]:
            """Return places of the file, points [m] or vertices, on the carried cloth."""
            points = np.array([place for place in places if not isinstance(place, int)], dtype=float).reshape(-1, 3)
            triangle, weights, _ = worn.closest(points)
            there = iter(np.einsum("pk,pka->pa", weights, everywhere[triangles[triangle]]).tolist())
            return [place if isinstance(place, int) else next(there) for place in places]

        found: list[dict[str, Any]] = []
        for number, cut in enumerate(cuts):
            plane = cut.get("plane")
            if plane is None:
                found.append({key: moved(value) if key in ("points", "line") else value for key, value in cut.items()})
                continue
            with errors_named(f"{COMMAND_LINE}: seams_cut[{number}]"):
                paths = plane_curves(
                    layers,
                    plane["point"],
                    plane["normal"],
                    towards=plane.get("towards"),
                    nearest=plane.get("nearest", False),
                )
            for layer, path in paths:
                places = [path.place(each) for each in range(len(path.points))]
                line = [
                    sum(weight * now[layer][vertex] for vertex, weight in place.items()).tolist() for place in places
                ]
                found.append({**{k: v for k, v in cut.items() if k == "name"}, "line": line, "closed": path.closed})
        return found


# A garment that is turned around must fit by so much better.
_BACKWARDS = 1.15


def _known_pattern(read: GarmentFile, name: str) -> list[SewnPanel]:
    """Return the panels of a garment whose texture is its sewn pattern; none where it is a picture's, or may be one.

    A texture in millimetres or centimetres has been measured. One that fits in another unit may be a normalised one by chance: it must lay
    the cloth nearly as it is worn.
    """
    from warpflat.garment import sewn_panels, stretches_worn

    try:
        panels = sewn_panels(read.raw, read.scale, name=make_piece_name(name))
    except InputError:
        return []
    if panels[0].unit in ("mm", "cm"):
        return panels
    stretched = np.concatenate([np.abs(stretches_worn(panel.surface, panel.cut) - 1.0) for panel in panels])
    return panels if float(np.percentile(stretched, 90)) <= _AS_WORN else []


def ease_wishes(texts: Sequence[str]) -> dict[str, float]:
    """Return the ease by level [m] of texts such as "waist=40 mm".

    Raises:
        InputError: one is none, or a level is given twice.
    """
    found: dict[str, float] = {}
    for text in texts:
        match = _LENGTH.fullmatch(text)
        if match is None:
            raise InputError(f"--ease {quote_value(text)}: give a level and a length with its unit, as waist=40mm")
        if match["level"] not in EASE_LEVELS:
            raise InputError(f"--ease {quote_value(text)}: level {nearest(match['level'], EASE_LEVELS)}")
        value = float(match["value"]) * METRES_PER_UNIT[match["unit"]]
        if not EASE_RANGE[0] <= 100.0 * value <= EASE_RANGE[1]:
            raise InputError(f"--ease {quote_value(text)}: ease is from {EASE_RANGE[0]:g} to {EASE_RANGE[1]:g} cm")
        if match["level"] in found:
            raise InputError(f"--ease: {match['level']} is given twice; give it once")
        found[match["level"]] = value
    return found


def check_tables(tables: Mapping[str, Any], garment: Path, drawn: Sequence[str] = ()) -> None:
    """Check the tables of a scene that a carried garment will be flattened by, before anything is fitted.

    Args:
        tables: of the scene.
        garment: its file.
        drawn: what `--cut-seam` was given.

    Raises:
        InputError: a value or the fabric is wrong.
    """
    with errors_of_options(garment, drawn):
        given = {**tables, "surface": {"file": str(garment)}}
        scene_fabric(make_scene(given, name="garment", folder=Path(), where=COMMAND_LINE))


def fit_to(
    job: FitJob,
    carried: Carried,
    tables: Mapping[str, Any],
    out: Path,
    *,
    name: str,
    device: str | None = None,
    on_progress: Any = None,
) -> SceneResult:
    """Flatten a carried garment as a scene of these tables, and write its files and the carried mesh, all of them or none.

    A known pattern is kept: graded by the growth of the cloth, and taken as it is then. Tables that say how pieces are cut have it made
    anew.

    Files: those of :func:`warpflat.app.scene.run.run_scene`, `NAME.fitted.obj`, the garment on the body [m], and `NAME.body.obj`, the body.

    Raises:
        InputError: the garment cannot be flattened, or `out` cannot be written.
    """
    from warpflat.app.scene.run import files_of_run, run_scene
    from warpflat.core import output_folder, record_file
    from warpflat.garment import finer_body, graded_layout, with_cuts

    known, raw = job.panels if job.keeps_pattern(tables) else [], job.read.raw
    if known:
        # In the unit that the file's own texture has.
        per_unit = METRES_PER_UNIT[known[0].unit]
        cuts = [graded_layout(panel.surface, carried.vertices[panel.of_file], panel.cut) / per_unit for panel in known]
        raw = with_cuts(raw, known, cuts)
    meshes = {
        f"{name}.fitted.obj": _obj_lines(carried.vertices, raw),
        f"{name}.body.obj": "".join(
            [f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in carried.skin.tolist()]
            + [f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in finer_body()[1].tolist()]
        ),
    }
    with tempfile.TemporaryDirectory() as folder:
        # A copy, as no run replaces what it has read.
        copy = Path(folder) / f"{name}.obj"
        copy.write_text(meshes[f"{name}.fitted.obj"], encoding="utf-8")
        own = {**tables, "surface": {"file": str(copy), "units": "m"}}
        if known:
            own["surface"]["pattern"] = "uv"
            own.pop("find_seams", None)
        try:
            with errors_of_options(copy):
                if tables.get("seams_cut"):
                    own["seams_cut"] = job.carry_cuts(carried, tables["seams_cut"])
                scene = make_scene(own, name=name, folder=Path(), where=COMMAND_LINE)
                with output_folder(out, [*files_of_run(scene), *meshes], sources=job.sources, guard=True) as to:
                    result = run_scene(scene, out, device=device, on_progress=on_progress, further=list(meshes))
                    for file, text in meshes.items():
                        with atomic_path(to / file) as path:
                            path.write_text(text, encoding="utf-8")
                        record_file(to, scene.name, file)
        except InputError as error:
            raise InputError(str(error).replace(str(copy), f"{job.path} on {carried.body}")) from None
    return replace(result, files=(*result.files, *meshes))


@dataclass(frozen=True, kw_only=True, eq=False)
class Fitted:
    """What has come of a garment on one body: how it was carried, and the folder and the metrics of its run."""

    carried: Carried
    folder: Path
    metrics: Mapping[str, Any]

    @property
    def fits(self) -> bool | None:
        """Whether it fits, by the verdict of its run; None where no cloth is judged."""
        verdict = self.metrics.get("verdict")
        return None if verdict is None else bool(verdict["fits"])

    def verdict(self) -> str:
        """Return in one line how the garment fits the body, its cloth too."""
        return self.carried.verdict() + ("" if self.fits is not False else f"; it {self.metrics['verdict']['words']}")

    def row(self) -> dict[str, Any]:
        """Return the row of a study's table."""
        eases = {level: 1e3 * (girths[0] - girths[1]) for level, girths in self.carried.after.items()}
        pieces = self.metrics["pieces"].values()
        area = sum(piece["area_m2"] for piece in pieces)
        return {
            "body": self.carried.body,
            **{f"ease_{level}_mm": eases.get(level) for level in EASE_LEVELS},
            "kept": self.carried.kept()[1],
            "pieces": count_pieces(self.metrics),
            "area_m2": area,
            "fits": self.fits,
            "done": is_done(self.metrics),
        }


def write_study(folder: Path, fitted: Sequence[Fitted]) -> list[str]:
    """Write `fit.json`, and of several bodies `fit.csv`, both or none, and return their names.

    Raises:
        InputError: they cannot be written, or would replace what is not of warpflat.
    """
    from warpflat._version import __version__
    from warpflat.core import output_folder, write_report

    entries = [
        {**each.carried.as_dict(), "folder": str(each.folder), "fits": each.fits, "done": is_done(each.metrics)}
        for each in fitted
    ]
    files = STUDY_FILES if len(fitted) > 1 else STUDY_FILES[:1]
    with output_folder(folder, files, guard=True) as to:
        if len(fitted) > 1:
            with atomic_path(to / "fit.csv") as path, path.open("w", encoding="utf-8", newline="") as file:
                rows = [each.row() for each in fitted]
                table = csv.DictWriter(file, list(rows[0]))
                table.writeheader()
                table.writerows(rows)
        write_report(to / "fit.json", {"warpflat": __version__, "bodies": entries}, name="fit", files=files)
    return list(files)


def study_table(fitted: Sequence[Fitted]) -> str:
    """Return the table of a study: ease by level [mm]."""
    rows, fits = [each.row() for each in fitted], {True: "yes", False: "no", None: "-"}
    eases = [
        ["-" if (ease := row[f"ease_{level}_mm"]) is None else f"{ease:+.0f}" for level in EASE_LEVELS] for row in rows
    ]
    return aligned(
        ("ease [mm]", *EASE_LEVELS, "pieces", "cloth m2", "fits"),
        [
            (row["body"], *ease, str(row["pieces"]), f"{row['area_m2']:.2f}", fits[row["fits"]])
            for row, ease in zip(rows, eases, strict=True)
        ],
    )


@lru_cache(maxsize=4)
def _common_body(text: str, option: str, *, keep_pose: bool = False) -> CommonBody:
    """Return the body of a size, or of a scan's file, which may sit if its pose is to be kept."""
    from warpflat.flat import read_scan
    from warpflat.garment import CommonBody, Mannequin, ScanOptions

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
    first = np.cumsum([0, *(len(vertices) for vertices, _ in layers)])
    triangles = [corners + start for (_, corners), start in zip(layers, first[:-1].tolist(), strict=True)]
    return np.concatenate([vertices for vertices, _ in layers]), np.concatenate(triangles)


def _obj_lines(vertices: FloatArray, raw: RawMesh) -> str:
    """Return an OBJ of a file's mesh at other places [m], with its texture, groups and materials, along which it may be cut."""
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices.tolist()]
    corner = None
    if raw.texture is not None:
        known = np.nan_to_num(raw.texture.reshape(-1, 2))
        places, number = np.unique(known, axis=0, return_inverse=True)
        corner = number.reshape(raw.polygons.shape)
        lines += [f"vt {u:.12g} {v:.12g}" for u, v in places.tolist()]
    ways = [(word, of) for word, of in (("g", raw.face_group), ("usemtl", raw.face_material)) if of is not None]
    last = [-1] * len(ways)
    for face, row in enumerate(raw.polygons.tolist()):
        for k, (word, of) in enumerate(ways):
            if of[0][face] != last[k]:
                last[k] = of[0][face]
                title = re.sub(r"[^\w.-]+", "_", of[1][last[k]]) or "part"
                lines.append(f"{word} {title}_{last[k]}" if len(set(of[1])) < len(of[1]) else f"{word} {title}")
        words = [
            f"{vertex + 1}/{corner[face, k] + 1}" if corner is not None else str(vertex + 1)
            for k, vertex in enumerate(row)
            if vertex >= 0
        ]
        lines.append("f " + " ".join(words))
    return "\n".join(lines) + "\n"
