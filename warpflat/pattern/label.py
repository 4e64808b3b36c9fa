"""The text on a pattern: its letters, DejaVu Sans, the label of a piece and where there is room for it, and a default grain line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.text import size_words
from warpflat.pattern.measures import length_words
from warpflat.pattern.pieces import Piece
from warpflat.pattern.words import translate

if TYPE_CHECKING:
    from reportlab.pdfbase.ttfonts import TTFont
    from shapely import Geometry, Polygon

__all__ = ["BOLD", "CAPITALS", "FONT", "Words", "embedded_font", "text_width", "wrap_text"]


FONT, BOLD = "DejaVuSans", "DejaVuSans-Bold"
#: Height of capitals over the font's size.
CAPITALS = 0.729
#: Width over the font's size of letters that the font lacks: in other fonts they are no wider than their body.
UNKNOWN = 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Words:
    """One line of text.

    Attributes:
        text: what it says.
        at: its centre [m].
        height: of its capitals [m].
        angle: [rad] counter-clockwise.
        bold: in bold letters.
        tag: names a size on that size's own line: in the line's colour, on a white ground.
    """

    text: str
    at: FloatArray
    height: float
    angle: float = 0.0
    bold: bool = False
    tag: bool = False


@cache
def embedded_font(name: str) -> TTFont:
    """Return FONT or BOLD for PDF files."""
    from reportlab.pdfbase.ttfonts import TTFont

    # The fonts have most of the world's letters and come with matplotlib; importing that takes longer than writing a pattern.
    found = find_spec("matplotlib")
    assert found is not None
    assert found.origin is not None
    return TTFont(name, str(Path(found.origin).parent / "mpl-data" / "fonts" / "ttf" / f"{name}.ttf"))


def text_width(text: str, height: float, *, bold: bool = False) -> float:
    """Return the width [m] of one line whose capitals are `height` [m] high."""
    widths = _widths(BOLD if bold else FONT)
    return sum(widths.get(ord(letter), UNKNOWN) for letter in text) * height / CAPITALS


@cache
def _widths(name: str) -> dict[int, float]:
    """Return the width of each letter over the font's size, by code point."""
    return {code: width / 1000 for code, width in embedded_font(name).face.charWidths.items()}


def wrap_text(text: str, height: float, width: float, *, bold: bool = False) -> str:
    """Turn spaces of a text into line breaks where a line would be wider than `width` [m]; words stay whole."""
    rows: list[str] = []
    for word in text.split():
        longer = f"{rows[-1]} {word}" if rows else word
        if rows and text_width(longer, height, bold=bold) <= width:
            rows[-1] = longer
        else:
            rows.append(word)
    return "\n".join(rows)


Item = TypeVar("Item")

__all__ = [
    "LEADING",
    "Label",
    "cutting_words",
    "default_grain",
    "fit_label",
    "label_lines",
    "place_label",
    "printed_size",
]


#: Height of capitals [m]: the piece's name, the other lines; and the distance of lines as a multiple of it.
TITLE, TEXT, LEADING = 0.007, 0.0045, 1.55
#: Distances [m] of labels from the sewing line and holes, from other lines, and from a fold, whose bracket and arrows
#: are 16 mm wide; the second row holds where there is little room.
CLEARANCES = ((0.004, 0.006, 0.022), (0.0015, 0.0025, 0.0165))
#: Smallest share of its full size at which a label stands on its piece, not beside it; below the second share it may
#: come nearer to lines.
LEAST, ENOUGH = 0.3, 0.6
#: A label beside its piece: its size, its greatest width [m], its distance from the piece [m], and how far [m] its
#: leader reaches into the cloth.
BESIDE_SIZE, BESIDE_WIDTH, BESIDE_GAP, LEADER = 0.6, 0.075, 0.010, 0.005
#: Room is sought by ellipses of these ratios of height to width: labels are wide, wrapped ones less so.
ELLIPSES = (0.4, 0.15, 1.0)
#: Factor by which a label must get larger to be turned, to have one more line break, to have a name as small as the
#: rest.
TURNED, BROKEN, SMALL_TITLE = 1.25, 1.06, 1.15
#: Lines may be broken at these shares of the widest one.
BREAKS = (0.75, 0.55, 0.4, 0.28)


