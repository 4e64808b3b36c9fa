"""Openings, finishing, pockets and seams of a garment, as a scene file lists them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from warpflat.core import Table, other_side, without_side

__all__ = ["FinishingTable", "OpeningTable", "PocketTable", "SeamTable"]

# Widths that are not given [mm]: of openings, of finishing, and of collars in the middle of the back.
_OPENING_MM = {"zip": 0.0, "slit": 15.0, "vent": 40.0, "buttons": 20.0, "keyhole": 12.0, "wrap": 120.0, "godet": 250.0}
_FINISHING_MM = {
    "facing": 60.0, "band": 20.0, "waistband": 35.0, "binding": 35.0, "cuff": 60.0, "ruffle": 80.0, "flounce": 120.0,
    "casing": 30.0, "hood": 0.0, "hem": 0.0,
}  # fmt: skip
_COLLAR_MM = {"stand": 35.0, "shirt": 30.0, "convertible": 75.0, "flat": 65.0, "turtleneck": 60.0}


def _in_metres(key: str) -> property:
    """Return a property of a table: the length [m] that it has under a key in millimetres."""
    return property(lambda table: 1e-3 * getattr(table, key))


class OfKind(Table):
    """A table with a `kind`, some keys of which belong to some kinds only."""

    of_kinds: ClassVar[Mapping[str, tuple[str, ...]]] = {}

    @model_validator(mode="after")
    def _belongs_to_its_kind(self) -> OfKind:
        kind = getattr(self, "kind", "")
        for key, kinds in self.of_kinds.items():
            if key in self.model_fields_set and kind not in kinds:
                words = " or ".join(kinds) if kinds == ("buttons",) else f"a {' or '.join(kinds)}"
                raise ValueError(f"{key} belongs to {words}; leave it out for a {kind}")
        return self


class OpeningTable(OfKind):
    """An opening along a line of a form. A piece that runs across a centre line is parted there, with a seam below the opening.

    A `zip`, `buttons` and a `keyhole` are measured from the upper end of the line, a `slit`, `vent` or `godet` from the lower one. Buttons
    and a zip run all along the line without a `length_mm`. A keyhole is cut into its piece and needs a facing. A `wrap` laps one half over
    the other all along a centre line; its neckline runs straight from the shoulder to the waist. A `godet` is a wedge that is sewn into
    the lower end of its seam.
    """

    of_kinds: ClassVar[Mapping[str, tuple[str, ...]]] = {
        **dict.fromkeys(("start_mm", "style"), ("zip",)),
        "length_share": ("zip", "buttons"),
        **dict.fromkeys(("button_mm", "spacing_mm", "count", "facing", "facing_mm"), ("buttons",)),
        "tie_mm": ("wrap",),
    }
    kind: Literal["zip", "buttons", "wrap", "slit", "vent", "godet", "keyhole"]
    seam: Annotated[str, Field(min_length=1, max_length=100)]
    length_mm: Annotated[float, Field(ge=10, le=2000)] | None = None
    length_share: Annotated[float, Field(gt=0, le=1)] | None = None
    """Where it ends, as a share of its line, so that it suits every wearer; rounded to a length in whole centimetres."""
    start_mm: Annotated[float, Field(ge=0, le=1000)] = 0.0
    style: Literal["invisible", "lapped"] = "invisible"
    width_mm: Annotated[float, Field(ge=5, le=1500)] | None = None
    """Of a slit's hem (15 mm if not given), a vent's flap (40), a button stand beyond the line (20), a keyhole's round end (12), a wrap
    beyond the line (120), a godet at its hem (250)."""
    button_mm: Annotated[float, Field(ge=5, le=60)] = 18.0
    spacing_mm: Annotated[float, Field(ge=20, le=300)] = 85.0
    """About how far buttons are apart; one lies on the bust line."""
    count: Annotated[int, Field(ge=2, le=60)] | None = None
    """How many buttons; as many as the spacing gives, if not given."""
    facing: Literal["grown-on", "separate"] | None = None
    """Of a button stand; grown on if not given, and separate where the garment is lined, as a lining is sewn to its inner edge."""
    facing_mm: Annotated[float, Field(ge=20, le=200)] = 60.0
    tie_mm: Annotated[float, Field(ge=0, le=2000)] = 900.0
    """Length of the ties of a wrap; 0 for none."""

    start, button, spacing = _in_metres("start_mm"), _in_metres("button_mm"), _in_metres("spacing_mm")
    facing_width, tie = _in_metres("facing_mm"), _in_metres("tie_mm")

    @property
    def length(self) -> float:
        """How long it is [m]; infinite all along its line."""
        return math.inf if self.length_mm is None else 1e-3 * self.length_mm

    @property
    def width(self) -> float:
        """Its width [m]."""
        return 1e-3 * (_OPENING_MM[self.kind] if self.width_mm is None else self.width_mm)

    @property
    def from_below(self) -> bool:
        """Whether it is measured from the lower end of its line."""
        return self.kind in ("slit", "vent", "godet")

    @property
    def parts_pieces(self) -> bool:
        """Whether pieces that run across its line are parted there; a keyhole is cut into its piece."""
        return self.kind != "keyhole"

    @property
    def opens_the_top(self) -> bool:
        """Whether it runs out into the upper edge."""
        return not self.from_below and self.start == 0.0

    @model_validator(mode="after")
    def _fits_its_kind(self) -> OpeningTable:
        if self.kind == "zip" and self.width_mm is not None:
            raise ValueError("width_mm is that of a slit's hem or a vent's flap; leave it out for a zip")
        if self.length_share is not None and self.length_mm is not None:
            raise ValueError("length_share belongs to a zip or buttons without length_mm; leave one of them out")
        if self.kind not in ("buttons", "zip", "wrap") and self.length_mm is None:
            raise ValueError("length_mm is missing; only buttons, zips and wraps run all along their line without one")
        if self.kind == "wrap" and (self.length_mm is not None or self.seam not in ("centre front", "centre back")):
            raise ValueError('a wrap runs all along a centre line: seam = "centre front", without length_mm')
        most = {"godet": 1500.0, "wrap": 400.0}.get(self.kind, 200.0)
        if (self.width_mm or 0.0) > most:
            raise ValueError(f"width_mm is at most {most:g} for a {self.kind}")
        if self.kind == "godet" and (self.width_mm or 0.0) > 3.0 * (self.length_mm or 0.0):
            raise ValueError(
                "width_mm of a godet is at most three times its length_mm: more than half a circle is a flounce"
            )
        return self


#: Keys of a collar that belong to some styles only.
_OF_STYLES = {
    "share": ("turtleneck",),
    "rise_mm": ("stand", "shirt"),
    "fall_mm": ("shirt",),
    "point_mm": ("shirt", "convertible"),
    "placket_mm": ("stand", "shirt", "convertible", "flat"),
}


class FinishingTable(OfKind):
    """Pieces that finish free edges of a form, hems too: what they are follows from the lengths of the edges that they are sewn to.

    A `facing` repeats each piece. One straight strip along the whole edge is a `band` or rib, a `waistband`, a `cuff`, a `binding` or
    a gathered `ruffle`. A `collar` and a `hood` go around the neck. A `flounce` is a part of a ring below each piece. A `casing` is
    turned in from the edge itself, for an elastic. A `hem` has no piece: it is cut higher, by `shorten_mm`.
    """

    of_kinds: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "share": ("band", "waistband", "cuff", "ruffle", "collar"),
        "overlap_mm": ("waistband", "cuff"),
        "shaped": ("waistband",),
        "shorten_mm": ("band", "waistband", "cuff", "ruffle", "flounce", "hem"),
        "elastic": ("casing", "band", "waistband"),
        "placket_mm": ("cuff", "collar"),
        "pleat_mm": ("ruffle",),
        "turns": ("flounce",),
        "style": ("collar",),
        "rise_mm": ("collar",),
        "fall_mm": ("collar",),
        "point_mm": ("collar",),
        "strip_mm": ("hood",),
    }
    kind: Literal[
        "facing", "band", "waistband", "binding", "cuff", "ruffle", "flounce", "casing", "collar", "hood", "hem"
    ]
    edge: Annotated[str, Field(min_length=1, max_length=100)]
    width_mm: Annotated[float, Field(ge=5, le=1500)] | None = None
    share: Annotated[float, Field(ge=0.5, le=5)] = 1.0
    """Length of a strip over that of its edge. A band of 0.85 is stretched, what is sewn to a cuff or waistband of 0.7 is gathered, a
    ruffle of 1.8 is gathered itself."""
    overlap_mm: Annotated[float, Field(ge=0, le=200)] = 0.0
    shaped: bool = False
    """A waistband that is cut from the upper strip of the pieces, as curved as they are."""
    shorten_mm: Annotated[float, Field(ge=0, le=800)] | dict[str, Annotated[float, Field(ge=0, le=800)]] = 0.0
    """The pieces end so far before the edge, because the strip takes the place. A table says how far where lines meet the edge, as
    `{ "side left" = 200, "side right" = 0 }` for a hem that slants; between those lines it changes smoothly."""
    elastic: Annotated[float, Field(ge=0, le=1.5)] = 0.0
    """Length of an elastic that is threaded through it, as a share of the body's girth there; 0 for none."""
    placket_mm: Annotated[float, Field(ge=0, le=300)] = 0.0
    """Length of a slit that opens the edge: behind in a sleeve, bound with a strip of its own; in the centre front below a collar, with
    two strips that button."""
    pleat_mm: Annotated[float, Field(ge=0, le=300)] = 0.0
    """Visible width of a pleat of a ruffle that is laid in pleats instead of gathered; with share = 3 they touch each other inside."""
    turns: Annotated[float, Field(ge=0.1, le=3)] = 0.5
    """How much of a circle a flounce is: 1 for a circle skirt, 0.5 for half of one."""
    style: Literal["stand", "shirt", "convertible", "flat", "turtleneck"] = "stand"
    """Of a collar: a stand; a stand with a fall; one that is both in one piece; one that lies flat around the neck (Peter Pan); a
    doubled band of a knit that is turned down."""
    rise_mm: Annotated[float, Field(ge=0, le=60)] = 15.0
    """By how much the front ends of a stand lie higher than its middle, so that it leans to the neck."""
    fall_mm: Annotated[float, Field(ge=20, le=150)] = 45.0
    """Width of a shirt collar's fall in the middle of the back; `width_mm` is that of its stand."""
    point_mm: Annotated[float, Field(ge=20, le=200)] = 65.0
    """Length of the front edge of a fall, from the stand to its point."""
    strip_mm: Annotated[float, Field(ge=0, le=250)] = 0.0
    """Width of the strip over the crown of a hood of three pieces; 0 for one of two."""

    overlap, placket, pleat = _in_metres("overlap_mm"), _in_metres("placket_mm"), _in_metres("pleat_mm")
    rise, fall = _in_metres("rise_mm"), _in_metres("fall_mm")
    point, strip = _in_metres("point_mm"), _in_metres("strip_mm")

    @property
    def width(self) -> float:
        """Its width [m]; of what is folded that of the finished piece, which is cut twice as wide."""
        usual = _COLLAR_MM[self.style] if self.kind == "collar" else _FINISHING_MM[self.kind]
        # A turtleneck is turned down upon itself.
        return (2e-3 if self.style == "turtleneck" else 1e-3) * (usual if self.width_mm is None else self.width_mm)

    @property
    def shorten(self) -> float | dict[str, float]:
        """By how much the pieces end before the edge [m]; by line, where lines meet the edge."""
        if isinstance(self.shorten_mm, dict):
            return {line: 1e-3 * mm for line, mm in self.shorten_mm.items()}
        return 1e-3 * self.shorten_mm

    @property
    def is_one_sided(self) -> bool:
        """Whether it makes one side of the body unlike the other."""
        by_line = self.shorten_mm if isinstance(self.shorten_mm, dict) else {}
        return any(by_line.get(other_side(line)) != mm for line, mm in by_line.items() if without_side(line) != line)

    @property
    def name(self) -> str:
        """What its pieces are called."""
        return self.kind if self.kind in ("waistband", "cuff", "collar") else f"{self.edge}_{self.kind}"

    @model_validator(mode="after")
    def _fits_its_kind(self) -> FinishingTable:
        for key, styles in _OF_STYLES.items() if self.kind == "collar" else ():
            if key in self.model_fields_set and self.style not in styles:
                raise ValueError(
                    f'{key} belongs to a {" or ".join(styles)} collar; leave it out for style = "{self.style}"'
                )
        if self.kind == "hem" and self.width_mm is not None:
            raise ValueError("width_mm of a hem is hem_mm of [pattern]; leave it out")
        if self.kind == "hood" and self.width_mm is not None:
            raise ValueError("width_mm of a hood follows from the head's girth; leave it out")
        if (self.width_mm or 0.0) > 300.0 and self.kind not in ("ruffle", "flounce"):
            raise ValueError(f"width_mm is at most 300 for a {self.kind}")
        if self.share > 1.0 and self.kind != "ruffle":
            raise ValueError(f"share is at most 1 for a {self.kind}, which does not gather; take a ruffle")
        if self.share < 1.0 and self.kind == "ruffle":
            raise ValueError("share is at least 1 for a ruffle, which is gathered as it is sewn")
        if self.shaped and (self.overlap_mm or self.share != 1.0 or self.elastic or self.shorten_mm):
            raise ValueError(
                "shaped belongs to a waistband without overlap_mm, share, elastic and shorten_mm; leave them out"
            )
        if (self.kind == "hem" or isinstance(self.shorten_mm, dict)) and not self.shorten_mm:
            raise ValueError(
                'shorten_mm is missing: how much higher it lies, as shorten_mm = { "side left" = 200, "side right" = 0 }'
            )
        if self.kind == "casing" and not self.elastic:
            raise ValueError("elastic is missing: its length as a share of the body's girth there, as elastic = 0.95")
        if self.pleat_mm and self.share < 1.5:
            raise ValueError(
                "a ruffle in pleats takes a share of at least 1.5; 3 for pleats that touch each other inside"
            )
        if self.kind == "cuff" and self.placket_mm and not self.overlap_mm:
            raise ValueError("a cuff with a placket needs an overlap for its button, overlap_mm = 25")
        return self


