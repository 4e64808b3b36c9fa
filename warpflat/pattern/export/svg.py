"""Patterns as SVG in true size: one unit is one millimetre, a group per piece and size, an id per edge."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from xml.etree import ElementTree as ET

import numpy as np

from warpflat.core import FloatArray, control_in, find_unused_name, format_count
from warpflat.pattern.drafting.drafted import DraftedGarment
from warpflat.pattern.drafting.drawing import Drawing, Stroke, draw_nest, grain_strokes
from warpflat.pattern.drafting.label import CAPITALS, LEADING, Words, text_width
from warpflat.pattern.drafting.layout import lay_out, nests
from warpflat.pattern.drafting.marker import Copy, Marker
from warpflat.pattern.drafting.names import size_words
from warpflat.pattern.drafting.polygons import mapped
from warpflat.pattern.drafting.seam_words import seam_words
from warpflat.pattern.drafting.words import printed_in
from warpflat.pattern.files.output import atomic_path

__all__ = ["OF_SIZE", "SIZE_COLOURS", "STYLE", "SvgPage", "write_marker_svg", "write_overlay_svg", "write_svg"]


#: Stroke colour, width [mm], dashes [mm] by role; shared with the PDF.
STYLE: dict[str, tuple[str, float, tuple[float, ...]]] = {
    "cut": ("#000000", 0.5, ()),
    "sew": ("#4a4a4a", 0.25, (3, 1.5)),
    "hem": ("#4a4a4a", 0.25, (6, 1.5, 1, 1.5)),
    "fold": ("#000000", 0.5, (8, 2, 1.5, 2)),
    "dart": ("#000000", 0.35, (1.8, 0.9)),
    "dart_fold": ("#7a7a7a", 0.2, (0.6, 1.4)),
    "internal": ("#9a9a9a", 0.18, ()),
    "left_out": ("#000000", 0.25, (2, 2)),
    "grain": ("#000000", 0.3, ()),
    "notch": ("#000000", 0.6, ()),
    "drill": ("#000000", 0.25, ()),
    "cutout": ("#000000", 0.5, ()),
    "leader": ("#7a7a7a", 0.2, ()),
}
#: Colours by which the sizes of a nest are told apart, legible on paper and without red-green vision; shared with the PDF.
SIZE_COLOURS = ("#000000", "#0060a8", "#b8460b", "#5b2a86", "#00766c", "#8a6d00", "#9b1b5a", "#555555")
#: Roles whose strokes have the colour of their size in a nest.
OF_SIZE = ("cut", "dart", "notch")
# Roles of the edges that may be sewn.
_SEWN = ("sew", "hem", "dart")


def write_svg(garment: DraftedGarment, path: str | os.PathLike[str], *, sizes: Sequence[str] | None = None) -> None:
    """Write the pieces side by side, in true size; all sizes of one lie upon each other, as a grading nest, without their sewing lines.

    Groups are called "PIECE-SIZE"; in them the cut line is "PIECE-SIZE.cut" and every edge "PIECE-SIZE.EDGE" (what
    an id may not hold becomes "_"; the plain names stand in `data-piece`, `data-size` and `data-edge`). What is sewn to an edge stands
    in its `data-seam`; that it stays raw, in its `data-kind`.

    Args:
        garment: drafted.
        path: of the file.
        sizes: those to draw; None draws all.
    """
    garment = garment.of_sizes(sizes)
    sheet = lay_out(nests(garment))
    page = SvgPage(float(sheet.size[0]), float(sheet.size[1]), garment.name)
    seams = seam_words(garment.pattern.seams)
    for placed in sheet.placed:
        with printed_in(garment.pattern.words):
            drawings = draw_nest(placed.pieces)
        for drawing in drawings:
            shift = np.column_stack([np.eye(2), placed.offset])
            hue = list(garment.pieces).index(drawing.piece.size) if len(placed.pieces) > 1 else None
            page.piece(drawing, shift, hue=hue, seams=seams)
    page.write(path)


def write_marker_svg(marker: Marker, path: str | os.PathLike[str]) -> None:
    """Write the lay plan in true size: the cloth lies along x, the pieces on it with their grain and names.

    Above it stands what it is of, its length and width, and how much of the cloth is used.
    """
    name = f"{marker.name.replace('_', ' ')} marker {marker.fabric}".strip()
    sizes = list(dict.fromkeys(copy.piece.size for copy in marker.placements if copy.piece.size))
    cut = format_count(len(marker.placements), "piece") + (f", {size_words(', '.join(sizes))}" if sizes else "")
    cloth = f"{marker.length:.3f} m of cloth {marker.width:.3f} m wide, {marker.utilisation:.1%} used"
    rows = [name, cut, cloth]
    widest = max(text_width(text, 1.0, bold=row == 0) for row, text in enumerate(rows))
    height = min(0.014, 0.98 * marker.length / widest)
    band = (len(rows) + 0.5) * LEADING * height
    page = SvgPage(marker.length, marker.width + band, f"{name}: {cut}, {cloth}")
    for row, text in enumerate(rows):
        at = np.array([marker.length / 2, marker.width + band - (row + 0.75) * LEADING * height])
        page.words(page.root, Words(text=text, at=at, height=height, bold=row == 0))
    border = np.array([[0, 0], [marker.length, 0], [marker.length, marker.width], [0, marker.width]])
    page.stroke(page.root, Stroke(role="drill", name="cloth", points=border, closed=True), "cloth")
    for index, copy in enumerate(marker.placements):
        page.marker_copy(copy, index)
    page.write(path)


def write_overlay_svg(
    path: str | os.PathLike[str],
    outlines: Mapping[str, Mapping[str, Sequence[FloatArray]]],
    styles: Mapping[str, tuple[str, Sequence[float]]],
) -> None:
    """Write pieces in several versions upon each other, in true size, side by side, with what each line stands for above.

    A group is called as its piece, and the lines in it "PIECE.VERSION".

    Args:
        path: of the file.
        outlines: of each piece in each version, #P by 2 [m], the last point as the first.
        styles: of each version the colour and the dashes [mm].
    """
    margin, row = 0.015, 0.006
    corners = {
        piece: np.concatenate([loop for loops in versions.values() for loop in loops])
        for piece, versions in outlines.items()
    }
    extents = [np.ptp(points, axis=0) for points in corners.values()]
    top = 2 * margin + row * len(styles)
    page = SvgPage(
        margin + sum(float(extent[0]) + margin for extent in extents),
        top + max(float(extent[1]) for extent in extents) + margin,
        ", ".join(styles),
    )
    high = 1e-3 * page.height

    def draw(parent: ET.Element, version: str, points: FloatArray, width: float, *, closed: bool) -> None:
        colour, dashes = styles[version]
        page.stroke(parent, Stroke(role="cut", name="", points=points, closed=closed), "")
        dashed = f"; stroke-dasharray: {' '.join(f'{dash:g}' for dash in dashes)}" if dashes else ""
        parent[-1].set("style", f"stroke: {colour}; stroke-width: {width:g}{dashed}")

    left = margin
    for (piece, versions), extent in zip(outlines.items(), extents, strict=True):
        shift = [left - corners[piece][:, 0].min(), high - top - corners[piece][:, 1].max()]
        group = ET.SubElement(page.root, "g", {"id": page.unique_id(piece)})
        for version, loops in versions.items():
            for loop in loops:
                draw(group, version, loop[:-1] + shift, 0.4, closed=True)
                group[-1].set("id", page.unique_id(f"{piece}.{version}"))
        left += float(extent[0]) + margin
    for number, version in enumerate(styles):
        y, height = high - margin - row * number, 0.0045 * CAPITALS
        draw(page.root, version, np.array([[margin, y], [margin + 0.02, y]]), 0.6, closed=False)
        at = np.array([margin + 0.023 + 0.5 * text_width(version, height), y])
        page.words(page.root, Words(text=version, at=at, height=height))
    page.write(path)


class SvgPage:
    """One SVG document whose user unit is the millimetre; y runs downwards in it, so heights are turned over."""

    def __init__(self, width: float, height: float, title: str) -> None:
        """Open a page of `width` by `height` metres."""
        self.height = height * 1000
        w, h = _number(width * 1000), _number(self.height)
        self.root = ET.Element(
            "svg",
            {
                "xmlns": "http://www.w3.org/2000/svg",
                "width": f"{w}mm",
                "height": f"{h}mm",
                "viewBox": f"0 0 {w} {h}",
                "version": "1.1",
            },
        )
        ET.SubElement(self.root, "title").text = title
        style = [
            f".{role} {{ fill: none; stroke: {colour}; stroke-width: {width}; stroke-linejoin: round; "
            + (f"stroke-dasharray: {' '.join(map(str, dashes))}; " if dashes else "")
            + "}"
            for role, (colour, width, dashes) in STYLE.items()
        ]
        style.append("text { font-family: 'DejaVu Sans', Arial, Helvetica, sans-serif; text-anchor: middle; }")
        ET.SubElement(self.root, "style").text = "\n".join(style)
        self._ids: set[str] = set()

    def piece(
        self,
        drawing: Drawing,
        matrix: FloatArray,
        *,
        hue: int | None = None,
        seams: Mapping[tuple[str, str], Sequence[str]] | None = None,
    ) -> None:
        """Add a group for one piece and size, moved by a 2 by 3 matrix [m]; `seams` are the words at its edges."""
        piece = drawing.piece
        key = self.unique_id(f"{piece.name}-{piece.size}" if piece.size else piece.name)
        about = {
            "data-piece": piece.name,
            "data-size": piece.size,
            "data-quantity": str(piece.piece.cloths[piece.piece.fabric]),
        }
        group = ET.SubElement(self.root, "g", {"id": key, **about})
        colour = None if hue is None else SIZE_COLOURS[hue % len(SIZE_COLOURS)]
        raw = {edge.name for edge in piece.edges if edge.kind == "cut"}
        for stroke in drawing.strokes:
            self.stroke(group, stroke, key, matrix, colour)
            if stroke.role in _SEWN and stroke.name in raw:
                group[-1].set("data-kind", "cut")
            if stroke.role in _SEWN and (sewn := (seams or {}).get((piece.name, stroke.name))):
                group[-1].set("data-seam", "\n".join(sewn))
        for words in drawing.words:
            self.words(group, words, matrix, colour if words.tag else None)

    def stroke(
        self, parent: ET.Element, stroke: Stroke, key: str, matrix: FloatArray | None = None, colour: str | None = None
    ) -> None:
        """Add one line to a group; `key` begins its id."""
        matrix = np.eye(2, 3) if matrix is None else matrix
        attributes = {"class": stroke.role}
        if stroke.name:
            attributes["id"] = self.unique_id(f"{key}.{stroke.name}")
            attributes["data-edge"] = stroke.name
        if colour is not None and stroke.role in OF_SIZE:
            attributes["style"] = f"stroke: {colour}"
        if stroke.hidden:
            attributes["display"] = "none"
        if stroke.curve is not None:
            curve = stroke.curve.transformed(matrix)
            control = self._page(curve.bezier.reshape(-1, 2)).reshape(-1, 4, 2)
            text = ["M" + _pair(control[0, 0])]
            for segment, straight in zip(control, curve.straight, strict=True):
                if straight:
                    text.append("L" + _pair(segment[3]))
                else:
                    text.append("C" + " ".join(_pair(p) for p in segment[1:]))
            attributes["d"] = " ".join(text)
        else:
            points = self._page(mapped(stroke.points, matrix))
            attributes["d"] = "M" + " L".join(_pair(p) for p in points) + (" Z" if stroke.closed else "")
        ET.SubElement(parent, "path", attributes)

    def words(
        self, parent: ET.Element, words: Words, matrix: FloatArray | None = None, colour: str | None = None
    ) -> None:
        """Add one line of text, centred on its place."""
        matrix = np.eye(2, 3) if matrix is None else matrix
        x, y = self._page(mapped(words.at[None], matrix))[0]
        height = words.height * 1000
        turn = -np.degrees(words.angle + np.arctan2(matrix[1, 0], matrix[0, 0]))
        attributes = {
            "transform": f"translate({_number(x)} {_number(y)}) rotate({_number(turn)})",
            "y": _number(height / 2),
            "font-size": _number(height / CAPITALS),
        }
        if words.bold:
            attributes["font-weight"] = "bold"
        if colour:
            attributes["fill"] = colour
        if words.tag:
            # A white ground under the letters, as a text of its own: many programs do not know paint-order.
            ground = attributes | {"fill": "#ffffff", "stroke": "#ffffff", "stroke-width": "1.2"}
            ET.SubElement(parent, "text", ground).text = words.text
        ET.SubElement(parent, "text", attributes).text = words.text

    def marker_copy(self, copy: Copy, index: int) -> None:
        """Add one placed copy of a marker."""
        key = self.unique_id(f"copy{index}-{copy.label}")
        group = ET.SubElement(self.root, "g", {"id": key, "data-piece": copy.piece.name, "data-size": copy.piece.size})
        ET.SubElement(group, "title").text = copy.label
        self.stroke(group, Stroke(role="cut", name="cut", points=copy.cut_line, closed=True), key)
        group[-1].set("style", "fill: #f3efe6")
        for line in copy.cutouts:
            self.stroke(group, Stroke(role="cutout", name="", points=line, closed=True), key)
            group[-1].set("style", "fill: #ffffff")
        for line in copy.fold_lines:
            self.stroke(group, Stroke(role="internal", name="", points=line), key)
        for line in copy.notches:
            self.stroke(group, Stroke(role="notch", name="", points=line), key)
        for stroke in grain_strokes(copy.grain):
            self.stroke(group, stroke, key)
        for words in [] if copy.name is None else copy.name.words():
            self.words(group, words)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the document; the file appears whole or not at all."""
        for element in self.root.iter():
            element.text = None if element.text is None else _for_xml(element.text)
            element.attrib.update({key: _for_xml(value) for key, value in element.attrib.items()})
        ET.indent(self.root)
        with atomic_path(path) as temporary:
            ET.ElementTree(self.root).write(temporary, encoding="utf-8", xml_declaration=True)

    def _page(self, points: FloatArray) -> FloatArray:
        """Return points [m] in the millimetres of the page, y downwards."""
        return np.column_stack([points[:, 0] * 1000, self.height - points[:, 1] * 1000])

    def unique_id(self, name: str) -> str:
        """Return a valid id that no other element has."""
        clean = re.sub(r"[^\w.\-]", "_", name)
        clean = clean if re.match(r"[^\W\d]", clean) else f"_{clean}"
        unique = find_unused_name(clean, self._ids, joint="_")
        self._ids.add(unique)
        return unique


def _for_xml(text: str) -> str:
    """Replace the control characters that no XML can hold, not even escaped, by U+FFFD."""
    return (
        text
        if not control_in(text, "\t\n")
        else "".join("\ufffd" if control_in(each, "\t\n") else each for each in text)
    )


def _number(value: float) -> str:
    """Return millimetres to a tenth of a micrometre."""
    return f"{value:.4f}".rstrip("0").rstrip(".") if abs(value) > 5e-5 else "0"


def _pair(point: FloatArray) -> str:
    """Return a point as path data."""
    return f"{_number(point[0])},{_number(point[1])}"
