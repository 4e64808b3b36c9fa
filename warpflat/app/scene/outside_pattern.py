"""A pattern that comes from a file, and a small file that says how it is sewn, are draped on a body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, Field, model_validator

from warpflat.app.scene.load import errors_named, expand_variables
from warpflat.app.scene.run import SceneResult
from warpflat.app.scene.schema import DrapeTable
from warpflat.core import InputError, Table, check_table, make_file_name, read_json, read_toml
from warpflat.garment import MannequinTable, mannequin_from_table

if TYPE_CHECKING:
    from warpflat.garment import Lift, Mannequin
    from warpflat.pattern import Pattern, Piece, Seam

__all__ = ["OutsideJob", "SewingTable", "drape_outside", "edge_table", "is_pattern_file"]


class SewnSeamTable(Table):
    """A seam: two sides that are sewn together, each an edge "piece.edge", or several, "piece.edge + piece.edge".

    Edges run counter-clockwise around their piece. The first side is walked that way, the second the other way, as two edges that
    lie beside each other are.
    """

    name: str | None = None
    sides: Annotated[list[str], Field(min_length=2, max_length=2)]


class SewnPieceTable(Table):
    """What a file does not say of a piece."""

    name: str
    at: Literal["front", "back", "left arm", "right arm"] | None = None
    fold: str | None = None
    """The edge that lies on the fold of the cloth."""
    quantity: Annotated[int, Field(ge=1, le=2)] | None = None
    """2 for a piece that is cut twice, the second one turned over: "NAME mirrored"."""


class SewingTable(Table):
    """How the pieces of a file are sewn and worn; every key may be left out."""

    seams: list[SewnSeamTable] = Field(default_factory=list)
    pieces: list[SewnPieceTable] = Field(default_factory=list)
    top: str | float | None = None
    """A level of the body, or a height [m], for the highest point of what does not hang from the shoulders."""
    allowance_mm: Annotated[float, Field(ge=0, le=100)] | None = None
    """From the boundary to the sewing line, where the file has none."""
    fabric: str | None = None
    mannequin: MannequinTable | None = None
    spacing_mm: Annotated[float, Field(ge=2, le=50)] = 10.0
    drape: DrapeTable = Field(default_factory=DrapeTable)

    @model_validator(mode="after")
    def _of_a_pattern(self) -> SewingTable:
        if self.drape.correct_fabric is not None:
            raise ValueError("drape.correct_fabric belongs to a scene, whose designed surface is kept; leave it out")
        return self


class RunGirth(BaseModel):
    """A girth in the `metrics.json` of a run [m]."""

    body_m: float
    form_m: float
    pattern_m: float
    ease_wanted_m: float | None = None


class RunBody(BaseModel):
    """The body in the `metrics.json` of a run."""

    table: dict[str, Any] | None = None


class Run(BaseModel):
    """What a drape reads in the `metrics.json` of a run."""

    mannequin: RunBody = Field(default_factory=RunBody)
    girths: dict[str, RunGirth] = Field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class OutsideJob:
    """A pattern from outside, read and ready to be draped.

    Attributes:
        path: of its file or folder, as it was given.
        name: of its files.
        pattern: pieces and seams.
        sewing: how they are sewn and worn.
        body: what they are put on; None for the designed surface itself.
        lifts: by piece the way to its designed surface, for the folder of a run.
        girths: by level, as it was drafted.
        sources: files that were read.
    """

    path: Path
    name: str
    pattern: Pattern
    sewing: SewingTable
    body: Mannequin | None
    lifts: dict[str, Lift]
    girths: Mapping[str, RunGirth]
    sources: tuple[Path, ...]

    @classmethod
    def read(
        cls, path: Path, *, sewing: Path | None = None, body: str | None = None, units: str | None = None
    ) -> OutsideJob:
        """Read a pattern, and how it is sewn.

        Args:
            path: a run's folder, its pattern.json, GarmentCode's JSON, a DXF, an SVG, or a mesh whose texture is its sewn pattern.
            sewing: a TOML file (see :class:`SewingTable`).
            body: a size or the file of a scan, before that of the sewing file and of the run.
            units: of a mesh that does not say.

        Raises:
            InputError: a file cannot be read, a name is unknown, or there is no seam or no body.
        """
        from warpflat.core import listening_to_reads
        from warpflat.pattern import Seam

        sources: list[Path] = []
        with listening_to_reads(sources.append):
            table = SewingTable() if sewing is None else check_table(SewingTable, read_toml(sewing), str(sewing))
            if sewing is not None and table.mannequin is not None and table.mannequin.scan is not None:
                with errors_named(f"{sewing}: mannequin.scan"):
                    scan = str(sewing.parent / expand_variables(table.mannequin.scan))
                body_of_file = table.mannequin.model_copy(update={"scan": scan})
                table = table.model_copy(update={"mannequin": body_of_file})
            pattern, lifts, run = _read(path, table, units)
            run_body = run.mannequin.table
            with errors_named(str(sewing)):
                # The pattern with the folds, quantities and seams of the sewing file, whose seams replace the
                # pattern's.
                wanted = {entry.name: entry for entry in table.pieces}
                for name in wanted:
                    pattern.piece(name, pattern.sample)
                pieces = {
                    size: [_changed(piece, wanted.get(piece.name)) for piece in row]
                    for size, row in pattern.pieces.items()
                }
                seams: list[Seam] = list(pattern.seams)
                if table.seams:
                    seams = []
                    for number, entry in enumerate(table.seams, start=1):
                        name = entry.name or f"seam {number}"
                        one, other = (
                            tuple(_side(text.strip(), reversed=k == 1) for text in side.split(" + "))
                            for k, side in enumerate(entry.sides)
                        )
                        seams.append(Seam(name=name, sides=(one, other)))
                pattern = replace(pattern, pieces=pieces, seams=seams)
            if not pattern.seams:
                first, *others = pattern.pieces[pattern.sample]
                second = others[0] if others else first
                raise InputError(
                    f"{path}: names no seams; give --seams FILE with [[seams]] sides = "
                    f'["{first.name}.{first.edges[0].name}", "{second.name}.{second.edges[-1].name}"] '
                    f"(warpflat drape {path.name} --edges prints all edges)"
                )
            worn = _worn_scan(body, table, lifts, pattern) if lifts and run_body is None else None
            mannequin, lifts = worn or (_body(body, table, run_body, path, designed=bool(lifts)), lifts)
        name = make_file_name((path if path.is_dir() else path.with_suffix("")).resolve().name)
        return cls(
            path=path, name=name, pattern=pattern, sewing=table, body=mannequin, lifts=lifts,
            girths=run.girths, sources=tuple(sources),
        )  # fmt: skip

    def girths_on_body(self) -> dict[str, dict[str, float]]:
        """Return the garment's girths against the body that it is put on, where it was drafted with the same ease."""
        levels, found = {} if self.body is None else self.body.levels(), dict[str, dict[str, float]]()
        for level, girth in self.girths.items():
            if level in levels:
                body = levels[level].girth
                found[level] = {
                    "body_m": body,
                    "form_m": body + girth.form_m - girth.body_m,
                    "pattern_m": girth.pattern_m,
                    "ease_m": girth.pattern_m - body,
                    **({} if girth.ease_wanted_m is None else {"ease_wanted_m": girth.ease_wanted_m}),
                }
        return found


