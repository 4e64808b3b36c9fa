"""Patterns read from whichever file: pattern.json, the JSON of GarmentCode, DXF and SVG."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from warpflat.core import InputError, guarded, make_file_name
from warpflat.pattern.drafting.draft import draft_garment, relabelled
from warpflat.pattern.drafting.drafted import DraftedGarment
from warpflat.pattern.drafting.pieces import Pattern
from warpflat.pattern.drafting.words import printed_in
from warpflat.pattern.export.pattern_json import pattern_from_json, read_pattern_data
from warpflat.pattern.export.read_dxf import read_dxf
from warpflat.pattern.export.read_garmentcode import garmentcode_pattern
from warpflat.pattern.export.read_svg import read_svg

__all__ = ["PATTERN_ENDINGS", "read_drafted", "read_pattern"]

#: How the names of files of patterns end.
PATTERN_ENDINGS = (".json", ".dxf", ".svg")


def read_pattern(path: str | os.PathLike[str], *, allowance: float | None = None) -> Pattern:
    """Read the pieces and seams of a pattern.

    Args:
        path: a pattern.json of the package, the JSON of GarmentCode, a DXF, or an SVG in true size.
        allowance: from the cutting line to the sewing line [m], where a DXF or an SVG has no sewing line.

    Raises:
        InputError: the file cannot be read, or is no pattern.
    """
    ending = Path(path).suffix.lower()
    if ending in (".dxf", ".svg"):
        return (read_dxf if ending == ".dxf" else read_svg)(path, allowance=allowance)
    found = _read_json(Path(path))
    return found.pattern if isinstance(found, DraftedGarment) else found


def read_drafted(
    path: str | os.PathLike[str], *, allowance: float | None = None, units: str | None = None
) -> DraftedGarment:
    """Read a pattern that is ready to be written: a pattern.json, or one of another program, whose lines stay as they are.

    Args:
        path: of the file.
        allowance: [m] around the panels of GarmentCode, which has none, that of seams if not given; of a DXF or an SVG without a sewing
            line as :func:`read_pattern` has it.
        units: of lengths in printed words, "mm", "cm" or "in"; those of the pattern, or centimetres, if not given.

    Raises:
        InputError: the file cannot be read, is no such pattern, or has allowances of its own.
    """
    if Path(path).suffix.lower() in (".dxf", ".svg"):
        pattern = read_pattern(path, allowance=allowance)
        with guarded(Path(path), "pattern"):
            return draft_garment(_printed_in(pattern, units), true=False)
    found = _read_json(Path(path))
    if isinstance(found, DraftedGarment):
        if allowance is not None:
            raise InputError(f"{path}: has allowances of its own; --allowance is for a pattern without")
        if units is None:
            return found
        garment = _printed_in(found.pattern, units)
        with printed_in(garment.words):
            return replace(found, pattern=garment).with_each(
                lambda piece: relabelled(replace(piece, piece=garment.piece(piece.name, piece.size)), garment.name, ())
            )
    with guarded(Path(path), "pattern"):
        wide = found.with_each(
            lambda piece: replace(
                piece,
                edges=[each if each.kind == "dart" else replace(each, allowance=allowance) for each in piece.edges],
            )
        )
        return draft_garment(_printed_in(wide, units), true=False)


def _printed_in(pattern: Pattern, units: str | None) -> Pattern:
    """Return a pattern whose printed lengths are in these units; None leaves them."""
    return pattern if units is None else pattern.with_each(lambda piece: replace(piece, units=units))


def _read_json(path: Path) -> Pattern | DraftedGarment:
    data = read_pattern_data(path)
    if isinstance(data, Mapping) and "pattern" in data and "sizes" not in data:
        with guarded(path, "pattern"):
            return garmentcode_pattern(data, make_file_name(path.stem.removesuffix("_specification")))
    with guarded(path, "JSON"):
        return pattern_from_json(data)
