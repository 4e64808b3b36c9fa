"""Tables of a scene about making up: openings, finishing pieces, pockets, cloth and marker."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from warpflat.core.toml_file import Table

__all__ = ["ClothTable", "FinishingTable", "MarkerTable", "OpeningTable", "PocketTable"]


class OpeningTable(Table):
    """An opening along a line of a form. A piece that runs across a centre line is parted there, with a seam below the opening.

    A `zip`, `buttons` and a `keyhole` are measured from the upper end of the line, a `slit` or `vent` from the lower one. Buttons
    run all along the line without a `length_mm`. A keyhole is cut into its piece and needs a facing.
    """

    kind: Literal["zip", "buttons", "slit", "vent", "keyhole"]
    seam: Annotated[str, Field(min_length=1, max_length=100)]
    length_mm: Annotated[float, Field(ge=10, le=2000)] | None = None
    start_mm: Annotated[float, Field(ge=0, le=1000)] = 0.0
    style: Literal["invisible", "lapped"] = "invisible"
    width_mm: Annotated[float, Field(ge=5, le=200)] | None = None
    """Of a slit's hem (15 mm if not given), a vent's flap (40), a button stand beyond the line (20), a keyhole's round end (12)."""
    button_mm: Annotated[float, Field(ge=5, le=60)] = 18.0
    spacing_mm: Annotated[float, Field(ge=20, le=300)] = 85.0
    """About how far buttons are apart; one lies on the bust line."""
    count: Annotated[int, Field(ge=2, le=60)] | None = None
    """How many buttons; as many as the spacing gives, if not given."""
    facing: Literal["grown-on", "separate"] = "grown-on"
    """Of a button stand."""
    facing_mm: Annotated[float, Field(ge=20, le=200)] = 60.0

    @model_validator(mode="after")
    def _fits_its_kind(self) -> OpeningTable:
        if self.kind == "zip" and self.width_mm is not None:
            raise ValueError("width_mm is that of a slit's hem or a vent's flap; leave it out for a zip")
        if self.kind != "zip" and (self.start_mm or "style" in self.model_fields_set):
            raise ValueError("start_mm and style belong to a zip; a slit or a vent begins at the lower end of its seam")
        if self.kind != "buttons" and self.length_mm is None:
            raise ValueError("length_mm is missing; only buttons run all along their line without one")
        own = {"button_mm", "spacing_mm", "count", "facing", "facing_mm"} & self.model_fields_set
        if self.kind != "buttons" and own:
            raise ValueError(f"{sorted(own)[0]} belongs to buttons; leave it out for a {self.kind}")
        return self


class FinishingTable(Table):
    """Pieces that finish free edges of a form: a facing of each piece, or one straight strip along the whole edge."""

    kind: Literal["facing", "band", "waistband", "binding"]
    edge: Annotated[str, Field(min_length=1, max_length=100)]
    width_mm: Annotated[float, Field(ge=5, le=300)] | None = None
    share: Annotated[float, Field(ge=0.5, le=1)] = 1.0
    overlap_mm: Annotated[float, Field(ge=0, le=200)] = 0.0
    shaped: bool = False
    """A waistband that is cut from the upper strip of the pieces, as curved as they are."""

    @model_validator(mode="after")
    def _fits_its_kind(self) -> FinishingTable:
        if self.kind != "band" and self.share != 1.0:
            raise ValueError("share belongs to a band, which is stretched as it is sewn; leave it out")
        if self.kind != "waistband" and self.overlap_mm:
            raise ValueError("overlap_mm belongs to a waistband; leave it out")
        if self.shaped and (self.kind != "waistband" or self.overlap_mm):
            raise ValueError("shaped belongs to a waistband without an overlap; leave one of them out")
        return self


class PocketTable(Table):
    """A pocket: a `patch` on a piece, its place marked, or bags in a seam (`inseam`), on both sides of the body.

    A patch lies `below_mm` under a line across its piece, its inner side `from_centre_mm` from the centre line. An opening begins
    `below_mm` under the upper end of its seam, and is `height_mm` long.
    """

    kind: Literal["patch", "inseam"]
    piece: Annotated[str, Field(max_length=100)] = ""
    line: Annotated[str, Field(max_length=100)] = "hip"
    seam: Annotated[str, Field(max_length=100)] = ""
    width_mm: Annotated[float, Field(ge=30, le=400)] = 140.0
    height_mm: Annotated[float, Field(ge=30, le=400)] = 160.0
    below_mm: Annotated[float, Field(ge=-500, le=1000)] = 60.0
    from_centre_mm: Annotated[float, Field(ge=0, le=500)] = 70.0

    @model_validator(mode="after")
    def _has_its_place(self) -> PocketTable:
        if self.kind == "patch" and not self.piece:
            raise ValueError('a patch pocket needs its piece: piece = "front"')
        if self.kind == "inseam" and (not self.seam or self.below_mm < 0):
            raise ValueError('an inseam pocket needs its seam, seam = "side left", and below_mm from 0')
        return self


class ClothTable(Table):
    """Cloth beside its fabric: what it loses in the wash, and what else the garment is cut from."""

    shrinkage_warp: Annotated[float, Field(ge=0, le=0.25)] = 0.0
    """Share of its length that the cloth loses along the warp; pieces are drawn larger by it."""
    shrinkage_weft: Annotated[float, Field(ge=0, le=0.25)] = 0.0
    lining: Annotated[str, Field(max_length=40)] = ""
    """What the lining is called; with a name the shell's pieces are lined."""
    repeat_warp_mm: Annotated[float, Field(ge=0, le=1000)] = 0.0
    """Repeat of stripes or checks along the warp; 0 where there is none."""
    repeat_weft_mm: Annotated[float, Field(ge=0, le=1000)] = 0.0
    match: list[str] = Field(default_factory=list)
    """Seams at whose first notch both sides lie on the same stripe in the marker."""
    interfacing: Annotated[str, Field(max_length=40)] = ""
    """What the interfacing is called; with a name facings and waistbands are cut from it too."""


class MarkerTable(Table):
    """The lay plan on a cloth (see `warpflat.Cloth`); one garment of each size. Lengths in metres."""

    width: Annotated[float, Field(ge=0.1, le=10)]
    one_way: bool = False
    reversible: bool = False
    gap: Annotated[float, Field(ge=0, le=0.1)] = 0.002
    seconds: Annotated[int, Field(ge=1, le=600)] = 5
    folded: bool = False
    """The cloth is folded lengthwise: halves lie against its fold, pairs are cut at once."""
