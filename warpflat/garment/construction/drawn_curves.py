"""Borders drawn as by hand: side seams, necklines and hems without wobble, straight where a book has them straight.

Cloth at rest has a border that follows the body's every hollow. Each edge gets the shape of a faired line within a bound of it
(`drafting.fairing`), and the pieces are relaxed again with these shapes as constraints: where the edges lie, and how long they
are, the cloth decides, so that seams, darts and girths stay as they are. The energy that this costs is the curves' price.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core import FloatArray, IntArray, laid_upon, turning_angles
from warpflat.garment.construction.constraints import Constraint, DrawnLine, FixedLength, KeptGirth, Straight
from warpflat.pattern import HEMMED_LEVELS, count_inflections, fair_lines, fairest_line

if TYPE_CHECKING:
    from warpflat.garment.construction.sewn import ConstraintResult
    from warpflat.garment.mannequin.forms import FormResult
    from warpflat.garment.mannequin.layout import Layout

__all__ = ["CURVES_MM", "Curves", "DrawnCurve", "PlannedCurve", "measure_curves", "plan_curves"]

#: By default a border is drawn within this of where the cloth would have it [mm].
CURVES_MM = 3.0
#: Edges that books draw straight as a whole, if they are so within the bound; hems are, too.
STRAIGHT_EDGES = ("shoulder", "side", "centre front", "centre back")
#: Edges that stay as the cloth has them: armhole and cap have their shapes from the body, and a cap follows its short underarm seam.
SHAPED_EDGES = ("armhole", "underarm")
#: An edge is drawn in two where it turns by more than this [rad] at one vertex.
CORNER = np.radians(30.0)
#: Edges that turn gently: a hip curve has no corner.
GENTLE_EDGES = ("side", "outseam")
#: The hip curve runs into the straight side seam so far below the hip's level [m].
HIP_CURVE = 0.03
#: A wave by which it is measured how far an edge lies from straight [m].
RULER = 0.05


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedCurve:
    """A stretch of an edge and the line that it is to be.

    Attributes:
        line: the constraint.
        before: #P by 2, where it lay [m].
        book: where a book draws it straight: "all", "below hip" or "".
        straight: whether it is.
        away: how far from straight it is where a book draws it straight [m].
    """

    line: DrawnLine
    before: FloatArray
    book: str
    straight: bool
    away: float


@dataclass(frozen=True, kw_only=True)
class DrawnCurve:
    """A stretch of a border, drawn.

    Attributes:
        place: "piece.edge".
        seam: the seam that it is a side of, or a part of one; "" for a free edge.
        book: where a book draws it straight: "all", "below hip" or "".
        straight: whether it is straight there.
        away_mm: how far from straight that was; beyond the bound it stays curved.
        inflections_before, inflections_after: how often it changes from bending one way to bending the other.
        shift_mm: the largest distance between the two shapes, laid upon each other.
        price_j: half the work of the forces that hold it.
    """

    place: str
    seam: str
    book: str
    straight: bool
    away_mm: float
    inflections_before: int
    inflections_after: int
    shift_mm: float
    price_j: float


@dataclass(frozen=True, kw_only=True)
class Curves:
    """The drawn borders of a garment.

    Attributes:
        bound_mm: how far a line may lie from where the cloth would have it; in pieces that this would strain too much, less.
        price_j: energy that all cost together.
        lines: the drawn stretches.
    """

    bound_mm: float
    price_j: float
    lines: tuple[DrawnCurve, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the entry `curves` of `metrics.json`."""
        return {"bound_mm": self.bound_mm, "price_j": self.price_j, "lines": [vars(line) for line in self.lines]}


