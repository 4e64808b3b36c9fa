"""Rings: closed ways around a garment, compared with what of the body must pass through them to put it on.

A ring is an edge that is closed once the seams are sewn (neck, waist, hem, sleeve hem), or a level of the trunk within the
pieces. A garment with a neck or armholes goes on over the head, so every ring of its trunk passes what the body has above
it; any other one, and a suit that has legs, is stepped into, and its rings pass what the body has below them. A sleeve passes
the hand and the arm below its hem, a leg the foot and the leg below its hem. The arms are raised on the way, so the bust stands
for the shoulders.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core import FloatArray, IntArray, find_unused_name
from warpflat.flat import chain_lines
from warpflat.garment.mannequin.layout import ARM_LEVELS, LEG_LINES, RING_LEVELS
from warpflat.pattern import line_name

if TYPE_CHECKING:
    from warpflat.garment.mannequin.forms import FormResult
    from warpflat.garment.mannequin.mannequin import Mannequin

__all__ = ["GarmentRing", "find_rings", "measure_rings"]

# What is rounded up to this [mm] is easy to measure off, and needs no more precision.
_ROUNDED_MM = 5.0


@dataclass(frozen=True, kw_only=True)
class GarmentRing:
    """A closed way around a garment.

    Attributes:
        name: of its line, as "neck" or "biceps left".
        edge: whether it is an edge of the cloth; otherwise a level within it.
        length: in the pattern, without what seams and darts take [m].
        stretched: the same at the cloth's strain limit [m].
        over: what must pass through it: a part of the body.
        girth: of that [m]; None if it is not known.
        source: of that girth.
        opened: what openings add to the ring [m].
    """

    name: str
    edge: bool
    length: float
    stretched: float
    over: str
    girth: float | None
    source: str
    opened: float = 0.0

    @property
    def passes(self) -> bool | None:
        """Whether the ring passes at the cloth's limit, openings open; None if the girth is not known."""
        return None if self.girth is None else bool(self.stretched + self.opened >= self.girth)

    @property
    def opening_needed_mm(self) -> float:
        """Depth of the opening through this ring [mm], rounded up to 5 mm; 0 where none is needed.

        The cloth counts as it lies: an edge that is faced or has a zip hardly stretches. A depth d adds 2 d.
        """
        if self.girth is None or self.stretched >= self.girth:
            return 0.0
        return _ROUNDED_MM * math.ceil(500.0 * (self.girth - self.length) / _ROUNDED_MM)

    def drawn_in(self, bands: Mapping[str, float]) -> GarmentRing:
        """Return the ring as the cuff or band is that it ends in, by line how long these are [m]."""
        band = bands.get(line_name(self.name)) if self.edge else None
        return self if band is None else replace(self, length=band, stretched=band * self.stretched / self.length)

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of `metrics.json`."""
        return {
            "name": self.name,
            "edge": self.edge,
            "length_mm": 1e3 * self.length,
            "stretched_mm": 1e3 * self.stretched,
            "over": self.over,
            "girth_mm": None if self.girth is None else 1e3 * self.girth,
            "source": self.source,
            "opened_mm": 1e3 * self.opened,
            "passes": self.passes,
            "opening_needed_mm": self.opening_needed_mm,
        }


def measure_rings(
    mannequin: Mannequin,
    form: FormResult,
    positions: Mapping[str, FloatArray],
    *,
    strain_limit: float,
    girths: Mapping[str, Mapping[str, float]],
    opened: Mapping[str, float] | None = None,
) -> list[GarmentRing]:
    """Compare every ring of a garment with what it passes over, from the neck down.

    Args:
        mannequin: the body.
        form: on it.
        positions: by piece, #V by 2 [m].
        strain_limit: of the cloth.
        girths: of the levels within the pieces (:func:`warpflat.garment.construction.girths.pattern_girths`).
        opened: by ring, what openings add [m].
    """
    opened, levels = opened or {}, mannequin.levels()
    edges = {name: length for name, (_, length) in find_rings(mannequin, form, positions).items()}
    # Neck and armholes are passed where they are edges.
    within = {name: girth["pattern_m"] for name, girth in girths.items() if not name.startswith(("neck", "armhole"))}
    lengths = within | edges
    limbs = {_line_of(name).partition(" ")[0] for name in edges if " " in _line_of(name)}
    over_head = any(_line_of(name).startswith(("neck", "armhole")) for name in edges) and not limbs & set(
        LEG_LINES.values()
    )
    found = []
    for name, length in lengths.items():
        # Over it is the widest part of the body that must pass through.
        line = _line_of(name)
        limb, _, side = line.partition(" ")
        if line == "neck":
            # A suit with legs is stepped into through its neck.
            ends, between = ("head", []) if over_head else ("", list(RING_LEVELS[: RING_LEVELS.index("waist")]))
        elif limb in ARM_LEVELS:
            ends, between = f"hand {side}", [f"{level} {side}" for level in ARM_LEVELS[ARM_LEVELS.index(limb) + 1 :]]
        elif side and limb in LEG_LINES.values():
            lines = list(LEG_LINES.values())
            ends, between = f"foot {side}", [f"{below} {side}" for below in lines[lines.index(limb) + 1 :]]
        elif over_head:
            ends, between = "head", list(RING_LEVELS[RING_LEVELS.index(line) + 1 :])
        else:
            ends, between = "", list(RING_LEVELS[: RING_LEVELS.index(line)])
        passing = {level: levels[level].girth for level in between}
        tape = mannequin.extremity(ends)
        if tape is not None:
            passing[ends] = tape
        if passing and (between or tape is not None):
            over = max(passing, key=lambda part: passing[part])
            girth, source = passing[over], mannequin.source
        elif ends:
            over, girth, source = ends, None, "not measured"
        else:
            over, girth, source = "nothing", 0.0, "nothing lies below it"
        found.append(
            GarmentRing(
                name=name, edge=name in edges, length=length, stretched=length * (1.0 + strain_limit), over=over,
                girth=girth, source=source, opened=opened.get(name, 0.0),
            )
        )  # fmt: skip
    return sorted(found, key=lambda ring: -levels[_line_of(ring.name)].height)


def find_rings(
    mannequin: Mannequin, form: FormResult, positions: Mapping[str, FloatArray]
) -> dict[str, tuple[IntArray, float]]:
    """Return the closed edges of the sewn garment by their lines, the longest first: vertices on the mannequin, and length [m].

    Of two at one line the shorter is "NAME 2".

    An edge of the mannequin is free where just one piece has it on its border, and once: seams and legs of darts have
    it twice. The mirror images of half pieces count, and the fold does not.
    """
    # The lengths [m] of the mannequin's edges on the borders of pieces, one per piece and side, folds left out.
    image, used = mannequin.layout.mirror, np.concatenate([piece.grid_vertices for piece in form.pieces.values()])
    # A half garment has the body's left alone; the middle is its own mirror image.
    half = not np.isin(image[used], used).all()
    border: dict[tuple[int, int], list[float]] = {}
    for name, piece in form.pieces.items():
        for edge, ids in piece.edges.items():
            if edge == piece.fold:
                continue
            lengths = np.linalg.norm(np.diff(positions[name][ids], axis=0), axis=1).tolist()
            grid = piece.grid_vertices[ids]
            for row in (grid, image[grid]) if half else (grid,):
                for (a, b), length in zip(itertools.pairwise(row.tolist()), lengths, strict=True):
                    border.setdefault((min(a, b), max(a, b)), []).append(length)
    free = {ends: lengths[0] for ends, lengths in border.items() if len(lengths) == 1}
    rings = []
    for chain in chain_lines(sorted(free)):
        if chain[0] == chain[-1]:
            length = sum(free[min(pair), max(pair)] for pair in itertools.pairwise(chain))
            rings.append((np.array(chain[:-1], dtype=np.int32), length))
    # Each lies on the closed line of the mannequin whose middle is nearest to its own.
    limbs = (*ARM_LEVELS, *LEG_LINES.values())
    names = ["neck", *RING_LEVELS, *(f"{level} {side}" for level in limbs for side in ("left", "right"))]
    middles = np.array([mannequin.line(name)[:-1].mean(axis=0) for name in names])
    found = dict[str, tuple[IntArray, float]]()
    for ring, length in sorted(rings, key=lambda ring: -ring[1]):
        away = np.linalg.norm(middles - mannequin.vertices[ring].mean(axis=0), axis=1)
        found[find_unused_name(names[int(away.argmin())], found)] = ring, length
    return found


def _line_of(name: str) -> str:
    """Return the line of a ring's name: a second ring at "hip" is "hip 2"."""
    head, _, tail = name.rpartition(" ")
    return head if tail.isdigit() else name
