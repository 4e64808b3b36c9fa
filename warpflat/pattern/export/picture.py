"""`picture.png`: a garment on its mannequin, then its patterns; other pieces on the body and in the plane, coloured by strain energy."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.patches import Polygon
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from warpflat.core import FloatArray, IntArray, report_activity
from warpflat.flat import Surface
from warpflat.pattern.export.colours import SMALLEST_SCALE, energy_colours, energy_scale
from warpflat.pattern.export.figure import DPI, GREY, MARGIN, PAGE_WIDTH, POINT, Pen, Pixels, new_figure, write_figure
from warpflat.pattern.export.geometry import polylines_of
from warpflat.pattern.export.letters import all_letters, is_drawn, titles
from warpflat.pattern.export.picture_drafted import DraftedOutline, DraftedRows, worn_words
from warpflat.pattern.export.picture_garment import Body, GarmentViews
from warpflat.pattern.export.picture_page import CAPTIONS_ALONE, STRIP, Cell, draw_cell, draw_scale_bar, lay_out
from warpflat.pattern.export.picture_views import make_facets, pattern_view, surface_view

__all__ = ["PicturePiece", "draw_figure", "write_picture"]

SCALE_BAR = 2.3  # [in], for the scale of lengths left of the colour bar, as all that follows
_BAR_HEIGHT = 0.17
_BAR_TIP = 0.03  # of its length, for what lies above the scale
_NOTE, _POWER, _PLAIN = 2.0, 0.7, 0.35  # room right of the bar: for what it leaves out, for a power of ten, for neither
_SHORTEST_BAR = 1.2
_WORDS_SIZE, _TICK_SIZE = 9.5, 8.5  # [pt]


@dataclass(frozen=True, kw_only=True, eq=False)
class PicturePiece:
    """One piece of the picture.

    Attributes:
        name: the piece's.
        surface: in space [m].
        faces: #F by 4, the surface's faces in the pattern's numbering.
        positions: #P by 2, the pattern [m].
        face_energy_density: #F [J/m2].
        lines: feature lines in the pattern's numbering; each a vertex-index array or a list of them.
        surface_lines: feature lines in the surface's numbering; the surface's own if not given.
        datum: the name of the line from which the piece was developed, which is the grain; None if it is not known.
        grain_angle: of the grain against the datum, degrees, anticlockwise.
        captions: key measures to print under the name, such as ``{"strain energy": "12.3 mJ", "fabric": "poplin"}``.
    """

    name: str
    surface: Surface
    faces: IntArray
    positions: FloatArray
    face_energy_density: FloatArray
    lines: Mapping[str, Any] = field(default_factory=dict)
    surface_lines: Mapping[str, Any] | None = None
    datum: str | None = None
    grain_angle: float = 0.0
    captions: Mapping[str, str] = field(default_factory=dict)


@all_letters()
def write_picture(
    path: str | os.PathLike[str],
    pieces: Sequence[PicturePiece],
    *,
    quantity: str = "strain energy density",
    scale: float | None = None,
    body: Body | None = None,
    drafted: Sequence[DraftedOutline] = (),
) -> None:
    """Draw every piece on the body and as pattern, at one scale of length and one of energy; atomically.

    Args:
        path: the file, ``*.png``.
        pieces: what is drawn.
        quantity: what the colours show, written beside the colour bar.
        body: on which all pieces are shown together first, from the front, the side and the back. If not given, each piece is
            shown in space beside its pattern.
        scale: upper end of the colours [J/m2]; if not given, 98 % of the area of all pieces lies below it.
        drafted: pieces without a surface, as collars and waistbands: grey on the body, and their outlines below the others.

    Raises:
        InputError: the file cannot be written.
        ValueError: there is no piece.
    """
    report_activity(f"drawing {Path(path).name}")
    write_figure(path, draw_figure(pieces, quantity=quantity, scale=scale, body=body, drafted=drafted))


@all_letters()
def draw_figure(
    pieces: Sequence[PicturePiece],
    *,
    quantity: str = "strain energy density",
    scale: float | None = None,
    body: Body | None = None,
    drafted: Sequence[DraftedOutline] = (),
) -> Any:
    """Return the Matplotlib figure that :func:`write_picture` saves; see there for the arguments.

    Raises:
        ValueError: there is no piece.
    """
    if not pieces:
        raise ValueError("a picture needs at least one piece")
    shown_names = titles([piece.name for piece in pieces], is_drawn)
    alone = body is None and len(pieces) == 1
    cells = [_prepared(piece, shown_names[piece.name], shows_body=body is None, alone=alone) for piece in pieces]
    density = np.concatenate([np.asarray(piece.face_energy_density, dtype=np.float64) for piece in pieces])
    areas = np.concatenate([cell.areas for cell in cells])
    scale = energy_scale(density, areas) if scale is None else scale
    figure = new_figure(PAGE_WIDTH, 4.0)
    pen = Pen(figure)
    # The first caption that is the same in all cells stands left of the colour bar, if there is room for it.
    shared = ""
    for key, value in cells[0].captions.items() if len(cells) > 1 else ():
        caption = f"{key} {value}"
        if all(cell.captions.get(key) == value for cell in cells) and pen.measure(caption, 7.5)[0] < SCALE_BAR - 0.1:
            for cell in cells:
                cell.captions = {other: text for other, text in cell.captions.items() if other != key}
            shared = caption
            break
    worn = None
    if body is not None:
        worn = GarmentViews(
            body,
            [piece.surface for piece in pieces],
            [cell.density for cell in cells],
            [surface for each in drafted for surface in each.worn],
            worn_words(drafted),
        )
    left = MARGIN + (CAPTIONS_ALONE if alone else SCALE_BAR)
    words = pen.measure(_bar_words(scale, density, quantity), _WORDS_SIZE)[0]
    narrowest = left + (
        words + (MARGIN if _is_flat(scale, density) else 0.15 + _SHORTEST_BAR + _right_of_bar(scale, density))
    )
    width, height, page_scale = lay_out(pen, cells, worn, narrowest=narrowest)
    rows = DraftedRows(pen, drafted, width - 2 * MARGIN, page_scale) if drafted else None
    height += STRIP + (0.0 if rows is None else rows.height)
    figure.set_size_inches(width, height)
    pen.open_page()
    if not alone:
        draw_scale_bar(pen, MARGIN, height - 0.27, page_scale)
        pen.write(MARGIN, height - 0.48, shared, 7.5, color=GREY)
    _draw_colour_bar(pen, scale, density, areas, quantity, left=left, top=height)
    top = height - STRIP
    if worn is not None:
        worn.draw(pen, MARGIN, top, scale)
    for cell in cells:
        draw_cell(pen, cell, top, scale, page_scale)
    if rows is not None:
        rows.draw(pen, MARGIN, rows.height)
    return figure


def _prepared(piece: PicturePiece, title: str, *, shows_body: bool, alone: bool) -> Cell:
    """Return the cell of a piece, with its two views."""
    surface, positions = piece.surface, np.asarray(piece.positions, dtype=np.float64)
    faces = np.asarray(piece.faces, dtype=np.int32)
    in_space = surface.lines if piece.surface_lines is None else piece.surface_lines
    in_plane = make_facets(faces)
    on_body = in_plane if np.array_equal(faces, surface.faces) else make_facets(surface.faces)
    cell = Cell(
        name=title,
        captions=piece.captions,
        density=np.asarray(piece.face_energy_density, dtype=np.float64),
        on_body=surface_view(surface, on_body, polylines_of(in_space)),
        pattern=pattern_view(positions, in_plane, polylines_of(piece.lines)),
        datum=piece.datum,
        grain_angle=piece.grain_angle,
        shows_body=shows_body,
        alone=alone,
    )
    cell.stack_if_wide()
    return cell


def _is_flat(scale: float, density: FloatArray) -> bool:
    return scale <= SMALLEST_SCALE and not (density > scale).any()


def _bar_words(scale: float, density: FloatArray, quantity: str) -> str:
    return f"{quantity}: none, the cloth lies flat without strain" if _is_flat(scale, density) else f"{quantity} [J/m²]"


def _right_of_bar(scale: float, density: FloatArray) -> float:
    return _NOTE if (density > scale).any() else _POWER if _ticks(scale, 1.0)[2] else _PLAIN


def _draw_colour_bar(
    pen: Pen, scale: float, density: FloatArray, areas: FloatArray, quantity: str, *, left: float, top: float
) -> None:
    """Draw the colour bar from `left` [in] to the right margin, and the share of the area above its end.

    The page must leave `_colour_bar_room`. A surface without strain needs no scale: words say so.

    Args:
        scale: upper end of the colours [J/m2].
        density, areas: #F [J/m2] and [m2] of all faces.
        quantity: what the colours show.
        left, top: of the strip [in].
    """
    above = density > scale
    words = _bar_words(scale, density, quantity)
    pen.write(left, top - 0.24, words, _WORDS_SIZE)
    if _is_flat(scale, density):
        return
    left += pen.measure(words, _WORDS_SIZE)[0] + 0.15
    right = pen.page_width - _right_of_bar(scale, density)
    upper = top - 0.24 + 0.5 * _BAR_HEIGHT
    lower = upper - _BAR_HEIGHT
    end = left + (right - left) / (1.0 + _BAR_TIP) if above.any() else right
    first, last = round(left * DPI), round(end * DPI)
    shades = energy_colours((np.arange(last - first) + 0.5) / (last - first), 1.0)
    strip = np.full((round(_BAR_HEIGHT * DPI), last - first, 4), 255, dtype=np.uint8)
    strip[..., :3] = np.round(255.0 * shades)
    pen.axes.add_artist(Pixels(strip, left=first, bottom=round(lower * DPI), zorder=1))
    outline = [(left, lower), (end, lower), (end, upper), (left, upper)]
    if above.any():
        tip = (right, 0.5 * (lower + upper))
        # It starts one pixel earlier, so that no white shows between.
        corners = [(end - 1.0 / DPI, lower), (end, lower), tip, (end, upper), (end - 1.0 / DPI, upper)]
        pen.axes.add_patch(Polygon(corners, facecolor=energy_colours([1.0], 1.0)[0], linewidth=0, zorder=1))
        outline.insert(2, tip)
    pen.axes.add_patch(Polygon(outline, fill=False, edgecolor="black", linewidth=0.6, zorder=6))
    places, numbers, power = _ticks(scale, end - left)
    for place, word in zip(left + (end - left) * places / scale, numbers, strict=True):
        pen.line(np.array([(place, lower), (place, lower - 3 * POINT)]), width=0.6, colour="black")
        pen.write(place, lower - 5 * POINT, word, _TICK_SIZE, color="black", ha="center", va="top")
    if power:
        pen.write(right + 0.16, lower - 5 * POINT, power, 8, color="black", va="top")
    total = float(areas.sum())
    if above.any() and total > 0.0:
        share = float(areas[above].sum()) / total
        percent = f"{100 * share:.1f} %" if share >= 0.001 else "under 0.1 %"
        text = f"clipped: {percent} of the area\nis above, up to {density.max():.3g} J/m²"
        pen.write(right + 0.12, 0.5 * (lower + upper), text, 7.5, color=GREY, linespacing=1.35)


def _ticks(scale: float, length: float) -> tuple[FloatArray, list[str], str]:
    """Return round values from 0 to `scale` for a bar of this length [in], their words, and their power of ten."""
    most = int(np.clip(length / (5.0 * _TICK_SIZE * POINT), 1, 9))
    values = np.asarray(MaxNLocator(nbins=most, steps=[1, 2, 2.5, 5, 10]).tick_values(0.0, scale))
    values = values[values <= scale * (1.0 + 1e-9)]
    formatter = ScalarFormatter()
    formatter.create_dummy_axis()
    formatter.axis.set_view_interval(0.0, scale)  # type: ignore[union-attr]
    formatter.set_powerlimits((-3, 4))
    words = formatter.format_ticks(values)  # type: ignore[arg-type]
    return values, words, formatter.get_offset()
