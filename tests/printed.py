"""What must hold of every printed pattern: nothing leaves its piece, and no word is cut at the edge of a sheet."""

from __future__ import annotations

from collections.abc import Iterator

import shapely

from warpflat.pattern.drafting.drafted import DraftedGarment, DraftedPiece
from warpflat.pattern.drafting.drawing import Drawing
from warpflat.pattern.drafting.half_pieces import halved
from warpflat.pattern.drafting.words import printed_in
from warpflat.pattern.export.pdf import draw_sheet
from warpflat.pattern.export.pdf_tiling import Tiling

# What is drawn on a border may lie beyond it by this much [m].
ON_BORDER = 2e-4


def drawn_faults(garment: DraftedGarment, paper: str = "A4") -> tuple[list[str], Tiling, list[tuple[Drawing, ...]]]:
    """Return what lies outside its piece, whole and as it is printed, and what no sheet shows whole; and the sheet, as `draw_sheet`."""
    with printed_in(garment.pattern.words):
        printed = halved(garment)
        found = [
            fault for kind in (garment, printed) for row in kind.pieces.values() for p in row for fault in _outside(p)
        ]
        tiling, drawings = draw_sheet(printed, paper)
        return [*dict.fromkeys(found), *_cut_at_sheets(tiling, drawings)], tiling, drawings


def _outside(piece: DraftedPiece) -> Iterator[str]:
    """Yield what leaves the cutting line of a piece."""
    cloth = shapely.Polygon(piece.cut_line).buffer(ON_BORDER)
    lines = {f"line {name}": line for name, line in piece.internal_lines.items()}
    lines |= {f"dart {name}": line for name, line in piece.fisheyes.items()}
    lines |= {f"hole {name}": hole.cut_line for name, hole in piece.cutouts.items()}
    lines |= {f"fold of {dart.dart.name}": dart.fold for dart in piece.darts if dart.fold is not None}
    lines |= {f"edge {edge.name}": piece.drawn_line(edge) for edge in piece.edges} | {"grain": piece.grain}
    for what, line in lines.items():
        if not cloth.covers(shapely.LineString(line)):
            away = 1e3 * float(shapely.hausdorff_distance(shapely.LineString(line).union(cloth), cloth))
            yield f"{piece.name}: {what} is {away:.1f} mm outside"
    for hole in piece.drill_holes:
        if not cloth.covers(shapely.Point(hole.at)):
            yield f"{piece.name}: point {hole.name} is outside"
    for notch in piece.notches:
        ends = [base + notch.depth * notch.direction for base in notch.base]
        on_cut = cloth.buffer(ON_BORDER).covers(shapely.MultiPoint(notch.base))
        if not (on_cut and cloth.buffer(notch.depth).covers(shapely.MultiPoint(ends))):
            yield f"{piece.name}: notch of {notch.seam} is outside"
    words = [shapely.Polygon(each.box()) for each in piece.label.words()]
    if piece.label.leader is None and not cloth.covers(shapely.union_all(words)):
        yield f"{piece.name}: label is outside"


def _cut_at_sheets(tiling: Tiling, drawings: list[tuple[Drawing, ...]]) -> Iterator[str]:
    """Yield the words that no sheet shows whole."""
    corners = [tiling.corner(*tile) for tile in tiling.tiles]
    windows = [shapely.box(*corner, *(corner + tiling.paper.step + tiling.paper.overlap)) for corner in corners]
    for placed, sizes in zip(tiling.sheet.placed, drawings, strict=True):
        for drawing in sizes:
            piece = drawing.piece
            for fold in piece.fold_edges if piece.label.leader is None else ():
                start, (x, y) = fold.line[0], fold.line[-1] - fold.line[0]
                if any(((words.box() - start) @ [-y, x]).min() < 0.0 for words in drawing.words):
                    yield f"{piece.name}: words stand beyond its fold"
            for words in drawing.words:
                box = shapely.Polygon(placed.on_sheet(words.box()))
                if not any(window.covers(box) for window in windows):
                    yield f"{drawing.piece.name}: {words.text!r} is cut at the edge of a sheet"
