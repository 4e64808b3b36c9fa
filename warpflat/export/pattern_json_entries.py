"""The content of `pattern.json` as pydantic models, with types, bounds and lengths.

Lengths are metres, angles radians. Keys that follow from others, such as `on_fold`, are not read.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field, model_validator

from warpflat.core.file_names import check_label
from warpflat.core.text import control_in, quote_value
from warpflat.core.toml_file import Table

__all__ = ["DartEntry", "EdgeEntry", "LabelEntry", "NotchEntry", "PatternEntry", "PieceEntry", "SideEntry"]


#: No closed line of a pattern encloses less [m2].
SMALLEST_AREA = 1e-10


def _text(text: str) -> str:
    if letter := control_in(text, "\n"):
        raise ValueError(f"{quote_value(text)} has the control character {letter!r} in it")
    return text


def _ascending(shares: list[float]) -> list[float]:
    if shares[0] >= shares[1]:
        raise ValueError("the first share must be less than the second")
    return shares


def _ring(points: list[list[float]]) -> list[list[float]]:
    x, y = np.transpose(points)
    if abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2 < SMALLEST_AREA:
        raise ValueError("encloses no area")
    return points


# A larger coordinate is an error of units, and its powers may overflow.
Coordinate = Annotated[float, Field(ge=-10_000, le=10_000)]
Length = Annotated[float, Field(ge=0, le=10_000)]
Name = Annotated[str, AfterValidator(lambda name: check_label(name, "name"))]
Text = Annotated[str, AfterValidator(_text)]
Point = Annotated[list[Coordinate], Field(min_length=2, max_length=2)]
Shares = Annotated[
    list[Annotated[float, Field(ge=0.0, le=1.0)]], Field(min_length=2, max_length=2), AfterValidator(_ascending)
]
Ends = Annotated[list[Point], Field(min_length=2, max_length=2)]
Line = Annotated[list[Point], Field(min_length=2)]
Ring = Annotated[list[Point], Field(min_length=3), AfterValidator(_ring)]
Segment = Annotated[list[Point], Field(min_length=4, max_length=4)]
Row = Annotated[list[Coordinate], Field(min_length=3, max_length=3)]


class Entry(Table):
    """A part of the file; unknown keys are ignored."""

    model_config = ConfigDict(extra="ignore")


class EdgeEntry(Entry):
    """An edge of the sewing line (see `warpflat.pattern.drafted.DraftedEdge`)."""

    name: Name
    kind: Literal["seam", "hem", "fold", "cut", "dart"]
    allowance: Annotated[float, Field(ge=0, le=0.5)]
    bezier: Annotated[list[Segment], Field(min_length=1)]
    straight: list[bool]
    line: Line
    fit_error: Length
    tolerance: Length
    point_lengths: list[Length]
    mesh_vertices: list[Annotated[int, Field(ge=0, lt=2**31)]] | None

    @model_validator(mode="after")
    def _lengths_agree(self) -> EdgeEntry:
        if len(self.straight) != len(self.bezier):
            raise ValueError(
                f"straight has {len(self.straight)} entries, bezier {len(self.bezier)}; there is one for each curve"
            )
        if self.mesh_vertices is not None and len(self.mesh_vertices) != len(self.point_lengths):
            raise ValueError(
                f"mesh_vertices has {len(self.mesh_vertices)} entries, point_lengths {len(self.point_lengths)}; "
                "there is one for each point"
            )
        return self


class DartEntry(Entry):
    """A dart; its legs are edges."""

    name: Name
    left: Name
    right: Name
    tip: Point
    fold: Line | None
    fold_to: Literal["", "left", "right"]
    opening: float
    pleat: float | None = None


class NotchEntry(Entry):
    """A notch; a double one has two bases."""

    seam: Name
    edge: Name
    length: Length
    at: Point
    base: Annotated[list[Point], Field(min_length=1, max_length=2)]
    direction: Point
    depth: Length


class HoleEntry(Entry):
    """A drill hole."""

    name: Name
    at: Point


class LabelEntry(Entry):
    """The label of a piece: each text with the height of its capitals."""

    at: Point
    lines: Annotated[list[Text], Field(min_length=1)]
    heights: list[Annotated[float, Field(gt=0, le=10)]]
    angle: float = 0.0
    leader: Ends | None = None

    @model_validator(mode="after")
    def _lengths_agree(self) -> LabelEntry:
        if len(self.lines) != len(self.heights):
            raise ValueError(
                f"heights has {len(self.heights)} entries, lines {len(self.lines)}; there is one for each line"
            )
        return self


class PieceEntry(Entry):
    """A piece in one size (see `warpflat.pattern.drafted.DraftedPiece`).

    In files without `cutout_sew_lines` and `cutout_allowances` holes have no allowance: they are cut on the sewing
    line.
    """

    fabric: Text
    quantity: Annotated[int, Field(ge=1, le=1_000_000)]
    role: Literal["shell", "facing", "strip", "waistband", "lining", "interfacing", "pocket"] = "shell"
    also: dict[Text, Annotated[int, Field(ge=1, le=1_000_000)]] = Field(default_factory=dict)
    enlarged: Annotated[list[Annotated[float, Field(gt=0, le=2)]], Field(min_length=2, max_length=2)] = Field(
        default=[1.0, 1.0]
    )
    marks: list[Name] = Field(default_factory=list)
    paired: bool
    title: Text = ""
    printed_units: Literal["mm", "cm", "in"] = "cm"
    frame: Annotated[list[Row], Field(min_length=2, max_length=2)]
    edges: Annotated[list[EdgeEntry], Field(min_length=1)]
    cut_line: Ring
    darts: list[DartEntry]
    notches: list[NotchEntry]
    drill_holes: list[HoleEntry]
    internal_lines: dict[Name, Line]
    cutouts: dict[Name, Ring]
    cutout_sew_lines: dict[Name, Ring] = Field(default_factory=dict)
    cutout_allowances: dict[Name, Annotated[float, Field(ge=0, le=0.5)]] = Field(default_factory=dict)
    fisheye_darts: dict[Name, Ring]
    grain: Ends
    label: LabelEntry
    notes: list[Text]


class SideEntry(Entry):
    """One edge of a seam's side."""

    piece: Name
    edge: Name
    reversed: bool
    mirrored: bool = False


class StitchEntry(Entry):
    """A seam, or a dart that is sewn shut."""

    name: Name
    kind: Literal["seam", "dart"]
    ease: float
    eased: Shares = Field(default=[0.0, 1.0])
    sides: Annotated[list[Annotated[list[SideEntry], Field(min_length=1)]], Field(min_length=2, max_length=2)]


class SeamEntry(Entry):
    """The lengths of the two sides of a seam in one size (see `warpflat.pattern.drafted.SeamReport`)."""

    name: Name
    size: Text
    sides: Annotated[list[Text], Field(min_length=2, max_length=2)]
    length_mm: Annotated[list[float], Field(min_length=2, max_length=2)]
    ease: float
    difference_mm: float
    difference_per_50mm_mm: float | None


class PatternEntry(Entry):
    """The whole file: pieces by size and name, stitches, and the lengths of seams."""

    name: Name
    sample_size: Text
    words: dict[Text, Text] = Field(default_factory=dict)
    sizes: dict[Text, Annotated[dict[Name, PieceEntry], Field(min_length=1)]] = Field(min_length=1)
    stitches: list[StitchEntry]
    seams: list[SeamEntry]