def is_pattern_file(path: Path) -> bool:
    """Return whether a path is that of a pattern rather than of a scene: a folder, a JSON, DXF or SVG file, or a mesh."""
    from warpflat.flat import SUFFIXES
    from warpflat.pattern import PATTERN_ENDINGS

    return path.is_dir() or path.suffix.lower() in (*PATTERN_ENDINGS, *SUFFIXES)


def edge_table(
    path: Path, *, sewing: Path | None = None, units: str | None = None
) -> tuple[list[str], tuple[str, ...]]:
    """Return every edge of a pattern's pieces with its length and ends, a line each, and what was left out of the file.

    Raises:
        InputError: a file cannot be read.
    """
    table = SewingTable() if sewing is None else check_table(SewingTable, read_toml(sewing), str(sewing))
    lines = []
    pattern = _read(path, table, units)[0]
    for piece in pattern.pieces[pattern.sample]:
        for edge in piece.edges:
            (x, y), (u, v) = 1e3 * edge.points[[0, -1]]
            lines.append(
                f"{piece.name}.{edge.name}: {1e3 * edge.length:.1f} mm, {edge.kind}, from ({x:.0f}, {y:.0f}) to ({u:.0f}, {v:.0f}) mm"
            )
    return lines, tuple(pattern.notes)


