"""Pattern files of a run: `NAME.dxf`, `NAME.svg`, `pattern.pdf`, `pattern.json`, and the marker if it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpflat._version import __version__
from warpflat.core import (
    InputError,
    foreign_words,
    format_count,
    is_number,
    make_file_name,
    nearest,
    other_kind_words,
    report_activity,
    same_file,
)
from warpflat.pattern.drafting.edge_rules import EdgeRules
from warpflat.pattern.drafting.shrinkage import Shrinkage, enlarged
from warpflat.pattern.export.letters import plain_letters
from warpflat.pattern.files.left_out import LeftOut, listening_to_left_out
from warpflat.pattern.files.output import file_in, optional_step, output_folder, record_file, write_json, write_report

if TYPE_CHECKING:
    from warpflat.pattern.drafting.drafted import DraftedGarment
    from warpflat.pattern.drafting.marker import Cloth
    from warpflat.pattern.drafting.pieces import Pattern
    from warpflat.pattern.drafting.walked import WalkedSeam

__all__ = [
    "CLOTH_WIDTH",
    "FORMATS",
    "PatternOptions",
    "WrittenPattern",
    "check_names",
    "export_patterns",
    "lay_markers",
    "pattern_names",
    "write_pattern",
]

#: Usable width of the cloth [m], if nobody says another one: what is left of a cloth of 1.45 m between its selvedges.
CLOTH_WIDTH = 1.40
#: The formats, and the names of their files; the first four are written if nothing is said.
FORMATS = {
    "dxf": "{}.dxf",
    "svg": "{}.svg",
    "pdf": "pattern.pdf",
    "json": "pattern.json",
    "garmentcode": "{}_specification.json",
    "plt": "{}.plt",
}
_USUAL = ("dxf", "svg", "pdf", "json")
_MARKER = (".marker.svg", ".marker.json")


@dataclass(frozen=True, kw_only=True)
class PatternOptions:
    """The formats of a pattern, and options of the drawing.

    Attributes:
        formats: some of "dxf", "svg", "pdf", "json", "garmentcode" and "plt".
        dialect: of the DXF, "aama" or "astm".
        paper: of the PDF, "A4", "Letter", "A0" or "Projector".
        tolerance: how far [m] a drawn curve may lie from the mesh's border; None takes 0.1 mm, and more only where the
            border is so ragged that its curves would be all wiggles, as on scans.
        rules: kinds and allowances of edges.
        cloth: what the marker is laid on; None makes no marker.
        marker_seconds: time for the nesting.
        units: of lengths in printed words, "mm", "cm" or "in".
        names: by piece what is printed instead of its name.
        shrinkage: of the shell's cloth; its pieces are drawn larger.
        words: what is printed instead of English words and names.
        lining, interfacing, pocketing: what these cloths are called; none without a name.
        true: whether edges are made to run on smoothly across seams; not of a pattern that is taken as it is.
    """

    formats: Sequence[str] = _USUAL
    dialect: str = "aama"
    paper: str = "A4"
    tolerance: float | None = None
    rules: EdgeRules = field(default_factory=EdgeRules)
    cloth: Cloth | None = None
    marker_seconds: int = 5
    units: str = "cm"
    names: Mapping[str, str] = field(default_factory=dict)
    shrinkage: Shrinkage = field(default_factory=Shrinkage)
    words: Mapping[str, str] = field(default_factory=dict)
    lining: str = ""
    interfacing: str = ""
    pocketing: str = ""
    true: bool = True

    @property
    def cloth_width(self) -> float:
        """Usable width [m] of the cloth that strips and flounces are cut from."""
        width = CLOTH_WIDTH
        if self.cloth is not None:
            width = (0.5 if self.cloth.folded else 1.0) * self.cloth.width - 2.0 * self.cloth.gap
        return width * (1.0 - self.shrinkage.weft)


@dataclass(frozen=True, kw_only=True)
class WrittenPattern:
    """The written files.

    Attributes:
        files: their names.
        notes: what the maker should know, one sentence each.
        metrics: entries of `metrics.json`.
        walked: the seams of the pattern, for their picture.
    """

    files: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    metrics: Mapping[str, Any] = field(default_factory=dict)
    walked: tuple[WalkedSeam, ...] = ()


def export_patterns(
    source: Path,
    formats: Sequence[str],
    *,
    out: Path | None = None,
    allowance: float | None = None,
    dialect: str = "aama",
    paper: str = "A4",
    sizes: Sequence[str] | None = None,
    units: str | None = None,
) -> tuple[list[Path], list[str]]:
    """Write files of a pattern, all or none, from its `pattern.json` or the file of another program.

    Args:
        source: the folder of a run, its `pattern.json`, or a file of GarmentCode, a DXF or an SVG.
        formats: some of "dxf", "svg", "pdf", "json", "garmentcode" and "plt".
        out: the folder for the files; that of the run, or out/NAME for a file of another program, if not given.
        allowance: [m] of a file that knows of none (see :func:`warpflat.pattern.export.read_pattern.read_drafted`).
        dialect: of a DXF.
        paper: of a PDF.
        sizes: only these; None takes all. Not for "json", from which the others are made.
        units: of lengths in printed words, "mm", "cm" or "in", and in inches of a DXF; None leaves them.

    Returns:
        The files, and what the file has beside the pattern and their formats leave out, one sentence each.

    Raises:
        InputError: there is no pattern, an unknown format, dialect, paper or size, sizes of "json", an allowance of a pattern that
            has its own, or the folder cannot be written.
    """
    _check_formats(formats)
    if "json" in formats and sizes is not None:
        raise InputError(
            "pattern.json holds all sizes, since the other formats are made from it: leave out the size, or take dxf, svg or pdf"
        )
    if "garmentcode" in formats and sizes is not None and len(sizes) > 1:
        raise InputError(f"a file of GarmentCode holds one size: give one --size, not {', '.join(sizes)}")
    with _rewritten(source, out, allowance, units, over_itself="json" in formats) as (drafted, folder, name, files):
        drafted, notes = drafted.of_sizes(sizes), list(drafted.pattern.notes)
        for format in formats:
            written, lost = _write(
                drafted, folder, format, name=name, dialect=dialect, paper=paper, english=units == "in"
            )
            files += written
            notes += lost
    return [folder / file for file in files], notes


def lay_markers(
    source: Path,
    cloth: Cloth,
    *,
    out: Path | None = None,
    allowance: float | None = None,
    sizes: Mapping[str, int] | None = None,
    seconds: int = 5,
) -> tuple[list[Path], list[str], list[dict[str, Any]]]:
    """Write a marker for each cloth of a pattern, all or none.

    Args:
        source, out, allowance: as those of :func:`export_patterns`.
        cloth: what the pieces are laid on; its stripes are those of the first cloth.
        sizes: how many garments of each size; None lays one of each.
        seconds: time for each marker.

    Returns:
        The files, what the maker should know, one sentence each, and for each cloth its name, and its width and length [m] and the share
        that is used, or why there is no marker, as "not_made".

    Raises:
        InputError: there is no pattern, an unknown size or seam, no piece can be laid, or the folder cannot be written.
    """
    with _rewritten(source, out, allowance, None, over_itself=False) as (drafted, folder, name, files):
        cloth.stripes.check_seams(drafted)
        marked, remarks, plans = _marker(drafted, folder, name, cloth, seconds, sizes)
        files += marked
        if all("not_made" in plan for plan in plans):
            raise InputError(f"{source}: {plans[0]['not_made']}")
    return [folder / file for file in files], [*drafted.pattern.notes, *remarks], plans


@contextmanager
def _rewritten(
    source: Path, out: Path | None, allowance: float | None, units: str | None, *, over_itself: bool
) -> Iterator[tuple[DraftedGarment, Path, str, list[str]]]:
    """Read a pattern, and yield it with the folder, the name of its files and a list, to which their names are added.

    `over_itself` is whether pattern.json may be written over itself, as it may be where that is asked for.
    """
    from warpflat.pattern.export.read_pattern import PATTERN_ENDINGS, read_drafted

    is_file = source.suffix.lower() in PATTERN_ENDINGS and not source.is_dir()
    if not is_file and source.is_file():
        raise InputError(
            f"{source}: "
            + (
                foreign_words(source)
                or other_kind_words(source, "a pattern")
                or f"is no pattern; give the folder of a run, or a file that ends in {', '.join(PATTERN_ENDINGS)}"
            )
        )
    file = source if is_file else source / "pattern.json"
    drafted = read_drafted(file, allowance=allowance, units=units)
    own = file.name == "pattern.json"
    name = drafted.name if own else make_file_name(file.stem.removesuffix("_specification"))
    folder = out or (file.parent if own else Path("out") / name)
    files = list[str]()
    with output_folder(folder, sources=[] if over_itself and own and out is None else [file], guard=True):
        yield drafted, folder, name, files
        # A folder that is new knows its files from here on, so that the next export may replace them.
        if folder != file.parent and not (folder / "metrics.json").exists():
            head = {"schema": 1, "warpflat": __version__, "pieces": {}}
            write_report(folder / "metrics.json", head, name=name, files=files)
            files.append("metrics.json")
        else:
            for written in files:
                record_file(folder, name, written)


def _check_formats(formats: Iterable[str]) -> None:
    for format in formats:
        if format not in FORMATS:
            raise InputError(f"unknown format {format!r}; {nearest(format, FORMATS)}")


def write_pattern(
    make: Callable[[], tuple[Pattern, tuple[str, ...]]], to: str | Path, *, name: str, options: PatternOptions
) -> WrittenPattern:
    """Make, draft and write a pattern; what cannot be drawn or written is left out (:func:`warpflat.pattern.files.output.optional_step`).

    A pattern that cannot be drawn becomes a note, not an error: by then the garment has been flattened and its other
    files are good.

    Args:
        make: returns the pattern, and notes on it.
        to: the folder, created if it does not exist.
        name: of the files.
        options: formats, rules and cloth.

    Raises:
        InputError: an unknown format, a tolerance that is no length, or the folder cannot be written.
    """
    from warpflat.pattern.drafting.curves import TOLERANCE
    from warpflat.pattern.drafting.cut_list import cut_list
    from warpflat.pattern.drafting.draft import draft_garment
    from warpflat.pattern.drafting.seam_difference import LOCAL_TOLERANCE
    from warpflat.pattern.drafting.walked import walk_seams

    _check_formats(options.formats)
    if options.tolerance is not None and not (is_number(options.tolerance) and options.tolerance >= 0.0):
        raise InputError(f"tolerance = {options.tolerance!r} is no length; give one in metres, such as 1e-4, or None")
    if not options.formats and options.cloth is None:
        return WrittenPattern()
    report_activity("drafting the pattern")
    heard = list[LeftOut]()
    with listening_to_left_out(heard.append):
        with optional_step("no pattern was drawn", folder=Path(to)) as not_drawn:
            pattern, known = make()
            # In the printed names and units that were asked for.
            pattern = replace(pattern, words=options.words).with_each(
                lambda piece: replace(piece, title=options.names.get(piece.name, ""), units=options.units)
            )
            drafted = draft_garment(pattern, tolerance=options.tolerance, true=options.true)
        if not_drawn:
            return WrittenPattern(notes=tuple(not_drawn), metrics={"pattern": {"not_drawn": _reason(not_drawn[0])}})
        notes, ragged = list(known), dict[str, float]()
        for piece in drafted:
            for edge in piece.edges:
                if options.tolerance is None and edge.tolerance > TOLERANCE:
                    name_of = f"{piece.name}.{edge.name}"
                    ragged[name_of] = max(ragged.get(name_of, 0.0), edge.fit_error)
        if ragged:
            within = max(ragged.values()) * 1000
            notes.append(f"the border is ragged at {', '.join(ragged)}: the curves keep within {within:.1f} mm of it")
        notes += [f"{piece.name}: {note}" for piece in drafted for note in piece.notes]
        missed = [
            seam for seam in drafted.seams if seam.notches_mm is not None and seam.notches_mm > 1000 * LOCAL_TOLERANCE
        ]
        notes += [f"{seam.name}: its notches miss each other by {seam.notches_mm:.1f} mm" for seam in missed]
        walked = walk_seams(drafted)
        drafted = enlarged(drafted, options.shrinkage, next(iter(pattern)).fabric)
        near = [seam.local_mm for seam in drafted.seams if seam.local_mm is not None]
        edges = [edge for piece in drafted for edge in piece.edges]
        cloths = cut_list(drafted.pieces[drafted.sample])
        metrics: dict[str, Any] = {
            # How far curves stray from the mesh, and sides of seams from each other, at worst.
            "pattern": {
                "fit_error_mm": 1000 * max(edge.fit_error for edge in edges),
                "seam_difference_mm": max((abs(seam.difference_mm) for seam in drafted.seams), default=None),
                "seam_difference_per_50mm_mm": max(near, default=None),
                "seams_that_differ": sorted({seam.name for seam in drafted.seams if not seam.matches}),
            },
            "cloths": [{"name": cloth, "pieces": [asdict(entry) for entry in rows]} for cloth, rows in cloths.items()],
            "corners": [asdict(corner) for corner in drafted.corners],
            "walked": [
                {
                    "name": seam.name,
                    "size": seam.size,
                    "difference_mm": seam.difference_mm,
                    "notches_mm": seam.notches_mm,
                }
                for seam in drafted.seams
            ],
        }
        written = _write_files(drafted, to, name=name, options=options)
    notes += [*written.notes, *(step.note for step in heard)]
    return replace(written, notes=tuple(dict.fromkeys(notes)), metrics={**metrics, **written.metrics}, walked=walked)


def _write_files(drafted: DraftedGarment, to: str | Path, *, name: str, options: PatternOptions) -> WrittenPattern:
    """Write the files of a drafted pattern, and its marker, whose measures are the metrics; what cannot be written is left out."""
    from warpflat.pattern.export.pdf import too_many_sheets

    files, notes, metrics = list[str](), list[str](), dict[str, Any]()
    with output_folder(to) as folder:
        for kind in FORMATS:
            if kind not in options.formats:
                continue
            # What nobody would print is no loss.
            refused = too_many_sheets(drafted, options.paper) if kind == "pdf" else ""
            with optional_step(f"{FORMATS[kind].format(name)} was left out", folder=folder, is_needed=not refused):
                if refused:
                    raise InputError(refused)
                written, lost = _write(drafted, folder, kind, name=name, dialect=options.dialect, paper=options.paper)
                files += written
                notes += lost
        if options.cloth is not None:
            with optional_step("no marker was made", folder=folder) as not_made:
                marked, remarks, plans = _marker(drafted, folder, name, options.cloth, options.marker_seconds)
                files += marked
                notes += remarks
                metrics["marker"] = plans[0]
            if not_made:
                metrics["marker"] = {"not_made": _reason(not_made[0])}
    return WrittenPattern(files=tuple(files), notes=tuple(notes), metrics=metrics)


def pattern_names(name: str, formats: Iterable[str], *, marker: bool = False) -> list[str]:
    """Return the names of the files of a pattern, as far as they are known: without rules of sizes, or markers of further cloths."""
    files = [FORMATS[kind].format(name) for kind in FORMATS if kind in formats]
    return [*files, *(f"{name}{ending}" for ending in _MARKER if marker)]


def check_names(names: Mapping[str, str], pieces: Iterable[str]) -> None:
    """Check that printed names are for pieces that there are.

    Raises:
        InputError: there is no such piece; gives the nearest.
    """
    known = list(pieces)
    for name in names:
        if name not in known:
            raise InputError(f"names: there is no piece {name!r}; {nearest(name, known)}")


def _reason(note: str) -> str:
    """Return what follows the first colon of a note on a step that was left out."""
    return note.partition(": ")[2]


def _write(
    drafted: DraftedGarment,
    folder: Path,
    kind: str,
    *,
    name: str,
    dialect: str,
    paper: str,
    english: bool = False,
) -> tuple[list[str], tuple[str, ...]]:
    """Write one format and return the names of its files, and what it leaves out."""
    from warpflat.pattern.export.dxf import write_dxf
    from warpflat.pattern.export.garmentcode import write_garmentcode
    from warpflat.pattern.export.pattern_json import write_pattern_json
    from warpflat.pattern.export.pdf import write_pdf
    from warpflat.pattern.export.plt import write_plt
    from warpflat.pattern.export.svg import write_svg

    start, _, ending = FORMATS[kind].partition("{}")
    file = file_in(folder, start or name, ending) if "{}" in FORMATS[kind] else folder / start
    files, lost = [file.name], tuple[str, ...]()
    report_activity(f"writing {file.name}")
    if kind == "dxf":
        # Of several sizes the rules by which they are graded are a file of their own.
        rul = file_in(folder, name, ".rul") if len(drafted.pieces) > 1 else None
        files += [] if rul is None else [rul.name]
        write_dxf(drafted, file, dialect=dialect, units="english" if english else "metric", rul=rul)
    elif kind == "svg":
        write_svg(drafted, file)
    elif kind == "pdf":
        write_pdf(drafted, file, paper=paper)
    elif kind == "plt":
        write_plt(drafted, file)
    elif kind == "garmentcode":
        lost = write_garmentcode(drafted, file)
    else:
        write_pattern_json(drafted, file)
    return files, lost


def _marker(
    drafted: DraftedGarment,
    folder: Path,
    name: str,
    cloth: Cloth,
    seconds: int,
    sizes: Mapping[str, int] | None = None,
) -> tuple[list[str], tuple[str, ...], list[dict[str, Any]]]:
    """Write `NAME.marker.svg` and `NAME.marker.json` for each cloth, one garment of each size if `sizes` does not say how many.

    Returns names, notes and the measures of each marker, or why there is none.
    """
    from warpflat.pattern.drafting.marker import make_marker
    from warpflat.pattern.drafting.matched_lay import Stripes
    from warpflat.pattern.export.svg import write_marker_svg

    report_activity(f"laying the marker, {seconds} s at most")
    cloths = list(dict.fromkeys(each for piece in drafted for each in piece.piece.cloths))
    names, remarks, plans, stems = list[str](), list[str](), list[dict[str, Any]](), list[str]()
    for number, fabric in enumerate(cloths):
        own = cloth if number == 0 else replace(cloth, stripes=Stripes())
        of = "" if number == 0 else f" of {fabric}"
        with optional_step(f"no marker{of} was made", folder=folder) as not_made:
            marker = make_marker(drafted, own, fabric=fabric if len(cloths) > 1 else "", sizes=sizes, seconds=seconds)
        if not_made:
            plans.append({"not_made": _reason(not_made[0])})
            continue
        # The shell's marker has no more than the garment's name; two cloths may be called alike in letters that a file can have.
        stem = make_file_name(name if number == 0 else f"{name}.{plain_letters(fabric).replace(' ', '_')}")
        alike = sum(same_file(stem) == same_file(other) for other in stems)
        stems.append(stem)
        stem += f"_{alike + 1}" if alike else ""
        files = [file_in(folder, stem, ending) for ending in _MARKER]
        write_marker_svg(marker, files[0])
        placements: list[dict[str, Any]] = [
            {
                "piece": copy.piece.name,
                "size": copy.piece.size,
                "mirrored": copy.mirrored,
                "turned": copy.turned,
                "matrix": copy.matrix.tolist(),
            }
            for copy in marker.placements
        ]
        measures: dict[str, Any] = {
            "width_m": marker.width,
            "length_m": marker.length,
            "utilisation": marker.utilisation,
            "pieces": len(placements),
            "garments": len(drafted.pieces) if sizes is None else sum(sizes.values()),
            "folded": marker.folded,
        }
        write_json(files[1], {"schema": 1, **measures, "placements": placements})
        names += [file.name for file in files]
        plans.append(measures)
        wide = f"{marker.width:.2f} m wide" + (" when folded" if marker.folded else "")
        remarks.append(
            f"marker{of}: {marker.length:.2f} m of cloth {wide}, {marker.utilisation:.1%} of it "
            f"used by {format_count(len(placements), 'piece')}"
        )
        spare = [
            copy.piece.name
            for copy in marker.placements
            if marker.folded and not copy.piece.piece.on_fold
            if copy.piece.piece.cloths[fabric] * (1 if sizes is None else sizes[copy.piece.size]) % 2
        ]
        if spare:
            remarks.append(f"marker{of}: the cloth lies double: {', '.join(dict.fromkeys(spare))} cut once too often")
    return names, tuple(remarks), plans