class PocketTable(OfKind):
    """A pocket on both sides of the body: a `patch` or a `welt` on a piece, its place marked, bags in a seam (`inseam`), or an opening
    from the upper edge of a front to its seam (`hip`).

    A patch or welt lies `below_mm` under a line across its piece, its inner side `from_centre_mm` from the centre line; on a leg it lies
    in the middle. An opening in a seam begins `below_mm` under the upper end of its seam, and is `height_mm` long. That of
    a hip pocket runs from `width_mm` beside the seam, on the upper edge, to `height_mm` below it.
    """

    of_kinds: ClassVar[Mapping[str, tuple[str, ...]]] = {"most_share": ("patch", "welt"), "welt_mm": ("welt",)}
    kind: Literal["patch", "welt", "inseam", "hip"]
    piece: Annotated[str, Field(max_length=100)] = ""
    line: Annotated[str, Field(max_length=100)] = "hip"
    seam: Annotated[str, Field(max_length=100)] = ""
    width_mm: Annotated[float, Field(ge=30, le=400)] = 140.0
    height_mm: Annotated[float, Field(ge=30, le=400)] = 160.0
    below_mm: Annotated[float, Field(ge=-500, le=1000)] = 60.0
    from_centre_mm: Annotated[float, Field(ge=0, le=500)] = 70.0
    welt_mm: Annotated[float, Field(ge=5, le=80)] = 15.0
    """Height of a welt."""
    most_share: Annotated[float, Field(gt=0, le=1)] | None = None
    """Share of `line` on its piece that a patch or welt takes at most. On a smaller wearer its width and height, and its distances from
    line and centre line, become smaller alike."""

    width, height, below = _in_metres("width_mm"), _in_metres("height_mm"), _in_metres("below_mm")
    from_centre, welt = _in_metres("from_centre_mm"), _in_metres("welt_mm")

    @model_validator(mode="after")
    def _has_its_place(self) -> PocketTable:
        if self.kind in ("patch", "welt") and not self.piece:
            raise ValueError(f'a {self.kind} pocket needs its piece: piece = "front"')
        if self.kind in ("inseam", "hip") and (not self.seam or self.below_mm < 0):
            raise ValueError(f'a pocket of kind {self.kind} needs its seam, seam = "side left", and below_mm from 0')
        return self


