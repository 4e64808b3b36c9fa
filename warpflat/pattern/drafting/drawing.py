"""A drafted piece as strokes and words: what it shows in every file format."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core import FloatArray, arc_lengths, points_at_lengths, polyline_length, resample, unit, without_side
from warpflat.pattern.drafting.curves import Curve, fit_curve
from warpflat.pattern.drafting.draft import nest_label
from warpflat.pattern.drafting.drafted import DraftedEdge, DraftedPiece
from warpflat.pattern.drafting.drafted_darts import fisheye_legs
from warpflat.pattern.drafting.label import TAILS, Label, Words, printed_size, text_width
from warpflat.pattern.drafting.measures import name_in_units
from warpflat.pattern.drafting.names import name_without_number
from warpflat.pattern.drafting.piece_parts import HEMMED_LEVELS, LEFT_OUT
from warpflat.pattern.drafting.placement import LabelRoom, Spot, as_read, spots_along
from warpflat.pattern.drafting.polygons import parallelogram
from warpflat.pattern.drafting.words import as_sentence, translate, translate_name

if TYPE_CHECKING:
    from shapely import Geometry

__all__ = ["Drawing", "OnPaper", "Stroke", "draw_nest", "draw_piece", "grain_strokes"]


#: Arrow heads: length and half width [m].
ARROW, BARB = 0.006, 0.002
#: The bracket that says "on fold" stands this far [m] inside the fold.
BRACKET = 0.014
#: Height [m] of capitals of an internal line's name, and the distance of its middle from the line.
NAME, NAME_GAP = 0.0024, 0.0028
#: On an edge of a nest that is no longer than this [m] the sizes stand once.
SHORT_EDGE = 0.15
#: Where along its line a name stands, in order of preference.
NAME_SHARES = (0.25, 0.2, 0.3, 0.15, 0.35, 0.4, 0.1, 0.6, 0.7, 0.8, 0.5)
#: Least distance [m] of words from all else; that at which no better place is sought, for names and for letters.
CLEAR, WELL_CLEAR, LETTER_CLEAR = 0.0004, 0.006, 0.001
#: Height [m] of a seam's letter beside a notch, and its distance from it.
LETTER, LETTER_GAP = 0.0026, 0.0012
#: Where along an edge without a notch its seam's letter stands, in order of preference.
LETTER_SHARES = (0.5, 0.4, 0.6, 0.3, 0.7)
#: What lies closer [m] to a fold lies on it.
ON_FOLD = 1e-5
#: No words stand so far beyond a fold [m].
BEYOND_FOLD = 0.02
#: Radius [m] of the circle around a drill hole.
DRILL = 0.002


@dataclass(frozen=True, kw_only=True, eq=False)
class Stroke:
    """One line of a drawing.

    Attributes:
        role: "cut", "sew", "hem", "fold", "dart", "dart_fold", "internal", "left_out", "grain", "notch", "drill", "cutout",
            "leader".
        name: what it is called in files, unique among the strokes of a piece; empty for decoration.
        points: #P by 2 [m].
        closed: the last point joins the first.
        curve: the line as Béziers, where there are such.
        hidden: not visible, but named and kept in files that can keep hidden lines.
    """

    role: str
    name: str
    points: FloatArray
    closed: bool = False
    curve: Curve | None = None
    hidden: bool = False

    @property
    def path(self) -> FloatArray:
        """Points (#P by 2 [m]) from its first to its last; the first of a closed line is both."""
        return np.concatenate([self.points, self.points[:1]]) if self.closed else self.points


@dataclass(frozen=True, kw_only=True, eq=False)
class OnPaper:
    """What printing changes: a fold is not cut, words cross no joint, seams have letters.

    Attributes:
        joints: lines (2 by 2 [m]) where sheets of paper meet or end.
        outside: what no sheet shows.
        letters: of seams, by their names.
        sewn: the seams that an edge is sewn in, by the names of its piece and its own.
    """

    joints: Sequence[FloatArray] = ()
    outside: Geometry | None = None
    letters: Mapping[str, str] = field(default_factory=dict)
    sewn: Mapping[tuple[str, str], Sequence[str]] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class Drawing:
    """All strokes and words of one piece in one size (or of the label of a nest)."""

    piece: DraftedPiece
    strokes: tuple[Stroke, ...]
    words: tuple[Words, ...]


def draw_piece(piece: DraftedPiece, paper: OnPaper | None = None) -> Drawing:
    """Draw one piece in one size; `paper` where it is printed."""
    written = _Annotations(piece, piece.label, piece.label.words(), paper)
    return Drawing(piece=piece, strokes=(*_strokes(piece, paper), *written.strokes), words=tuple(written.words))


def draw_nest(pieces: tuple[DraftedPiece, ...], paper: OnPaper | None = None) -> tuple[Drawing, ...]:
    """Draw one piece in all its sizes upon each other: cut lines, darts and notches of each; label and grain once.

    The sewing lines of several sizes would be a thicket: they are hidden.
    """
    if len(pieces) == 1:
        return (draw_piece(pieces[0], paper),)
    import shapely

    middle = pieces[len(pieces) // 2]
    longest = max(pieces, key=lambda piece: sum(edge.length for edge in piece.fold_edges))
    joints = shapely.MultiLineString([] if paper is None else list(paper.joints))

    def shift_across(name: str) -> float:
        first, last = (resample(piece.edge(name).line, 0.5) for piece in (pieces[0], pieces[-1]))
        start, end = pieces[0].edge(name).line[[0, -1]]
        x, y = unit(end - start)
        return abs(float((last - first) @ [y, -x]))

    # A size is easiest to read off its line along the edge of all sizes where they lie farthest apart.
    names = [each.name for each in pieces[0].edges if each.kind not in ("fold", "dart")]
    shared = [name for name in names if all(name in {each.name for each in piece.edges} for piece in pieces)]
    edge = max(shared, key=lambda name: shift_across(name) * pieces[0].edge(name).length ** 0.5, default="")
    drawings = list[Drawing]()
    for index, piece in enumerate(pieces):
        # Dashes of several sizes upon each other would be a full line.
        strokes = [
            replace(line, hidden=line.hidden or (line.role == "fold" and piece is not longest))
            for line in _strokes(piece, paper, nested=True)
        ]
        words: list[Words] = []
        if piece is middle:
            label = nest_label(pieces)
            others = [stroke for other in pieces if other is not piece for stroke in _detail_strokes(other)]
            slits = [shapely.LineString(stroke.points) for stroke in others if stroke.role == "notch"]
            # It names all sizes in place of its own, no wider than it is.
            one, every = printed_size(piece.size), printed_size(*(each.size for each in pieces))
            text, rows = as_sentence(every), label.words()
            for number, row in enumerate(rows):
                if row.text == as_sentence(one):
                    height = row.height * min(1.0, label.width / text_width(text, row.height))
                    rows[number] = replace(row, text=text, height=height)
            written = _Annotations(piece, label, rows, paper, borders=False, slits=slits)
            strokes, words = strokes + written.strokes, written.words
        if edge:
            lines = [shapely.LinearRing(other.cut_line) for other in pieces if other is not piece]
            details = [stroke for other in pieces for stroke in _detail_strokes(other)]
            lines += [shapely.LineString(stroke.points) for stroke in details if stroke.role == "notch"]
            boxes = [shapely.Polygon(row.box()) for drawing in drawings for row in drawing.words if row.tag]
            words += _size_tags(piece, edge, (index + 0.5) / len(pieces), shapely.union_all([*lines, *boxes]), joints)
        drawings.append(Drawing(piece=piece, strokes=tuple(strokes), words=tuple(words)))
    return tuple(drawings)


def _size_tags(piece: DraftedPiece, name: str, share: float, avoided: Geometry, joints: Geometry) -> list[Words]:
    """Return the size of a piece on its own cut line and along it, beside an edge, twice if that is long.

    Args:
        piece: in this size.
        name: of the edge.
        share: by which sizes are staggered.
        avoided: lines of other sizes, notches and words, where there is room beside them.
        joints: of sheets, at which words are cut.
    """
    import shapely

    ring, tags = shapely.LinearRing(piece.cut_line), list[Words]()
    line = piece.edge(name).line
    for start, along in ((0.08, 0.3), (0.62, 0.3)) if polyline_length(line) > SHORT_EDGE else ((0.05, 0.9),):
        tried = list[tuple[bool, bool, int, Words]]()
        # A little to either side, more and more.
        for away in (0.0, *(sign * step * 0.02 for step in range(1, 16) for sign in (1, -1))):
            middle = min(max(start + along * share + away, 0.0), 1.0)
            before, at, after = resample(line, [max(middle - 0.01, 0.0), middle, min(middle + 0.01, 1.0)])
            x, y = as_read(unit(after - before))
            on_cut = np.asarray(ring.interpolate(ring.project(shapely.Point(at))).coords[0])
            words = Words(text=piece.size, at=on_cut, height=0.004, angle=float(np.arctan2(y, x)), bold=True, tag=True)
            box = shapely.Polygon(words.box())
            tried.append((bool(box.intersects(joints)), bool(box.intersects(avoided)), len(tried), words))
        tags.append(min(tried, key=lambda each: each[:3])[3])
    return tags


def _strokes(piece: DraftedPiece, paper: OnPaper | None, *, nested: bool = False) -> list[Stroke]:
    """Return the lines of a piece; of one in a nest the sewing lines are hidden."""
    edges = [edge for edge in piece.edges if paper is None or edge.kind != "fold"]
    sewing = [stroke for edge in edges for stroke in _edge_strokes(piece, edge)]
    # Holes that have an allowance have a sewing line, too.
    sewing += [
        Stroke(role="sew", name=f"{name}.sew", points=cutout.sew_line, closed=True)
        for name, cutout in piece.cutouts.items()
        if cutout.width > 0
    ]
    if nested:
        sewing = [replace(line, hidden=line.hidden or line.role not in ("dart", "fold")) for line in sewing]
    ring = piece.cut_line
    cut = [Stroke(role="cut", name="cut", points=ring, closed=True)]
    if paper is not None and piece.fold_edges:
        # On paper it is what is cut and what lies on the fold, up to the cut edges.
        onwards = np.roll(ring, -1, axis=0)
        on_fold = np.zeros(len(ring), dtype=bool)
        for edge in piece.fold_edges:
            start, end = edge.line[[0, -1]]
            along = unit(end - start)
            away = [np.abs((points - start) @ [-along[1], along[0]]) for points in (ring, onwards)]
            on_fold |= np.maximum(*away) < ON_FOLD
        if not on_fold.any() or on_fold.all():
            cut += [stroke for edge in piece.fold_edges for stroke in _edge_strokes(piece, edge)]
        else:
            first = next(k for k in range(len(ring)) if on_fold[k - 1] and not on_fold[k])
            order = np.roll(np.arange(len(ring)), -first)
            changes = [k for k in range(len(ring)) if on_fold[order[k]] != on_fold[order[k - 1]]]
            cut = []
            for number, (a, b) in enumerate(zip(changes, [*changes[1:], len(ring)], strict=True)):
                folded = bool(on_fold[order[a]])
                name = piece.fold_edges[0].name if folded else "cut"
                cut.append(
                    Stroke(
                        role="fold" if folded else "cut",
                        name=name if number < 2 else f"{name} {number // 2 + 1}",
                        points=ring[order[np.arange(a, b + 1) % len(ring)]],
                    )
                )
    return [*cut, *sewing, *_detail_strokes(piece)]


def _edge_strokes(piece: DraftedPiece, edge: DraftedEdge) -> list[Stroke]:
    """Return an edge with its name; of a pleat's leg what is sewn is seen, and the whole leg, which readers need, is hidden."""
    role = edge.kind if edge.kind in ("hem", "fold", "dart") else "sew"
    line = piece.drawn_line(edge)
    whole = Stroke(role=role, name=edge.name, points=edge.line, curve=edge.curve, hidden=line is not edge.line)
    return [whole, Stroke(role=role, name="", points=line)] if whole.hidden else [whole]


def _detail_strokes(piece: DraftedPiece) -> list[Stroke]:
    strokes = [
        Stroke(role="dart_fold", name=f"{dart.dart.name}.fold", points=dart.fold)
        for dart in piece.darts
        if dart.fold is not None
    ]
    for index, notch in enumerate(piece.notches):
        for number, slit in enumerate(notch.slits):
            name = f"notch{index}.{notch.seam}" + (f".{number}" if notch.double else "")
            strokes.append(Stroke(role="notch", name=name, points=slit))
    for hole in piece.drill_holes:
        turn = np.linspace(0, 2 * np.pi, 17)[:-1]
        ring = hole.at + DRILL * np.column_stack([np.cos(turn), np.sin(turn)])
        strokes.append(Stroke(role="drill", name="", points=ring, closed=True))
        for axis in np.eye(2):
            cross = np.stack([hole.at - 1.5 * DRILL * axis, hole.at + 1.5 * DRILL * axis])
            strokes.append(Stroke(role="drill", name="", points=cross))
    strokes += [
        Stroke(role="cutout", name=name, points=cutout.cut_line, closed=True) for name, cutout in piece.cutouts.items()
    ]
    for name, line in piece.fisheyes.items():
        left, right = fisheye_legs(line)
        strokes += [
            Stroke(role="dart", name=f"{name}.left", points=left),
            Stroke(role="dart", name=f"{name}.right", points=right),
            Stroke(role="dart_fold", name=f"{name}.fold", points=left[[0, -1]]),
        ]
    return strokes


class _Annotations:
    """Grain, internal lines, leader and brackets of folds of a piece, and its words, which keep clear of each other.

    An edge's name stands inside the sewing line, a dart's beside its first leg, a seam's letter beside its notch, or in the
    middle of an edge without one, in the allowance. Nothing is written across a joint.

    Attributes:
        strokes, words: what is drawn and written.
    """

    def __init__(
        self,
        piece: DraftedPiece,
        label: Label,
        rows: Sequence[Words],
        paper: OnPaper | None,
        *,
        borders: bool = True,
        slits: Sequence[Geometry] = (),
    ) -> None:
        """Draw and write.

        Args:
            piece: whose words they are.
            label: of the piece, or of its nest.
            rows: what the label says, at its place.
            paper: where it is printed; None writes no letters.
            borders: whether edges have names.
            slits: notches of other sizes, which letters keep off.
        """
        import shapely

        self._piece, self._paper, self._room = piece, paper, LabelRoom()
        grain = grain_strokes(piece.grain)
        self.words, self.strokes = list(rows), list(grain)
        for name, line in piece.internal_lines.items():
            role, curve = "left_out" if name.endswith(LEFT_OUT) else "internal", _fit_internal_line(line.tobytes())
            self.strokes.append(Stroke(role=role, name=name, points=line, curve=curve))
        if label.leader is None:
            self._room.take(shapely.Polygon(label.box))
        else:
            self.strokes.append(Stroke(role="leader", name="", points=label.leader))
        for joint in () if paper is None else paper.joints:
            self._room.take(shapely.LineString(joint))
        if paper is not None and paper.outside is not None:
            self._room.take(paper.outside)
        for hole in piece.drill_holes:
            self._room.take(shapely.Point(hole.at).buffer(2 * DRILL))
        for cutout in piece.cutouts.values():
            self._room.take(shapely.LinearRing(cutout.sew_line))
        for stroke in grain:
            self._room.take(shapely.LineString(stroke.points))
        beyond = [self._bracket(fold) for fold in piece.fold_edges]
        # The lines that get a name: the name, its line, and whether it stands to the left of the line or above it.
        first_legs = {dart.dart.left: dart.dart.name for dart in piece.darts}
        second_legs = {dart.dart.right for dart in piece.darts}
        named = [(name, line, "above") for name, line in piece.internal_lines.items()]
        for edge in piece.edges:
            if edge.name in first_legs:
                named.append((first_legs[edge.name], piece.drawn_line(edge), "left"))
            elif borders and edge.kind != "fold" and edge.name not in second_legs:
                named.append((edge.name, edge.line, "left"))
        named += [(name, fisheye_legs(line)[0][::-1], "left") for name, line in piece.fisheyes.items()]
        drawn = [shapely.LineString(line) for _, line, _ in named]
        # Names stand along their lines, each clear of the other lines.
        own, called = piece.piece, {name for name, _, _ in named}
        for index, (name, line, side) in enumerate(named):
            # A lower edge is a hem for a sewer, turned up or raw, whatever level of the body it lies at; vents and wraps keep theirs.
            words, kinds = set(name.split(" ")), [edge.kind for edge in piece.edges if edge.name == name]
            lower = "hem" in kinds or ("cut" in kinds and HEMMED_LEVELS & words)
            kind = "hem" if lower and not {"vent", "slit", "wrap"} & words else name_without_number(name, called)
            # One of a pair is neither left nor right, as in the sewing order.
            text = name_in_units(translate_name(without_side(kind) if own.is_pair else kind), own.units)
            width = text_width(text, NAME)
            if polyline_length(line) < width + (0.008 if side == "left" else 0.02):
                continue
            others = [*drawn[:index], *drawn[index + 1 :]]
            # Beside an edge, as a zip is, a name may have room on one side alone.
            for which in (side, "either") if side == "above" else (side,):
                spots = spots_along(line, width, NAME_GAP, shares=NAME_SHARES, side=which)
                if self._write(text, NAME, spots, avoid=others, least=CLEAR, enough=WELL_CLEAR):
                    break
        self._name_buttons(drawn)
        if paper is not None:
            self._letter_notches(paper.letters, beyond, slits)
            self._letter_edges(paper)

    def _write(
        self, text: str, height: float, places: Iterable[Spot] | FloatArray, *, bold: bool = False, **clear: Any
    ) -> bool:
        """Write a text at the clearest of some spots, or level at places (#P by 2 [m]); return whether there is room."""
        spots = (Spot(x=x, y=y) for x, y in places.tolist()) if isinstance(places, np.ndarray) else places
        width = text_width(text, height, bold=bold)
        spot = self._room.place_clear(spots, width, TAILS * height, **clear)
        if spot is not None:
            at = np.array([spot.x, spot.y])
            self.words.append(Words(text=text, at=at, height=height, angle=spot.angle, bold=bold))
        return spot is not None

    def _bracket(self, fold: DraftedEdge) -> Geometry:
        """Draw a line beside a fold whose two arms point to it, with words along it; return what lies beyond the fold."""
        import shapely

        start, span = fold.line[0], fold.line[-1] - fold.line[0]
        length = float(np.linalg.norm(span))
        inwards = np.array([-span[1], span[0]]) / length
        depth = min(BRACKET, length / 4)
        a, b = start + 0.15 * span, start + 0.85 * span
        line = Stroke(role="grain", name="", points=np.stack([a, a + depth * inwards, b + depth * inwards, b]))
        bracket = [line, _arrow(a, -inwards), _arrow(b, -inwards)]
        self.strokes += bracket
        angle = float(np.arctan2(*as_read(span / length)[::-1]))
        places = [a + share * (b - a) + (depth / 2) * inwards for share in (0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8)]
        inside = [Spot(x=float(x), y=float(y), angle=angle) for x, y in places]
        self._write(translate("PLACE ON FOLD"), min(0.0035, length / 20), inside, enough=CLEAR)
        # Other words keep off the bracket, and inside the half that is printed.
        for stroke in bracket:
            self._room.take(shapely.LineString(stroke.points))
        run = BEYOND_FOLD * span / length
        beyond = parallelogram(start - run, span + 2 * run, (0.0, 1.0), inwards, (0.0, -BEYOND_FOLD))
        if self._paper is not None:
            self._room.take(beyond)
        return beyond

    def _name_buttons(self, drawn: Sequence[Geometry]) -> None:
        """Name the first button and the first buttonhole of a row, which are too short for a name along them."""
        marks = {hole.name: hole.at for hole in self._piece.drill_holes if hole.name == "button"}
        lines = self._piece.internal_lines
        marks |= {name: line.mean(axis=0) for name, line in lines.items() if name == "buttonhole"}
        sides = [
            (0, 1),
            (0, -1),
            (1, 0),
            (-1, 0),
            (0, 2),
            (0, -2),
            (1, 1),
            (1, -1),
            (-1, 1),
            (-1, -1),
            (1.6, 0),
            (-1.6, 0),
        ]
        for name, at in marks.items():
            text = translate_name(name)
            out = np.array([text_width(text, NAME) / 2 + 2 * DRILL + 0.001, 2 * DRILL + NAME])
            self._write(text, NAME, at + out * sides, avoid=drawn, least=CLEAR, enough=LETTER_CLEAR)

    def _letter_notches(
        self, letters: Mapping[str, str], beyond: Sequence[Geometry], slits: Sequence[Geometry]
    ) -> None:
        """Write each seam's letter beside its notches, outside the outer slit of a double one, and not beyond a fold."""
        import shapely

        for notch in (notch for notch in self._piece.notches if notch.seam in letters):
            letter = letters[notch.seam]
            along = np.array([notch.direction[1], -notch.direction[0]])
            middle = (notch.depth / 2 + 0.0004) * notch.direction
            half = text_width(letter, LETTER, bold=True) / 2 + LETTER_GAP
            # Close to the notch, or where the sheet ends there, some way along the edge.
            places = []
            for way in (0.0, LETTER, 2.0 * LETTER):
                for sign in (1.0, -1.0):
                    out = max(float((base - notch.base[0]) @ along * sign) for base in notch.base)
                    places.append(notch.base[0] + middle + sign * (out + half + way) * along)
            # Where the sheets' joint runs through all of them, the fold still counts.
            away = [min(shapely.distance(shapely.Point(place), beyond), default=np.inf) for place in places]
            clear = np.array(away) > half - LETTER_GAP
            spots = np.array(places)[clear if clear.any() else slice(None)]
            self._write(letter, LETTER, spots, bold=True, avoid=slits, enough=LETTER_CLEAR)

    def _letter_edges(self, paper: OnPaper) -> None:
        """Write the letters of seams that have no notch on the piece, as short ones, in the allowance of their edges."""
        notched = {paper.letters.get(notch.seam) for notch in self._piece.notches}
        for edge in self._piece.edges:
            seams = paper.sewn.get((self._piece.name, edge.name), ())
            letters = dict.fromkeys(paper.letters[seam] for seam in seams if seam in paper.letters)
            for letter in (each for each in letters if each not in notched):
                arc = arc_lengths(edge.line)
                at = points_at_lengths(edge.line, arc[-1] * np.array(LETTER_SHARES))
                ahead = points_at_lengths(edge.line, np.minimum(arc[-1] * np.array(LETTER_SHARES) + LETTER, arc[-1]))
                along = unit(ahead - at)
                out = np.column_stack([along[:, 1], -along[:, 0]])
                self._write(letter, LETTER, at + max(edge.width / 2, LETTER) * out, bold=True, enough=LETTER_CLEAR)


@lru_cache(maxsize=1024)
def _fit_internal_line(line: bytes) -> Curve:
    """Fit a curve to an internal line; cached, since every file asks for it."""
    return fit_curve(np.frombuffer(line).reshape(-1, 2))


def grain_strokes(grain: FloatArray) -> list[Stroke]:
    """Draw the grain line (2 by 2 [m]) with an arrow at either end."""
    low, high = grain
    return [Stroke(role="grain", name="grain", points=grain), _arrow(high, high - low), _arrow(low, low - high)]


def _arrow(tip: FloatArray, direction: FloatArray) -> Stroke:
    along = unit(direction)
    across = np.array([-along[1], along[0]])
    points = np.stack([tip - ARROW * along + BARB * across, tip, tip - ARROW * along - BARB * across])
    return Stroke(role="grain", name="", points=points)