def _read(path: Path, table: SewingTable, units: str | None) -> tuple[Pattern, dict[str, Lift], Run]:
    """Return the pattern, the ways to its designed surface, and what its run says of body and girths."""
    from warpflat.garment import read_lifted

    allowance = None if table.allowance_mm is None else 1e-3 * table.allowance_mm
    pattern, lifts = read_lifted(path, units=units, allowance=allowance)
    told = path / "metrics.json"
    run = check_table(Run, read_json(told), str(told)) if path.is_dir() and told.exists() else Run()
    return pattern, lifts, run


def _changed(piece: Piece, entry: SewnPieceTable | None) -> Piece:
    if entry is None:
        return piece
    edges = list(piece.edges)
    if entry.fold is not None:
        place = edges.index(piece.edge(entry.fold))
        edges[place] = replace(edges[place], kind="fold", allowance=None)
    return replace(piece, edges=edges, quantity=entry.quantity or piece.quantity, at=entry.at or piece.at)


def _side(text: str, *, reversed: bool) -> Any:
    from warpflat.pattern import MIRRORED, SeamSide

    piece, _, edge = text.partition(".")
    if not edge:
        raise InputError(f'seams: {text!r} must be "piece.edge"')
    mirrored = piece.endswith(MIRRORED) or edge.endswith(MIRRORED)
    piece, edge = piece.removesuffix(MIRRORED), edge.removesuffix(MIRRORED)
    # A mirrored edge runs the other way than the one that it is an image of.
    return SeamSide(piece=piece, edge=edge, reversed=reversed != mirrored, mirrored=mirrored)


def _asked(given: str | None, table: SewingTable) -> MannequinTable | None:
    """Return the body that --body or the sewing file names."""
    if given is None:
        return table.mannequin
    with errors_named("--body"):
        given = expand_variables(given)
    return check_table(MannequinTable, {"scan" if Path(given).suffix else "size": given}, "--body")


def _worn_scan(
    given: str | None, table: SewingTable, lifts: Mapping[str, Lift], pattern: Pattern
) -> tuple[Mannequin, dict[str, Lift]] | None:
    """Return the mannequin of a scan on which the designed surface of a mesh lies, in the scan's pose, and the way to that surface.

    Both come to the mannequin's axes together. None if the body is no scan, or the surface does not lie on it as their files stand.
    """
    from warpflat.garment import lifts_on_scan

    asked = _asked(given, table)
    if asked is None or asked.scan is None:
        return None
    kept = asked.model_copy(update={"pose": "scan", "symmetric": False})
    try:
        body = mannequin_from_table(kept, path_of=Path)
    except InputError:
        # The body as it is asked for may be one; if not, it says why.
        return None
    moved = lifts_on_scan(body, lifts, pattern)
    return None if moved is None else (body, moved)


def _body(
    given: str | None, table: SewingTable, run: dict[str, Any] | None, path: Path, *, designed: bool
) -> Mannequin | None:
    """Return the body that was asked for, or that of the run; None for the designed surface itself.

    Raises:
        InputError: there is none, or it cannot be built.
    """
    if (asked := _asked(given, table)) is not None:
        found = asked
    elif run is not None:
        if "scan" in run:
            raise InputError(f"{path}: was made on the scan {run['scan']!r}; give it with --body FILE")
        found = check_table(MannequinTable, run, f"{path / 'metrics.json'}: mannequin.table")
    elif designed:
        return None
    else:
        raise InputError(f'{path}: says nothing of a body; give --body "EU 38" or --body SCAN.obj')
    with errors_named("--body" if given is not None else "mannequin"):
        return mannequin_from_table(found, path_of=Path)


