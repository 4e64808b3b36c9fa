"""A garment as it is worn: its line drawing, its measures beside the body's, and openings that it needs; for a pattern's first page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from warpflat.core import FloatArray

__all__ = ["ClothKind", "Measure", "NeededOpening", "ViewedPiece", "Worn"]


@dataclass(frozen=True, kw_only=True, eq=False)
class ViewedPiece:
    """A piece as it is seen from one side.

    Attributes:
        outlines: #P by 2 [m], closed, first point not repeated: what it covers.
        lines: #P by 2 [m], its edges and darts on the near side.
    """

    outlines: tuple[FloatArray, ...]
    lines: tuple[FloatArray, ...]


@dataclass(frozen=True, kw_only=True)
class Measure:
    """A girth [m] of the body and of the finished garment, and the ease that was asked for there; None where none was."""

    name: str
    body: float
    finished: float
    asked: float | None = None

    @property
    def ease(self) -> float:
        """What the garment has more than the body [m], to a millimetre."""
        return round(self.finished - self.body, 3)

    @property
    def misses(self) -> bool:
        """True if the ease is more than 5 mm off the one that was asked for."""
        return self.asked is not None and abs(self.finished - self.body - self.asked) > 5e-3


@dataclass(frozen=True, kw_only=True)
class ClothKind:
    """What a shop knows a cloth by.

    Attributes:
        kind: "woven" or "knit".
        weight: [kg/m2].
        stretch: how far a hand's pull of 98.1 N/m stretches it along and across, as shares.
        examples: cloths of the kind.
    """

    kind: str
    weight: float
    stretch: tuple[float, float]
    examples: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class NeededOpening:
    """A way around the garment [m] that is too small for what must pass it, and how deep it has to be opened.

    Attributes:
        ring: the line or level.
        length: of the ring in the pattern.
        over: what of the body must pass.
        girth: of that.
        depth: of the opening.
    """

    ring: str
    length: float
    over: str
    girth: float
    depth: float


@dataclass(frozen=True, kw_only=True)
class Worn:
    """What is known of a garment on its body.

    Attributes:
        views: "front" and "back", the farthest piece first; x to the right, y up [m].
        measures: by size.
        needed: openings that are missing, of the sample size.
        knits: names of its cloths that are knits.
        failing: why it does not fit, the kinds of what fails in its run's verdict; nothing where it fits.
        cloths: by name what a shop knows them by.
        buttonholes: the half that has them and lies above, "right" for women, "left" for men.
    """

    views: Mapping[str, tuple[ViewedPiece, ...]] = field(default_factory=dict)
    measures: Mapping[str, tuple[Measure, ...]] = field(default_factory=dict)
    needed: tuple[NeededOpening, ...] = ()
    knits: tuple[str, ...] = ()
    failing: tuple[str, ...] = ()
    cloths: Mapping[str, ClothKind] = field(default_factory=dict)
    buttonholes: str = "right"
