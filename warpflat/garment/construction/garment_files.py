"""The pattern files of a garment, and of a flattened surface."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from warpflat.garment.construction.edges import lengths_of
from warpflat.garment.construction.form_garment import FormGarment
from warpflat.garment.construction.girths import drawn_in
from warpflat.garment.construction.line_drawing import bands_of
from warpflat.garment.construction.linings import add_interfacing, add_lining, add_pocketing
from warpflat.pattern import PatternOptions, WrittenPattern, check_names, optional_step, write_pattern

if TYPE_CHECKING:
    from warpflat.flat import Flattening
    from warpflat.garment.construction.details import SeamTable
    from warpflat.garment.construction.garment import Garment
    from warpflat.pattern import Pattern

__all__ = ["garment_files", "surface_files"]

# A seam that is shorter in the pattern than as it was flattened by more than this [mm] ends at a cuff, a band or an opening: a drawn curve
# and its mesh differ by less.
_SHORTER = 1.0


def garment_files(
    garments: Mapping[str, Garment],
    folder: str | Path,
    *,
    name: str,
    options: PatternOptions | None = None,
    draw: Callable[[], tuple[Pattern, tuple[str, ...]]] | None = None,
) -> WrittenPattern:
    """Write the pattern of a garment; on a form in one or more sizes, of which several lie upon each other as a nest.

    A pattern that cannot be drawn becomes a note, not an error: by then the garment has been flattened and its other
    files are good.

    Args:
        garments: flattened, by size; "" where there is none.
        folder: created if it does not exist.
        name: of the files.
        options: formats, rules and cloth.
        draw: returns the pattern of the garments, and notes on it, as :func:`pattern_of_garment`, which does so otherwise.

    Raises:
        InputError: a printed name is for no piece, an unknown format, or the folder cannot be written.
    """
    from warpflat.garment.construction.to_pattern import pattern_of_garment

    options, first = options or PatternOptions(), next(iter(garments.values()))
    made: list[Pattern] = []
    if isinstance(first, FormGarment):
        check_names(options.names, first.parts)

    draw = draw or partial(
        pattern_of_garment, garments, name=name, rules=options.rules, cloth_width=options.cloth_width
    )

    def make() -> tuple[Pattern, tuple[str, ...]]:
        pattern, notes = draw()
        made.append(_with_linings(pattern, options, Path(folder)))
        return made[0], notes

    written = write_pattern(make, folder, name=name, options=options)
    sample = garments.get(made[0].sample) if made else None
    if not isinstance(sample, FormGarment):
        return written
    # What the pattern changes: cuffs and bands draw the garment in, and seams end where they begin.
    seams, (pattern,) = [seam.as_dict() for seam in sample.seams], made
    cut = {seam.name: seam for seam in pattern.seams}
    for seam in (each for each in seams if each["name"] in cut):
        sides = cut[seam["name"]].of_size(pattern.sample).sides
        lengths = [sum(1e3 * length for length in lengths_of(pattern, row)) for row in sides]
        if all(length < flat - _SHORTER for length, flat in zip(lengths, seam["length_mm"], strict=True)):
            seam["length_mm"] = lengths
    bands = bands_of(pattern, pattern.sample)
    further = {
        "seams": seams,
        "girths": drawn_in(sample.girths, bands),
        "rings": [ring.drawn_in(bands).as_dict() for ring in sample.rings],
    }
    return replace(written, metrics={**written.metrics, **further})


def surface_files(
    results: Sequence[Flattening],
    folder: str | Path,
    *,
    name: str,
    options: PatternOptions | None = None,
    seams: Sequence[SeamTable] = (),
) -> WrittenPattern:
    """Write the pattern of a flattened surface, or of the pieces into which cuts have parted it.

    A pattern that cannot be drawn becomes a note, as in :func:`garment_files`.

    Args:
        results: the pieces.
        folder: created if it does not exist.
        name: of the files.
        options: formats, rules and cloth.
        seams: the named seams of its border.

    Raises:
        InputError: an unknown format, or the folder cannot be written.
    """
    from warpflat.garment.construction.to_pattern import pattern_of_surface

    options = options or PatternOptions()

    def make() -> tuple[Pattern, tuple[str, ...]]:
        pattern, notes = pattern_of_surface(results, name=name, rules=options.rules, seams=seams)
        return _with_linings(pattern, options, Path(folder)), notes

    return write_pattern(make, folder, name=name, options=options)


def _with_linings(pattern: Pattern, options: PatternOptions, folder: Path) -> Pattern:
    """Return a pattern with the lining, interfacing and pocketing that were asked for, without those that cannot be made."""
    asked = (options.lining, add_lining), (options.interfacing, add_interfacing), (options.pocketing, add_pocketing)
    for cloth, add in asked:
        if cloth:
            with optional_step(f"the pattern has no {cloth}", folder=folder):
                pattern = add(pattern, cloth)
    return pattern
