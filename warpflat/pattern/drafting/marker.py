"""The marker: all copies of all pieces nested on cloth of a given width, by the `sparrow` solver (spyrrow)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray, InputError, nearest, thread_count
from warpflat.pattern.drafting.drafted import DraftedGarment, DraftedPiece
from warpflat.pattern.drafting.label import Label, printed_size
from warpflat.pattern.drafting.matched_lay import Stripes
from warpflat.pattern.drafting.names import size_words
from warpflat.pattern.drafting.placement import fit_label
from warpflat.pattern.drafting.polygons import mapped, mirror_image, outer_ring, rotation
from warpflat.pattern.drafting.tile_nesting import CELL, nest_on_strip
from warpflat.pattern.drafting.words import printed_in, translate

if TYPE_CHECKING:
    from shapely import Polygon

__all__ = ["WIDTHS", "Cloth", "Copy", "Marker", "cloth_needed", "make_marker"]


#: Copies with many corners are nested as polygons that are larger by up to this [m] and have at most half as many.
SIMPLER = 1e-3
#: Height of capitals [m] of a copy's name and of its other lines, the least share of these, and their distances [m]
#: from lines, the second where there is little room.
NAME, MORE, LEAST, CLEARANCES = 0.012, 0.009, 0.1, (0.004, 0.001)
#: Two placed copies may touch, but not share more than this area [m2].
OVERLAP = 1e-8


@dataclass(frozen=True, kw_only=True)
class Cloth:
    """Width of the cloth, and how pieces may lie on it.

    Attributes:
        width: usable width between the selvedges [m].
        one_way: all pieces point the same way along the warp (nap, pile, one-way prints); otherwise they may turn
            round.
        reversible: both faces are equal, so that pairs may be cut either way up; otherwise one of each pair is
            mirrored.
        gap: between pieces, and to the selvedges and ends [m].
        folded: lengthwise; halves lie against its fold, pairs are cut at once. All pieces point the same way.
        stripes: that meet at seams. All pieces point the same way.
    """

    width: float
    one_way: bool = False
    reversible: bool = False
    gap: float = 0.002
    folded: bool = False
    stripes: Stripes = field(default_factory=Stripes)

    @property
    def by_rule(self) -> bool:
        """Whether pieces have to lie where the fold or the stripes want them."""
        return self.folded or bool(self.stripes.seams and self.stripes.repeat.any())

    @property
    def lay_width(self) -> float:
        """Width on which pieces are laid [m]: half of that of folded cloth."""
        return 0.5 * self.width if self.folded else self.width

    def __post_init__(self) -> None:
        if not 0.1 <= self.width <= 10:
            raise InputError(f"cloth width {self.width!r} m; it must be between 0.1 and 10 m")
        if not 0 <= self.gap < self.width / 10:
            raise InputError(f"gap {self.gap!r} m between pieces; it must be 0 or more, and small against the cloth")


@dataclass(frozen=True, kw_only=True, eq=False)
class Copy:
    """One copy on the cloth, all lines placed [m], warp along x.

    A half on the fold is whole here: cut line, cutouts and notches are those of both halves.

    Attributes:
        piece: what is copied.
        mirrored: cut turned over.
        matrix: 2 by 3, from the drafted piece to the cloth.
        cut_line, cutouts, notches, grain: #P by 2 [m].
        fold_lines: lines at which the two halves meet, #P by 2 [m].
        name: its label, if there is room for one.
    """

    piece: DraftedPiece
    mirrored: bool
    matrix: FloatArray
    cut_line: FloatArray
    cutouts: tuple[FloatArray, ...]
    fold_lines: tuple[FloatArray, ...]
    grain: FloatArray
    name: Label | None
    notches: tuple[FloatArray, ...]

    @property
    def turned(self) -> bool:
        """Whether it points the other way along the warp."""
        return bool(self.matrix[0, 1] < 0.0)

    @property
    def label(self) -> str:
        side = " (mirrored)" if self.mirrored else ""
        return f"{self.piece.name} {self.piece.size}".strip() + side


@dataclass(frozen=True, kw_only=True, eq=False)
class Marker:
    """A lay plan.

    Attributes:
        name: the garment's.
        fabric: which pieces it holds; "" for all.
        width, length: of the cloth, which lies from 0 to `length` along x and from 0 to `width` across [m].
        placements: the copies.
        folded: the cloth lies double, its fold along y = 0; the width is that of the half.
    """

    name: str
    fabric: str
    width: float
    length: float
    placements: tuple[Copy, ...]
    folded: bool = False

    @property
    def utilisation(self) -> float:
        """Area of the pieces over the area of the cloth; cutouts count as waste."""
        import shapely

        used = sum(
            float(shapely.Polygon(copy.cut_line).area) - sum(float(shapely.Polygon(c).area) for c in copy.cutouts)
            for copy in self.placements
        )
        return used / (self.width * self.length)


def make_marker(
    garment: DraftedGarment,
    cloth: Cloth,
    *,
    fabric: str = "",
    sizes: Mapping[str, int] | None = None,
    seconds: int = 5,
) -> Marker:
    """Nest the pieces of a garment on one ply of cloth, face up, as short as found in the given time.

    Pieces lie with their grain along the cloth; a half on the fold is cut unfolded; of a pair one copy is mirrored.

    Args:
        garment: drafted.
        cloth: width, and what the fabric allows.
        fabric: only pieces of that fabric; "" where all have the same.
        sizes: how many garments of each size; None makes one of each drafted size.
        seconds: time for the solver, in which it reaches more on a faster machine.

    Raises:
        InputError: an unknown size or fabric, or a piece wider than the cloth.
    """
    import shapely

    wanted = dict.fromkeys(garment.pieces, 1) if sizes is None else sizes
    if cloth.by_rule:
        placements = _laid_by_rule(garment, cloth, fabric, wanted)
    else:
        copies = _copies(garment, fabric, wanted)
        tries = [copies]
        if cloth.reversible and any(mirrored for _, mirrored in copies):
            tries.append([(piece, False) for piece, _ in copies])
        share = max(1, seconds // len(tries))
        placements = min((_nest(garment.name, plan, cloth, share) for plan in tries), key=_length)
    # In the order in which the cutter meets them.
    placements = sorted(placements, key=lambda copy: tuple(copy.cut_line.min(axis=0)))
    with printed_in(garment.pattern.words):
        # Each gets its name in the room between its lines.
        for number, copy in enumerate(placements):
            piece = copy.piece
            rows = [(piece.piece.printed_name, NAME)]
            rows += [(printed_size(piece.size), MORE)] if piece.size else []
            rows += [(translate("mirrored"), MORE)] if copy.mirrored else []
            lines = [*copy.fold_lines, copy.grain, *copy.notches]
            for clearance in CLEARANCES:
                keep_off = [shapely.LineString(line).buffer(clearance) for line in lines]
                keep_off += [shapely.Polygon(line).buffer(clearance) for line in copy.cutouts]
                room = shapely.Polygon(copy.cut_line).buffer(-clearance).difference(shapely.union_all(keep_off))
                if (name := fit_label(room, rows, least=LEAST)) is not None:
                    break
            placements[number] = replace(copy, name=name)
    marker = Marker(
        name=garment.name,
        fabric=fabric,
        width=cloth.lay_width,
        length=_length(placements) + cloth.gap,
        placements=tuple(placements),
        folded=cloth.folded,
    )
    # Copies do not overlap and lie on the cloth, whatever the solver says.
    polygons = [shapely.Polygon(copy.cut_line) for copy in marker.placements]
    for a, b in shapely.STRtree(polygons).query(polygons, predicate="intersects").T:
        if a < b and polygons[a].intersection(polygons[b]).area > OVERLAP:
            raise RuntimeError(f"the nesting overlaps: {marker.placements[a].label}, {marker.placements[b].label}")
    for copy in marker.placements:
        low, high = copy.cut_line.min(axis=0), copy.cut_line.max(axis=0)
        if low.min() < -1e-6 or high[0] > marker.length + 1e-6 or high[1] > marker.width + 1e-6:
            raise RuntimeError(f"the nesting puts {copy.label} beyond the cloth")
    return marker


def _laid_by_rule(garment: DraftedGarment, cloth: Cloth, fabric: str, sizes: Mapping[str, int]) -> list[Copy]:
    """Lay the pieces on folded cloth, or so that stripes meet."""
    from warpflat.pattern.drafting.half_pieces import halved
    from warpflat.pattern.drafting.matched_lay import Laid, lay_by_rule

    copies, once = list[Laid](), dict[tuple[str, str], int]()
    for piece, mirrored in _copies(halved(garment) if cloth.folded else garment, fabric, sizes):
        on_fold = cloth.folded and piece.piece.on_fold
        key = piece.name, piece.size
        once[key] = once.get(key, 0) + 1
        if cloth.folded and not on_fold and once[key] % 2 == 0:
            continue  # the second layer
        linear = _onto_cloth(mirrored and not cloth.folded)
        if (
            on_fold
            and (piece.cut_line @ linear.T)[:, 1].min() < (piece.fold_edges[0].line @ linear.T)[:, 1].min() - 1e-6
        ):
            linear = _onto_cloth(True)
        outline = piece.cut_line if on_fold else unfold_piece(piece)
        copies.append(Laid(piece=piece, mirrored=mirrored, linear=linear, outline=outline, at_fold=on_fold))
    # Nothing is kept from the fold.
    margin = 0.5 * cloth.gap * np.array([1.0, 0.0 if cloth.folded else 1.0])
    width = cloth.lay_width - 0.5 * cloth.gap - float(margin[1])
    shifts = lay_by_rule(copies, width, cloth.gap, cloth.stripes, garment)
    return [
        _placed(each.piece, each.mirrored, np.column_stack([each.linear, shift + margin]), half=each.at_fold)
        for each, shift in zip(copies, shifts, strict=True)
    ]


def _length(placements: Sequence[Copy]) -> float:
    """Return the length [m] of cloth that copies take."""
    return max(float(copy.cut_line[:, 0].max()) for copy in placements)


def _nest(name: str, copies: list[tuple[DraftedPiece, bool]], cloth: Cloth, seconds: int) -> list[Copy]:
    """Nest the copies with sparrow."""
    import shapely
    import spyrrow

    items, matrices, usable = [], [], cloth.width - 2 * cloth.gap
    for index, (piece, mirrored) in enumerate(copies):
        matrix = _onto_cloth(mirrored)
        cut = unfold_piece(piece) @ matrix.T
        across = float(np.ptp(cut[:, 1]))
        if across + SIMPLER > usable:
            size = f" {size_words(piece.size)}" if piece.size else ""
            raise InputError(
                f"piece {piece.name!r}{size} is {across * 1000:.0f} mm wide, the cloth "
                f"{usable * 1000:.0f} mm between its margins; give wider cloth or divide the piece"
            )
        matrices.append(matrix)
        angles = [0.0] if cloth.one_way else [0.0, 180.0]
        # A polygon with few corners that contains the cut line. Half a millimetre all around costs cloth, so it must pay.
        exact = shapely.Polygon(cut)
        with np.errstate(invalid="ignore"):  # a flag of GEOS's tries; what comes out is checked
            simple = exact.buffer(SIMPLER / 2, join_style="mitre", mitre_limit=2).simplify(SIMPLER / 2)
        fewer = 2 * shapely.get_num_coordinates(simple) < shapely.get_num_coordinates(exact)
        simple = simple if fewer and simple.contains(exact) else exact
        corners = outer_ring(simple)
        items.append(spyrrow.Item(str(index), [(x * 1000, y * 1000) for x, y in corners.tolist()], 1, angles))
    instance = spyrrow.StripPackingInstance(name, usable * 1000, items)
    config = spyrrow.StripPackingConfig(
        total_computation_time=seconds,
        num_workers=thread_count(),
        seed=0,
        min_items_separation=cloth.gap * 1000 or None,
    )
    placements = []
    try:
        placed = list(instance.solve(config).placed_items)
    except BaseException as error:
        # The solver's panic is a bare exception in Python.
        if type(error).__name__ != "PanicException":
            raise
        raise InputError(f"the nesting solver gave up ({error}); wider cloth or a smaller gap may help") from None
    for item in placed:
        turned, shift = rotation(np.radians(item.rotation)) @ matrices[int(item.id)], np.array(item.translation) / 1000
        placements.append(_placed(*copies[int(item.id)], np.column_stack([turned, shift + cloth.gap])))
    return placements


def unfold_piece(piece: DraftedPiece) -> FloatArray:
    """Return the cut line of the whole piece (#P by 2 [m]): a half is joined to its mirror image along the fold."""
    import shapely

    whole = shapely.Polygon(piece.cut_line)
    for edge in piece.fold_edges:
        mirror = shapely.transform(whole, partial(mirror_image, line=edge.line))
        # Both halves end on the fold within rounding; a tiny overlap joins them.
        joined = shapely.union_all([half.buffer(2e-6, join_style="mitre") for half in (whole, mirror)])
        whole = max(shapely.get_parts(joined.buffer(-2e-6, join_style="mitre")), key=lambda part: part.area)
    return outer_ring(whole)


def _copies(garment: DraftedGarment, fabric: str, sizes: Mapping[str, int]) -> list[tuple[DraftedPiece, bool]]:
    """Return the copies to be cut, each with whether it is mirrored."""
    copies = []
    for size, count in sizes.items():
        if count < 1:
            raise InputError(f"{count} garments of size {size}; it must be 1 or more")
        for piece in garment.of_sizes([size]):
            quantity = piece.piece.cloths.get(fabric, 0) if fabric else piece.piece.quantity
            copies += [(piece, over) for over in piece.piece.turned_over(quantity) * count]
    if not copies:
        known = {cloth for piece in garment for cloth in piece.piece.cloths}
        raise InputError(f"no piece is of fabric {fabric!r}; {nearest(fabric, known)}")
    return copies


def _onto_cloth(mirrored: bool) -> FloatArray:
    """Return the matrix (2 by 2) that lays the grain, upwards in a drafted piece, along x."""
    return np.array([[0.0, 1.0], [1.0, 0.0]]) if mirrored else np.array([[0.0, 1.0], [-1.0, 0.0]])


def _placed(piece: DraftedPiece, mirrored: bool, matrix: FloatArray, *, half: bool = False) -> Copy:
    """Return a copy under a 2 by 3 matrix; a half one where it lies against the fold of the cloth."""
    moved = partial(mapped, matrix=matrix)
    cutouts = [cutout.cut_line for cutout in piece.cutouts.values()]
    slits = [slit for notch in piece.notches for slit in notch.slits]
    for edge in () if half else piece.fold_edges:
        # A half on the fold is cut with its mirror image.
        cutouts, slits = ([*lines, *(mirror_image(line, edge.line) for line in lines)] for lines in (cutouts, slits))
    return Copy(
        piece=piece,
        mirrored=mirrored,
        matrix=matrix,
        cut_line=moved(piece.cut_line if half else unfold_piece(piece)),
        cutouts=tuple(map(moved, cutouts)),
        fold_lines=tuple(moved(edge.line) for edge in piece.fold_edges),
        grain=moved(piece.grain),
        name=None,
        notches=tuple(map(moved, slits)),
    )


#: Widths [m] at which cloth is sold.
WIDTHS = (0.90, 1.15, 1.50)
#: Between pieces, and unused at either selvedge [m].
GAP, SELVEDGE = 0.006, 0.010


def cloth_needed(garment: DraftedGarment) -> dict[str, dict[str, tuple[float | None, ...]]]:
    """Return by size and fabric the length [m] of cloth for one garment at each of `WIDTHS`; None where a piece is too wide.

    Whole pieces are laid on one layer with their grain along it, either way up. The lay is quick and repeatable; a
    marker (:func:`warpflat.pattern.drafting.marker.make_marker`) searches longer and finds shorter ones. A size whose pieces are no
    larger than those of another one is laid as that one where its own lay is longer.
    """
    import shapely

    shapes: dict[str, dict[str, list[shapely.Polygon]]] = {}
    for size, pieces in garment.pieces.items():
        for piece in pieces:
            outline = unfold_piece(piece)
            ways = shapely.Polygon(outline), shapely.Polygon(outline * [-1.0, 1.0])
            for cloth, quantity in piece.piece.cloths.items():
                row = shapes.setdefault(cloth, {}).setdefault(size, [])
                row.extend(ways[over] for over in piece.piece.turned_over(quantity))
    needed: dict[str, dict[str, tuple[float | None, ...]]] = {size: {} for size in garment.pieces}
    for cloth, by_size in shapes.items():
        own = {
            size: [nest_on_strip(row, width=width - 2 * SELVEDGE, gap=GAP) for width in WIDTHS]
            for size, row in by_size.items()
        }
        for size, row in by_size.items():
            holders = [own[other] for other, others in by_size.items() if _are_within(row, others)]
            columns = ([length for length in column if length is not None] for column in zip(*holders, strict=True))
            needed[size][cloth] = tuple(min(column, default=None) for column in columns)
    return needed


def _are_within(shapes: Sequence[Polygon], others: Sequence[Polygon]) -> bool:
    """Return whether each shape is no longer, wider or larger than its counterpart, within a cell of the lay."""
    if len(shapes) != len(others):
        return False
    extents, larger = (
        np.array([[x1 - x0, y1 - y0] for x0, y0, x1, y1 in (shape.bounds for shape in row)]) for row in (shapes, others)
    )
    areas, larger_areas = (np.array([shape.area for shape in row]) for row in (shapes, others))
    return bool((extents <= larger + CELL).all() and (areas <= larger_areas).all())