def drape_outside(
    job: OutsideJob,
    out: str | Path,
    *,
    fabric: str | None = None,
    shear_limit: float | None = None,
    size: str | None = None,
    device: str | None = None,
    usd: bool = False,
    correct: bool = False,
) -> SceneResult:
    """Drape a pattern from outside; write `metrics.json`, `NAME.draped.obj` per piece, `frames.usdc` and pictures, all of them or none.

    Corrected, it is let out where the worn cloth is stretched beyond its limit (see `relieve_pattern`), and `NAME.corrected.dxf`,
    `NAME.corrected.svg` and `corrected.png` are written, too.

    Args:
        job: what is draped.
        out: folder for the files, made if need be.
        fabric: a name, before that of the sewing file and of the pattern; "woven" if none of them says one.
        shear_limit: in place of the fabric's [degrees].
        size: of the pattern; its sample size if not given.
        device: Warp device.
        usd: whether `worn.usdc` is written, too.
        correct: whether the pattern is corrected.

    Raises:
        InputError: an unknown fabric or size, a pattern that cannot be meshed, placed or written.
    """
    import warp as wp

    from warpflat.core import report_activity
    from warpflat.flat import run_metrics
    from warpflat.garment import (
        Placement,
        drape_pattern,
        files_of_drape,
        relieve_pattern,
        write_drape_files,
    )
    from warpflat.pattern import PatternOptions, optional_file, output_folder, remove_stale, write_pattern

    table, pattern = job.sewing.drape, job.pattern
    cloth, notes = _fabric(job, fabric)
    cloth = cloth.allowing(shear_limit)
    usd, correct = usd or table.usd, correct or table.correct
    # Of other sizes the run has neither the designed surface nor the girths.
    is_sample = size in (None, pattern.sample)
    names = ["metrics.json", *files_of_drape([], picture=True, frames=True, usd=usd)]
    if correct:
        names += ["corrected.png", f"{job.name}.corrected.dxf", f"{job.name}.corrected.svg"]
    with output_folder(out, names, sources=job.sources, guard=True) as folder:
        report_activity("draping")
        with errors_named(str(job.path)):
            lifts = job.lifts if is_sample else {}
            placement = Placement(
                top=job.sewing.top, lifts=lifts, size=size, spacing=1e-3 * job.sewing.spacing_mm, hold=table.hold
            )
            draped, more = drape_pattern(
                pattern, job.body, fabric=cloth, placement=placement, options=table.options(), device=device
            )
        files, entry = write_drape_files(draped, folder, frames=True, usd=usd), draped.measures()
        corrected: Sequence[str] = ()
        if correct and not draped.converged:
            corrected = ["the pattern was not corrected, as the drape is not at rest; raise max_steps in [drape]"]
        elif correct:
            report_activity("correcting the pattern")
            with errors_named(str(job.path)):
                found = relieve_pattern(draped, hold=table.hold)
            entry["correction"] = found.measures()
            with optional_file(folder / "corrected.png", files) as path:
                from warpflat.garment import write_correction_picture

                write_correction_picture(path, found)
            moved = found.drawn(pattern, pattern.sample if size is None else size)
            drawing = PatternOptions(formats=("dxf", "svg"))
            written = write_pattern(lambda: (moved, ()), folder, name=f"{job.name}.corrected", options=drawing)
            files += written.files
            corrected = [found.describe(), *written.notes]
        files.append("metrics.json")
        girths = job.girths_on_body() if is_sample else {}
        body = {} if job.body is None else {"mannequin": job.body.metrics(), "girths": girths}
        measured = run_metrics({}, wp.get_device(device), {**body, "drape": entry})
        metrics, stale = remove_stale(folder, measured, name=job.name, files=files, drape=True)
    # A report in few lines tells the first of them.
    told = (*corrected, *notes, *more, *pattern.notes, *stale)
    return SceneResult(metrics=metrics, files=tuple(files), notes=told)


def _fabric(job: OutsideJob, name: str | None) -> tuple[Any, Sequence[str]]:
    """Return the cloth, and a note where it is a guess."""
    from warpflat.flat import find_fabric, load_library

    library = load_library()
    asked = name or job.sewing.fabric
    if asked is not None:
        return find_fabric(asked, library), ()
    own = {piece.fabric for piece in job.pattern.pieces[job.pattern.sample]}
    known = sorted(own & set(library))
    if known:
        return find_fabric(known[0], library), ()
    return find_fabric("woven", library), (
        "the pattern names no cloth of the library: woven is taken; --fabric names another",
    )