@dataclass(frozen=True, kw_only=True, eq=False)
class Label:
    """Lines of text, centred.

    Attributes:
        at: the centre [m].
        lines: (text, height of capitals [m]) from top to bottom, the first in bold; a line break parts the rows of a
            line.
        angle: [rad] counter-clockwise.
        leader: 2 by 2 [m], from a label beside its piece to the cloth; None where the label stands on the piece.
    """

    at: FloatArray
    lines: tuple[tuple[str, float], ...]
    angle: float = 0.0
    leader: FloatArray | None = None

    @property
    def rows(self) -> list[tuple[str, float, bool]]:
        """(text, height of capitals [m], whether it is bold) from top to bottom."""
        return [(row, height, k == 0) for k, (text, height) in enumerate(self.lines) for row in text.split("\n")]

    @property
    def height(self) -> float:
        """Height of the whole block [m], at right angles to its lines."""
        return sum(height * LEADING for _, height, _ in self.rows)

    @property
    def width(self) -> float:
        """Width of the widest row [m]."""
        return max(text_width(text, height, bold=bold) for text, height, bold in self.rows)

    @property
    def box(self) -> FloatArray:
        """Corners of the block, 4 by 2 [m]."""
        half = np.array([self.width, self.height]) / 2
        return self.at + half * [[-1, -1], [1, -1], [1, 1], [-1, 1]] @ _rotation(self.angle).T

    def words(self) -> list[Words]:
        """Return each row at its place."""
        words, y = [], self.height / 2
        for text, height, bold in self.rows:
            y -= height * LEADING
            at = self.at + _rotation(self.angle) @ [0.0, y + height * LEADING / 2]
            words.append(Words(text=text, at=at, height=height, angle=self.angle, bold=bold))
        return words

    def scaled(self, factor: float) -> Label:
        """Return the label in another size, about its centre."""
        return replace(self, lines=tuple((text, height * factor) for text, height in self.lines))


def label_lines(piece: Piece, garment: str) -> tuple[str, ...]:
    """Return what a label says: name, size, how to cut the piece, cloth, included allowances, garment."""
    lines = [piece.printed_name.upper()]
    if piece.size:
        words = printed_size(piece.size)
        lines.append(words[0].upper() + words[1:])
    lines.append(cutting_words(piece) + (f" - {piece.fabric}" if piece.fabric else ""))
    lines += [
        f"{cutting_words(replace(piece, quantity=count, also={}))} - {cloth}" for cloth, count in piece.also.items()
    ]
    # The legs of a dart that is cut away are sewn as a seam.
    allowances = []
    for kind in ("seam", "hem"):
        alike = [e for e in piece.edges if e.kind == kind or (kind == "seam" and e.kind == "dart" and e.width > 0)]
        values = [length_words(width, piece.units) for width in sorted({round(e.width, 4) for e in alike})]
        if values:
            # The unit once: "6/10 mm".
            numbers = [value.removesuffix(f" {piece.units}") for value in values]
            widths = f"{'/'.join(numbers) if piece.units != 'in' else ', '.join(numbers)} {piece.units}"
            allowances.append(translate(f"{kind} {{widths}}", widths=widths))
    if allowances:
        lines.append(translate("Includes {allowances}", allowances=", ".join(allowances)))
    title = garment.replace("_", " ")
    if title.upper() != lines[0]:
        lines.append(title)
    return tuple(lines)