class SeamTable(Table):
    """A seam: on a form one of those that it has, on a [surface] two lines along its border that are sewn together.

    A form's seam is named as in the pattern, and one side is longer than the other. On a [surface] `sides` names the two lines,
    as "left" or "piece.left"; they may be equally long.

    `fullness` is eased in near the seam (0.02 is 2 %), at a sleeve's cap above its notches only. `gather` is the ratio of the
    lengths, and its fullness falls on through the piece. `longer` names the piece, "piece.edge" or line that is longer; the
    seam's second side if not given.
    """

    name: str = Field(min_length=1)
    sides: Annotated[list[str], Field(min_length=2, max_length=2)] | None = None
    fullness: Annotated[float, Field(ge=0, le=0.3)] | None = None
    gather: Annotated[float, Field(ge=1, le=5)] | None = None
    longer: str | None = None

    @property
    def factor(self) -> float:
        """How many times as long the longer side is."""
        return self.gather if self.gather is not None else 1.0 + (self.fullness or 0.0)

    @property
    def gathered(self) -> bool:
        """Whether its fullness falls on through the piece."""
        return self.gather is not None

    @property
    def lines(self) -> tuple[str, str]:
        """The two lines on a surface."""
        first, second = self.sides or ("", "")
        return first, second

    @property
    def longer_line(self) -> int:
        """Which of the two lines is longer, 0 or 1."""
        return 1 if self.longer is None else self.lines.index(self.longer)

    @property
    def ease(self) -> float:
        """The surplus length of the second line, as a share of the first."""
        return self.ease_if(self.longer_line)

    def ease_if(self, longer: int) -> float:
        """Return the surplus length of the second side, as a share of the first, where the first (0) or the second (1) is longer."""
        return self.factor - 1.0 if longer == 1 else 1.0 / self.factor - 1.0

    @model_validator(mode="after")
    def _one_way(self) -> SeamTable:
        given = (self.fullness is not None) + (self.gather is not None)
        if given > 1 or (given == 0 and self.sides is None):
            raise ValueError("give either fullness = 0.02 (2 %, eased in) or gather = 1.5 (times as long)")
        return self