def plan_curves(
    layout: Layout,
    form: FormResult,
    positions: Mapping[str, FloatArray],
    bounds: Mapping[str, float],
    constraints: Sequence[Constraint] = (),
) -> list[PlannedCurve]:
    """Return the lines that the edges of a form's pieces are to be.

    Folds, legs of darts, armholes, caps and edges that a constraint is about stay.

    Args:
        layout: the body's grid.
        form: the pieces on it.
        positions: by piece, #V by 2, sewn [m].
        bounds: by piece, how far a line may lie from where the cloth would have it [m].
        constraints: of the sewing.
    """
    ruled = {(each.piece, each.line) for each in constraints if isinstance(each, Straight | FixedLength)}
    girths = [each for each in constraints if isinstance(each, KeptGirth)]
    sewn = form.seam_of_edges()
    plans = []
    for name, piece in form.pieces.items():
        bound = bounds[name]
        if bound == 0.0:
            continue
        # As pattern makers do, the line is drawn through the places where girths are measured.
        measured = [each.edges[name].ravel() for each in girths if name in each.edges]
        levels = np.concatenate([np.empty(0, dtype=np.int32), *measured])
        on_fold = set() if piece.fold is None else set(piece.edges[piece.fold].tolist())
        for edge, vertices in _open_edges(form, name, positions[name]):
            part = piece.whole(edge)
            if (name, edge) in ruled or len(vertices) < 4 or part.startswith(SHAPED_EDGES):
                continue
            points, grid = positions[name][vertices], piece.grid_vertices[vertices]
            mirrored = vertices[0] in on_fold, vertices[-1] in on_fold
            # Where a book draws the edge straight, and which of its vertices that are.
            heights = form.vertices[grid, 1]
            hip = float(form.vertices[layout.rings[layout.level_row["hip"]], 1].mean())
            free = (name, edge) not in sewn
            if free and part.split(" ")[0] in HEMMED_LEVELS:
                book, wanted = "all", np.ones(len(grid), dtype=bool)
            elif part.startswith("side") and heights.min() < hip - HIP_CURVE:
                book, wanted = "below hip", heights < hip - HIP_CURVE
            elif part.startswith(STRAIGHT_EDGES):
                book, wanted = "all", np.ones(len(grid), dtype=bool)
            else:
                book, wanted = "", np.zeros(len(grid), dtype=bool)
            away = next(fair_lines(points, [RULER], wanted, mirrored=mirrored)).shift if wanted.any() else 0.0
            straight = bool(wanted.any()) and away <= bound
            kept = wanted if straight else None
            one_way = book == "below hip" and bool(np.isin(grid, layout.rings[: layout.level_row["waist"] + 1]).all())
            met = np.isin(vertices, levels)
            gentle = part.startswith(GENTLE_EDGES)
            drawn = fairest_line(
                points, bound, straight=kept, met=met, mirrored=mirrored, one_way=one_way, gentle=gentle
            )
            if drawn is None:
                continue
            line = DrawnLine(piece=name, line=edge, vertices=vertices, shape=drawn.points)
            plans.append(PlannedCurve(line=line, before=points, book=book, straight=straight, away=away))
    return plans


def measure_curves(
    form: FormResult,
    plans: Sequence[PlannedCurve],
    positions: Mapping[str, FloatArray],
    results: Sequence[ConstraintResult],
) -> tuple[DrawnCurve, ...]:
    """Return what has become of the planned lines.

    Args:
        form: whose they are.
        plans: the lines.
        positions: by piece, #V by 2, with the lines drawn [m].
        results: of the lines, in their order.
    """
    import shapely

    sewn, measured = form.seam_of_edges(), []
    for plan, result in zip(plans, results, strict=True):
        place, after = (plan.line.piece, plan.line.line), positions[plan.line.piece][plan.line.vertices]
        # Both shapes are laid upon each other as near as they come.
        laid = shapely.LineString(laid_upon(plan.before, after))
        shift = float(shapely.distance(laid, shapely.points(plan.before[1:-1])).max())
        measured.append(
            DrawnCurve(
                place=".".join(place),
                seam=sewn.get(place, ""),
                book=plan.book,
                straight=plan.straight,
                away_mm=1e3 * plan.away,
                inflections_before=count_inflections(plan.before),
                inflections_after=count_inflections(after),
                shift_mm=1e3 * shift,
                price_j=result.cost,
            )
        )
    return tuple(measured)


def _open_edges(form: FormResult, name: str, flat: FloatArray) -> Iterator[tuple[str, IntArray]]:
    """Yield the edges of a piece that are neither a fold nor legs of darts, in parts where they have corners."""
    piece = form.pieces[name]
    for edge, vertices in piece.edges.items():
        if edge == piece.fold or edge in piece.leg_edges:
            continue
        angles = np.abs(turning_angles(flat[vertices]))
        sharp = angles > CORNER
        if np.allclose(angles, angles[::-1], atol=np.radians(2.0)):
            # On a piece with both sides of the body a corner of just this angle is one on both.
            sharp |= sharp[::-1]
        corners = np.flatnonzero(sharp) + 1
        for first, last in zip([0, *corners], [*corners, len(vertices) - 1], strict=True):
            yield edge, vertices[first : last + 1]
