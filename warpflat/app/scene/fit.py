"""A garment for another body: carried there by the body that is fitted to both, then flattened as any garment from a file."""

from __future__ import annotations

import csv
import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.app.review.faults import is_done
from warpflat.app.review.figures import aligned, count_pieces
from warpflat.app.scene.load import errors_named, make_scene, scene_fabric
from warpflat.app.scene.options import COMMAND_LINE, errors_of_options
from warpflat.core import InputError, listening_to_reads, nearest, quote_value
from warpflat.flat import METRES_PER_UNIT
from warpflat.garment import EASE_LEVELS, EASE_RANGE
from warpflat.pattern import atomic_path

if TYPE_CHECKING:
    from warpflat.app.scene.run import SceneResult
    from warpflat.garment import Carried, FitJob

__all__ = [
    "STUDY_FILES",
    "Fitted",
    "check_tables",
    "ease_wishes",
    "fit_to",
    "keeps_pattern",
    "read_job",
    "study_table",
    "write_study",
]

#: What a study leaves, the table of several bodies last.
STUDY_FILES = ("fit.json", "fit.csv")
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,2})?"
_LENGTH = re.compile(rf"\s*(?P<level>[a-z]+)\s*=\s*(?P<value>{_NUMBER})\s*(?P<unit>mm|cm|m|in)\s*", re.ASCII)


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


def read_job(path: Path, *, front: str | None = None, body: str | None = None, **of_file: str | None) -> FitJob:
    """Read a garment, and its body, or fit one inside it.

    Args:
        path, of_file: the file, with `units`, `prim` and `name` as :func:`warpflat.garment.seams.layers.read_garment` takes them.
        front, body: as :meth:`warpflat.garment.construction.another_body.FitJob.start` takes them.

    Raises:
        InputError: a file cannot be read, is no body, or does not lie in the garment.
    """
    from warpflat.garment import FitJob, read_garment

    sources: list[Path] = []
    with listening_to_reads(sources.append):
        read, name = read_garment(path, **of_file), of_file.get("name")
        job = FitJob.start(path, read.layers, read.raw, read.scale, name=name, front=front, body=body)
    return replace(job, sources=tuple(sources))


def carry_cuts(job: FitJob, carried: Carried, cuts: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return seams that are drawn on the garment as its file has it, as tables of `[[seams_cut]]` on the carried garment.

    A plane's curves, which are plane on the standing garment only, become lines of the places of the cloth that they cross.

    Raises:
        InputError: a plane misses the garment.
    """
    from warpflat.garment import plane_curves

    onto, now = job.map_to(carried), job.layers_on(carried)

    def moved(places: Sequence[Any]) -> list[Any]:
        """Return places of the file, points [m] or vertices, on the carried cloth."""
        points = np.array([place for place in places if not isinstance(place, int)], dtype=float).reshape(-1, 3)
        there = iter(onto(points).tolist())
        return [place if isinstance(place, int) else next(there) for place in places]

    found: list[dict[str, Any]] = []
    for number, cut in enumerate(cuts):
        plane = cut.get("plane")
        if plane is None:
            found.append({key: moved(value) if key in ("points", "line") else value for key, value in cut.items()})
            continue
        with errors_named(f"{COMMAND_LINE}: seams_cut[{number}]"):
            paths = plane_curves(
                job.surfaces,
                plane["point"],
                plane["normal"],
                towards=plane.get("towards"),
                nearest=plane.get("nearest", False),
            )
        for layer, path in paths:
            places = [path.place(each) for each in range(len(path.points))]
            line = [sum(weight * now[layer][vertex] for vertex, weight in place.items()).tolist() for place in places]
            found.append({**{k: v for k, v in cut.items() if k == "name"}, "line": line, "closed": path.closed})
    return found


def keeps_pattern(job: FitJob, tables: Mapping[str, Any]) -> bool:
    """Return whether the garment's own pattern is kept: it has one, and no table of a scene says how its pieces are to be cut."""
    cut = tables.get("seams_cut") or "bands" in tables or "find" in tables.get("find_seams", {})
    return bool(job.panels) and not cut


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
    from warpflat.pattern import output_folder, record_file

    patterned = keeps_pattern(job, tables)
    # The file's mesh on the body, with its texture, groups and materials, along which it may be cut.
    raw = job.mesh_on(carried, patterned=patterned)
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in carried.vertices.tolist()]
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
    meshes = {
        f"{name}.fitted.obj": "\n".join(lines) + "\n",
        f"{name}.body.obj": "".join(
            [f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in carried.skin.tolist()]
            + [f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in carried.skin_faces.tolist()]
        ),
    }
    with tempfile.TemporaryDirectory() as folder:
        # A copy, as no run replaces what it has read.
        copy = Path(folder) / f"{name}.obj"
        copy.write_text(meshes[f"{name}.fitted.obj"], encoding="utf-8")
        own = {**tables, "surface": {"file": str(copy), "units": "m"}}
        if patterned:
            own["surface"]["pattern"] = "uv"
            own.pop("find_seams", None)
        try:
            with errors_of_options(copy):
                if tables.get("seams_cut"):
                    own["seams_cut"] = carry_cuts(job, carried, tables["seams_cut"])
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


def write_study(folder: Path, fitted: Sequence[Fitted]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Write `fit.json`, and of several bodies `fit.csv`, both or none.

    Returns:
        Their names, and what became of those of an earlier study, one sentence each.

    Raises:
        InputError: they cannot be written, or would replace what is not of warpflat.
    """
    from warpflat._version import __version__
    from warpflat.pattern import output_folder, remove_stale

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
        study = {"warpflat": __version__, "bodies": entries}
        _, notes = remove_stale(to, study, name="fit", files=files, report="fit.json")
    return files, notes


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