def cutting_words(piece: Piece) -> str:
    """Return how often a piece is cut, and how."""
    if piece.on_fold:
        return translate("Cut {count} on fold", count=piece.quantity)
    if piece.quantity % 2 == 0 and piece.paired:
        return translate("Cut {count}, {mirrored} mirrored", count=piece.quantity, mirrored=piece.quantity // 2)
    return translate("Cut {count}", count=piece.quantity)


def printed_size(size: str) -> str:
    """Return the words for a size as they are printed."""
    return translate("size {size}", size=size) if size_words(size) != size else translate(size)


def place_label(
    piece: Piece,
    garment: str,
    lines: tuple[FloatArray, FloatArray],
    holes: Sequence[FloatArray],
    obstacles: Sequence[FloatArray],
    folds: Sequence[FloatArray],
) -> Label:
    """Place the label on the widest free place of a piece, smaller if need be, or beside the piece.

    Args:
        piece: whose label it is.
        garment: its name.
        lines: #P by 2 [m], the sewing line and the cutting line.
        holes: #P by 2 [m], the sewing lines of holes and the borders of fish-eye darts, which the label avoids.
        obstacles: #P by 2 [m], lines that it does not cross.
        folds: #P by 2 [m], the edges on the fold, beside which a bracket stands.
    """
    import shapely

    sew, cut = (shapely.Polygon(line) for line in lines)
    away = [shapely.Polygon(hole).buffer(0) for hole in holes]
    texts = tuple((text, TITLE if k == 0 else TEXT) for k, text in enumerate(label_lines(piece, garment)))
    found: list[Label] = []
    for border, line, fold in CLEARANCES:
        keep_off = [hole.buffer(border) for hole in away]
        keep_off += [shapely.LineString(obstacle).buffer(line) for obstacle in obstacles]
        keep_off += [shapely.LineString(edge).buffer(fold) for edge in folds]
        label = fit_label(sew.buffer(-border).difference(shapely.union_all(keep_off)), texts)
        found += [] if label is None else [label]
        if label is not None and _relative_size(label) >= ENOUGH:
            break
    if found:
        return max(found, key=_relative_size)
    # To the right of the cloth, with a leader to it at half its height.
    cloth = cut.buffer(0).difference(shapely.union_all(away))
    left, bottom, right, top = cloth.bounds
    rows = tuple(
        (wrap_text(text, height * BESIDE_SIZE, BESIDE_WIDTH, bold=k == 0), height * BESIDE_SIZE)
        for k, (text, height) in enumerate(texts)
    )
    beside = Label(at=np.zeros(2), lines=rows)
    beside = beside.scaled(min(1.0, BESIDE_WIDTH / beside.width))
    middle = (bottom + top) / 2
    across = shapely.LineString([(left - 1, middle), (right + 1, middle)]).intersection(cloth)
    near = max(shapely.get_parts(across), key=lambda part: part.bounds[2] if part.length > 0 else -np.inf)
    target = near.bounds[2] - min(LEADER, near.length / 2)
    start = right + BESIDE_GAP
    return replace(
        beside,
        at=np.array([start + 0.001 + beside.width / 2, middle]),
        leader=np.array([[start, middle], [target, middle]]),
    )


def _relative_size(label: Label) -> float:
    """Return the size of a label's smallest line, as a share of its full size."""
    return min(height for _, height in label.lines) / TEXT


def fit_label(area: Geometry, lines: Sequence[tuple[str, float]], *, least: float = LEAST) -> Label | None:
    """Fit lines into an area [m] as large as they get, turned or wrapped if that helps; None if too small.

    Args:
        area: where there is room [m].
        lines: (text, height of capitals [m]); they get no larger than that.
        least: smallest share of that height.
    """
    import shapely

    parts = sorted((p for p in shapely.get_parts(area) if p.geom_type == "Polygon"), key=lambda p: -p.area)[:6]
    places = _Remembered(_roomy_places([part for part in parts if part.area > 1e-7]))
    best, reached = None, 0.0
    for label, penalty in _wrapped_labels(tuple(lines)):
        corners = []
        for row in label.words():
            half = np.array([text_width(row.text, row.height, bold=row.bold), row.height * LEADING]) / 2
            corners.append(row.at + half * [[-1, -1], [1, -1], [1, 1], [-1, 1]])
        shape = np.asarray(shapely.MultiPoint(np.concatenate(corners)).convex_hull.exterior.coords)
        for part, at, angle in places:
            if reached >= 1.0:  # most often at the first place
                break
            penalty_here = penalty * (TURNED if angle else 1.0)
            factor = _largest_factor(part, shape @ _rotation(angle).T, at, max(least, reached * penalty_here * 1.001))
            if factor > 0.0:
                best, reached = replace(label.scaled(factor), at=at, angle=angle), factor / penalty_here
        if reached >= 1.0:
            break
    return best


class _Remembered(Generic[Item]):
    """The items of an iterator, made when they are first asked for."""

    def __init__(self, items: Iterator[Item]) -> None:
        self._known, self._more = list[Item](), items

    def __iter__(self) -> Iterator[Item]:
        yield from self._known
        for item in self._more:
            self._known.append(item)
            yield item


def _wrapped_labels(lines: tuple[tuple[str, float], ...]) -> Iterator[tuple[Label, float]]:
    """Yield labels of full size around the origin, wrapped more and more, each with a penalty for reading it."""
    seen = set()
    smallest = min(height for _, height in lines)
    for heights, penalty in (([h for _, h in lines], 1.0), ([smallest for _ in lines], SMALL_TITLE)):
        plain = [(text, height) for (text, _), height in zip(lines, heights, strict=True)]
        widest = Label(at=np.zeros(2), lines=tuple(plain)).width
        for share in (1.0, *BREAKS):
            rows = tuple(
                # The size stays in one row: a nest replaces it by all sizes.
                (text if text.startswith("Size ") else wrap_text(text, h, share * widest * 1.001, bold=k == 0), h)
                for k, (text, h) in enumerate(plain)
            )
            if rows not in seen:
                seen.add(rows)
                breaks = sum(text.count("\n") for text, _ in rows)
                yield Label(at=np.zeros(2), lines=rows), penalty * BROKEN**breaks


def _roomy_places(parts: Sequence[Polygon]) -> Iterator[tuple[Polygon, FloatArray, float]]:
    """Yield the centres of widest ellipses, each with its polygon and the angle of lines along it.

    Those that lie flat come before those that stand, the roomiest first.
    """
    import shapely
    from shapely.affinity import scale

    for angle, axis in ((0.0, 0), (np.pi / 2, 1)):
        for ratio in ELLIPSES:
            squeeze = np.where(np.arange(2) == axis, ratio, 1.0)
            squeezed = [scale(part, *squeeze, origin=(0, 0)) for part in parts]
            circles = [shapely.maximum_inscribed_circle(part, 5e-4 * min(1.0, part.length)) for part in squeezed]
            for number in np.argsort([-circle.length for circle in circles], kind="stable"):
                yield parts[number], np.asarray(circles[number].coords[0]) / squeeze, angle


def _largest_factor(part: Polygon, shape: FloatArray, at: FloatArray, floor: float) -> float:
    """Return by what factor, at most 1, a convex shape (#P by 2 [m]) fits in around a place; 0 if below `floor`."""
    import shapely

    def fits(factor: float) -> bool:
        return bool(part.covers(shapely.Polygon(shape * factor + at)))

    if floor > 1.0 or not fits(floor):
        return 0.0
    if fits(1.0):
        return 1.0
    low, high = floor, 1.0
    while high - low > 0.01:
        middle = (low + high) / 2
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low


def _rotation(angle: float) -> FloatArray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine], [sine, cosine]])


def default_grain(sew_line: FloatArray, holes: Sequence[FloatArray] = ()) -> FloatArray:
    """Return a grain line (2 by 2 [m]), upwards through the widest place, over two thirds of the height there."""
    import shapely

    polygon = shapely.Polygon(sew_line)
    if holes:
        polygon = polygon.difference(shapely.union_all([shapely.Polygon(hole).buffer(0) for hole in holes]))
    centre = np.asarray(shapely.maximum_inscribed_circle(polygon, 1e-3).coords[0])
    low, high = polygon.bounds[1], polygon.bounds[3]
    ray = shapely.LineString([(centre[0], low - 1), (centre[0], high + 1)]).intersection(polygon)
    part = min(shapely.get_parts(ray), key=lambda p: p.distance(shapely.Point(centre)))
    y = np.sort(shapely.get_coordinates(part)[:, 1])
    bottom, top = float(y[0]), float(y[-1])
    return np.array([[centre[0], bottom + (top - bottom) / 6], [centre[0], top - (top - bottom) / 6]])
