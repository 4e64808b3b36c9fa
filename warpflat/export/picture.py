"""`picture.png`: a garment on its mannequin, then its patterns; other pieces on the body and in the plane, coloured by strain energy."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from warpflat.core.activity import report_activity
from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.atomic_files import atomic_path
from warpflat.export.colours import energy_scale
from warpflat.export.geometry import polylines_of
from warpflat.export.letters import all_letters, is_drawn, titles
from warpflat.export.picture_garment import Body, GarmentViews
from warpflat.export.picture_page import CAPTIONS_ALONE, Cell, draw_cell, lay_out
from warpflat.export.picture_pen import DPI, GREY, MARGIN, PAGE_WIDTH, Pen
from warpflat.export.picture_png import save_png
from warpflat.export.picture_scale import STRIP, colour_bar_room, draw_colour_bar, draw_scale_bar
from warpflat.export.picture_views import make_facets, pattern_view, surface_view
from warpflat.surface.mesh import Surface

__all__ = ["PicturePiece", "draw_figure", "write_picture"]

SCALE_BAR = 2.3  # [in], for the scale of lengths left of the colour bar


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
) -> None:
    """Draw every piece on the body and as pattern, at one scale of length and one of energy; atomically.

    Args:
        path: the file, ``*.png``.
        pieces: what is drawn.
        quantity: what the colours show, written beside the colour bar.
        body: on which all pieces are shown together first, from the front, the side and the back. If not given, each piece is
            shown in space beside its pattern.
        scale: upper end of the colours [J/m2]; if not given, 98 % of the area of all pieces lies below it.

    Raises:
        InputError: the file cannot be written.
        ValueError: there is no piece.
    """
    report_activity(f"drawing {Path(path).name}")
    figure = draw_figure(pieces, quantity=quantity, scale=scale, body=body)
    with atomic_path(path) as temporary:
        save_png(temporary, figure, {"Software": "warpflat"})


@all_letters()
def draw_figure(
    pieces: Sequence[PicturePiece],
    *,
    quantity: str = "strain energy density",
    scale: float | None = None,
    body: Body | None = None,
) -> Any:
    """Return the Matplotlib figure that :func:`write_picture` saves; see there for the arguments.

    Raises:
        ValueError: there is no piece.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    if not pieces:
        raise ValueError("a picture needs at least one piece")
    shown_names = titles([piece.name for piece in pieces], is_drawn)
    alone = body is None and len(pieces) == 1
    cells = [_prepared(piece, shown_names[piece.name], shows_body=body is None, alone=alone) for piece in pieces]
    density = np.concatenate([np.asarray(piece.face_energy_density, dtype=np.float64) for piece in pieces])
    areas = np.concatenate([cell.areas for cell in cells])
    scale = energy_scale(density, areas) if scale is None else scale
    figure = Figure(figsize=(PAGE_WIDTH, 4.0), dpi=DPI, facecolor="white")
    pen = Pen(FigureCanvasAgg(figure).get_renderer())
    shared = _take_shared(pen, cells)
    worn = None
    if body is not None:
        worn = GarmentViews(body, [piece.surface for piece in pieces], [cell.density for cell in cells])
    left = MARGIN + (CAPTIONS_ALONE if alone else SCALE_BAR)
    narrowest = left + colour_bar_room(pen, scale, density, quantity)
    width, height, page_scale = lay_out(pen, cells, worn, narrowest=narrowest)
    height += STRIP
    figure.set_size_inches(width, height)
    pen.open_page(figure, width, height)
    if not alone:
        draw_scale_bar(pen, MARGIN, height - 0.27, page_scale)
        pen.write(MARGIN, height - 0.48, shared, 7.5, color=GREY)
    draw_colour_bar(pen, scale, density, areas, quantity, left=left, top=height)
    top = height - STRIP
    if worn is not None:
        worn.draw(pen, MARGIN, top, scale)
    for cell in cells:
        draw_cell(pen, cell, top, scale, page_scale)
    return figure


def _take_shared(pen: Pen, cells: Sequence[Cell]) -> str:
    """Take out of the captions of several cells the first one that is the same in all, if there is room for it left of the colour bar."""
    for key, value in cells[0].captions.items() if len(cells) > 1 else ():
        words = f"{key} {value}"
        if all(cell.captions.get(key) == value for cell in cells) and pen.measure(words, 7.5)[0] < SCALE_BAR - 0.1:
            for cell in cells:
                cell.captions = {other: text for other, text in cell.captions.items() if other != key}
            return words
    return ""


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
