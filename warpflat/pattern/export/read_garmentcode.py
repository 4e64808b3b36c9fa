"""Patterns read from the JSON of GarmentCode: panels of straight and curved edges, stitches, and where the panels hang."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator
from scipy.spatial.transform import Rotation

from warpflat.core import FloatArray, InputError, check_table, nearest, polyline_length
from warpflat.pattern.drafting.curves import Curve, as_cubic
from warpflat.pattern.drafting.piece_parts import Dart, Edge
from warpflat.pattern.drafting.pieces import Pattern, Piece, Seam, SeamSide
from warpflat.pattern.drafting.polygons import signed_area
from warpflat.pattern.drafting.seam_difference import SEAM_TOLERANCE
from warpflat.pattern.export.pattern_json import Coordinate, Count, Ends, Entry, Name, Point, Text

__all__ = ["CENTIMETRES", "LABELS", "EdgeKey", "garmentcode_pattern"]

#: Units in a metre where the file says nothing.
CENTIMETRES = 100.0
# Chords of a curve stray from it by at most this [m]: a wide hem is then as long as its curve within .01 mm.
_CHORD = 5e-6
# A shoulder's distance from the middle of the body [m], near enough to tell a sleeve's upper end.
_SHOULDER = 0.15
#: By level of the body the label of the edges that are attached there.
LABELS = {"waist": "lower_interface"}


class CurvatureEntry(Entry):
    """The curve of an edge: control points, or a circle's radius, whether its longer arc, and whether on the right of the chord."""

    type: Literal["quadratic", "cubic", "circle"]
    params: Annotated[list[Point | float | bool], Field(min_length=1, max_length=3)]

    @model_validator(mode="after")
    def _params_agree(self) -> CurvatureEntry:
        points = [each for each in self.params if isinstance(each, list)]
        if self.type == "circle":
            if points or len(self.params) != 3 or not 0 < float(self.params[0]) <= 1e6:  # type: ignore[arg-type]
                raise ValueError("the params of a circle are its radius above 0 and two flags, long arc and right")
        elif not len(points) == len(self.params) == {"quadratic": 1, "cubic": 2}[self.type]:
            raise ValueError("a quadratic curve has one control point [x, y], a cubic one two")
        return self


class PanelEdgeEntry(Entry):
    """An edge between two vertices; `name` is the package's own key."""

    endpoints: Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=2, max_length=2)]
    curvature: CurvatureEntry | Point | None = None
    label: Text = ""
    name: Text = ""


class PanelEntry(Entry):
    """A panel: its outline in its own plane, and the way from there to the body; angles in degrees about x, y, z in turn.

    The keys from `grain` on are the package's own, as :class:`Piece` has them; `placed` is false where the place is a guess.
    """

    translation: Annotated[list[Coordinate], Field(min_length=3, max_length=3)] = [0.0, 0.0, 0.0]  # noqa: RUF012
    rotation: Annotated[list[Coordinate], Field(min_length=3, max_length=3)] = [0.0, 0.0, 0.0]  # noqa: RUF012
    vertices: Annotated[list[Point], Field(min_length=2, max_length=100_000)]
    edges: Annotated[list[PanelEdgeEntry], Field(min_length=2, max_length=100_000)]
    label: Text = ""
    grain: Ends | None = None
    placed: bool = True
    fabric: Text = ""
    quantity: Count = 1
    paired: bool = True
    also: dict[Text, Count] = Field(default_factory=dict)


class StitchSideEntry(Entry):
    """An edge of a panel, by its number; `seam` and `reversed` are the package's own keys, as in `drafting.pieces.SeamSide`."""

    panel: Name
    edge: Annotated[int, Field(ge=0)]
    seam: Text = ""
    reversed: bool = False


class PropertiesEntry(Entry):
    """How the numbers are meant."""

    curvature_coords: Literal["relative", "absolute"] = "relative"
    units_in_meter: Annotated[float, Field(ge=1e-3, le=1e6)] = CENTIMETRES


#: Two edges, and the word "right_wrong" where the cloth's right side meets a wrong one.
Stitch = Annotated[list[StitchSideEntry | Literal["right_wrong"]], Field(min_length=2, max_length=3)]


class OpenStitchEntry(Entry):
    """A stitch that the package has left out for GarmentCode's sake, and its number among the others."""

    at: Annotated[int, Field(ge=0)]
    stitch: Stitch


class PanelsEntry(Entry):
    """Panels and stitches; `open` is the package's own key."""

    panels: Annotated[dict[Name, PanelEntry], Field(min_length=1)]
    stitches: list[Stitch] = Field(default_factory=list)
    open: list[OpenStitchEntry] = Field(default_factory=list)


class GarmentCodeEntry(Entry):
    """The whole file; parameters are another program's."""

    pattern: PanelsEntry
    properties: PropertiesEntry = PropertiesEntry()


#: A panel and the number of its edge.
EdgeKey = tuple[str, int]
#: What an edge is stitched to, whether both run the same way, and the name that the package has given to the seam.
Partners = dict[EdgeKey, tuple[EdgeKey, bool, str]]


@dataclass(eq=False)
class _Panel:
    """A panel as it is read: the lines of its edges (#P by 2 [m]) with their own names, its place, what is cut of it, and its darts'
    legs by number.
    """

    key: str
    lines: list[FloatArray]
    names: list[str]
    labels: list[str]
    placement: FloatArray | None
    at: str
    grain: FloatArray | None
    cut: dict[str, Any]
    darts: list[tuple[list[int], list[int], str]] = field(default_factory=list)

    @property
    def ring(self) -> list[int]:
        """The edges around the panel once its darts are closed."""
        legs = {number for left, right, _ in self.darts for number in (*left, *right)}
        return [number for number in range(len(self.lines)) if number not in legs]


@dataclass(eq=False)
class _Chain:
    """Stitches that follow each other on both sides; `against` says of each edge whether the seam runs against it."""

    sides: tuple[list[EdgeKey], list[EdgeKey]]
    against: tuple[list[bool], list[bool]]
    name: str = ""


def garmentcode_pattern(data: Any, name: str) -> Pattern:
    """Return the pattern of the data of a GarmentCode file.

    A panel is a piece, with its right side towards the viewer: one whose edges run clockwise is seen from behind, and is turned over.
    It stands as it hangs, so that y is its grain: quarter turns bring its highest side up, of a sleeve that at the shoulder.

    A stitch joins the end of one edge to the start of the other, as outlines do that lie beside each other. Stitches that follow each
    other on both sides are one seam as long as the ease stays the same; darts between them count as closed. Edges that meet in a dent
    and are stitched to each other are a dart. Where the sides of a seam differ in length, the longer one is eased in.

    Args:
        data: as read.
        name: of the pattern.

    Raises:
        InputError: a key is missing or of another kind, edges do not follow each other around a panel, a stitch has an edge that there
            is not, or an edge is stitched twice.
    """
    entry = check_table(GarmentCodeEntry, data)
    panels = {key: _read_panel(key, each, entry.properties) for key, each in entry.pattern.panels.items()}
    stitches = list(entry.pattern.stitches)
    for left_out in sorted(entry.pattern.open, key=lambda each: each.at):
        stitches.insert(left_out.at, left_out.stitch)
    partners, own_chains = _read_stitches(stitches, panels)
    for panel in panels.values():
        _find_darts(panel, partners)
    chains = [chain for chain in own_chains if {*chain.sides[0], *chain.sides[1]} <= partners.keys()]
    chains += _chains(panels, {edge: found for edge, found in partners.items() if not found[2]})
    # Stretches that are one edge with the next: of a leg, and where the package itself has split an edge.
    joined = {
        (key, k) for key, panel in panels.items() for left, right, _ in panel.darts for k in left[:-1] + right[:-1]
    }
    neighbours = {frozenset(pair) for chain in chains for side in chain.sides for pair in pairwise(side)}
    for key, panel in panels.items():
        for k, own in enumerate(panel.names):
            after = (k + 1) % len(panel.names)
            free = not {(key, k), (key, after)} & partners.keys()
            if own and panel.names[after] == own and (free or frozenset([(key, k), (key, after)]) in neighbours):
                joined.add((key, k))
    named: dict[EdgeKey, str] = {}
    pieces = []
    for key, panel in panels.items():
        count = len(panel.lines)
        first = next((k for k in range(count) if (key, (k - 1) % count) not in joined), 0)
        groups = list[list[int]]()
        for k in ((first + step) % count for step in range(count)):
            if groups and (key, groups[-1][-1]) in joined:
                groups[-1].append(k)
            else:
                groups.append([k])
        legs = {number for left, right, _ in panel.darts for number in (*left, *right)}
        edges = list[Edge]()
        for group in groups:
            own = panel.names[group[0]]
            taken = {edge.name for edge in edges}
            edge = own if own and own not in taken else f"edge_{group[0]}"
            named |= {(key, k): edge for k in group}
            points = np.concatenate([panel.lines[group[0]][:1], *(panel.lines[k][1:] for k in group)])
            edges.append(Edge(name=edge, points=points, kind="dart" if group[0] in legs else "seam"))
        darts = [
            Dart(name=own or f"dart_{number}", left=named[key, left[0]], right=named[key, right[0]])
            for number, (left, right, own) in enumerate(panel.darts, start=1)
        ]
        levels = {
            named[key, k]: level
            for k, label in enumerate(panel.labels)
            for level, its in LABELS.items()
            if label == its
        }
        pieces.append(
            Piece(
                name=key,
                edges=edges,
                darts=darts,
                at=panel.at,
                grain=panel.grain,
                placement=panel.placement,
                levels=levels,
                **panel.cut,
            )
        )
    return Pattern(name=name, pieces={"": pieces}, seams=_seams(chains, panels, named))


def _read_panel(key: str, entry: PanelEntry, properties: PropertiesEntry) -> _Panel:
    """Return a panel as it hangs, counter-clockwise; its place maps (x, y, 1) to the body (3 by 3)."""
    vertices, lines = np.array(entry.vertices), list[FloatArray]()
    for number, edge in enumerate(entry.edges):
        where = f"pattern.panels.{key}.edges[{number}]"
        start, end = edge.endpoints
        if max(start, end) >= len(vertices):
            raise InputError(
                f"{where}.endpoints: vertex {max(start, end)} is not there; vertices are 0 to {len(vertices) - 1}"
            )
        onward = entry.edges[(number + 1) % len(entry.edges)].endpoints[0]
        if end != onward:
            raise InputError(
                f"{where}: ends at vertex {end}, the next edge starts at {onward}; edges follow each other around a panel"
            )
        curve = _curve(
            vertices[start], vertices[end], edge.curvature, absolute=properties.curvature_coords == "absolute"
        )
        lines.append(curve.sample(_CHORD * properties.units_in_meter) / properties.units_in_meter)
    ring = np.concatenate([line[:-1] for line in lines])
    turned = Rotation.from_euler("xyz", entry.rotation, degrees=True).as_matrix()
    placement = np.column_stack([turned[:, :2], np.array(entry.translation) / properties.units_in_meter])
    middle = placement @ [*ring.mean(axis=0), 1.0]
    # A label says on which part of the body a panel is; else its name does.
    words = re.split(r"[^a-z]+", (entry.label or key).lower())
    on_arm = any(word.startswith(("sleeve", "arm")) for word in words) or {"sl", "cuff"} <= set(words)
    flip = np.diag([-1.0 if signed_area(ring) < 0.0 else 1.0, 1.0])
    # Of the four ways to stand the one whose height rises most, or on an arm, whose sleeve may lie, comes nearest to the shoulder.
    up = np.array([0.0, 1.0, 0.0])
    if on_arm:
        highest = float((np.column_stack([ring, np.ones(len(ring))]) @ placement[1]).max())
        up = np.array([np.sign(middle[0]) * _SHOULDER - middle[0], highest - middle[1], 0.0])
    quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
    ways = [flip @ np.linalg.matrix_power(quarter, k) for k in range(4)]
    # Rows are points: a point p of the piece is the point `way @ p` of the panel.
    way = max(ways, key=lambda each: round(float(up @ placement[:, :2] @ each[:, 1]), 6))
    placement = np.column_stack([placement[:, :2] @ way, placement[:, 2]])
    outward = float(np.cross(placement[:, 0], placement[:, 1])[2])
    side = "left" if middle[0] > 0 else "right"
    at = f"{side} arm" if on_arm else "front" if outward > 0.5 else "back" if outward < -0.5 else ""
    return _Panel(
        key=key,
        lines=[line @ way for line in lines],
        names=[edge.name for edge in entry.edges],
        labels=[edge.label for edge in entry.edges],
        placement=placement if entry.placed else None,
        at=at if entry.placed else "",
        grain=None if entry.grain is None else np.array(entry.grain) @ way / properties.units_in_meter,
        cut={key: getattr(entry, key) for key in ("fabric", "quantity", "paired", "also")},
    )


def _curve(start: FloatArray, end: FloatArray, entry: CurvatureEntry | list[float] | None, *, absolute: bool) -> Curve:
    """Return the curve of an edge. Relative control points are (along, to the left), in lengths of the chord."""
    chord = end - start
    left = np.array([-chord[1], chord[0]])
    if entry is None:
        return Curve(bezier=(start + np.linspace(0.0, 1.0, 4)[:, None] * chord)[None], straight=np.array([True]))
    if isinstance(entry, CurvatureEntry) and entry.type == "circle":
        given, is_long, is_right = (float(each) for each in entry.params)  # type: ignore[arg-type]
        length = float(np.linalg.norm(chord))
        radius = max(given, 0.5 * length)
        angle = 2.0 * np.arcsin(min(0.5 * length / radius, 1.0))
        angle = 2.0 * np.pi - angle if is_long else angle
        turn = angle if is_right else -angle
        # The centre lies at the height r cos(angle / 2) over the chord, on the side away from the arc.
        centre = start + 0.5 * chord + left / length * np.sign(turn) * radius * np.cos(0.5 * angle)
        count = int(np.ceil(angle / (np.pi / 8)))
        angles = np.arctan2(*(start - centre)[::-1]) + np.linspace(0.0, turn, count + 1)
        out = np.column_stack([np.cos(angles), np.sin(angles)])
        ahead = 4.0 / 3.0 * np.tan(0.25 * turn / count) * np.column_stack([-out[:, 1], out[:, 0]])
        bezier = centre + radius * np.stack([out[:-1], out[:-1] + ahead[:-1], out[1:] - ahead[1:], out[1:]], axis=1)
        bezier[0, 0], bezier[-1, 3] = start, end
        return Curve(bezier=bezier, straight=np.zeros(count, dtype=bool))
    control = np.array(entry.params if isinstance(entry, CurvatureEntry) else [entry], dtype=np.float64)
    control = control if absolute else start + control[:, :1] * chord + control[:, 1:] * left
    return Curve(bezier=as_cubic(np.vstack([start, control, end]))[None], straight=np.array([False]))


def _read_stitches(
    stitches: Sequence[Sequence[StitchSideEntry | str]], panels: Mapping[str, _Panel]
) -> tuple[Partners, list[_Chain]]:
    """Return what each edge is stitched to, and the seams that the package itself has split into stitches."""
    partners: Partners = {}
    own: dict[str, _Chain] = {}
    for number, stitch in enumerate(stitches):
        where, ends, named, against = f"pattern.stitches[{number}]", list[EdgeKey](), "", list[bool]()
        for side in stitch[:2]:
            if isinstance(side, str):
                raise InputError(f'{where}: {side!r} is no edge; a stitch joins two {{"panel": NAME, "edge": NUMBER}}')
            if side.panel not in panels:
                raise InputError(f"{where}: there is no panel {side.panel!r}; {nearest(side.panel, panels)}")
            last = len(panels[side.panel].lines) - 1
            if side.edge > last:
                raise InputError(f"{where}: panel {side.panel!r} has no edge {side.edge}; its edges are 0 to {last}")
            ends.append((side.panel, side.edge))
            named = side.seam
            against.append(side.reversed)
        if any(not isinstance(word, str) for word in stitch[2:]):
            raise InputError(f'{where}: joins three edges; a stitch joins two, and only "right_wrong" may follow')
        for edge, other in (ends, ends[::-1]):
            if edge in partners or edge == other:
                raise InputError(f"{where}: edge {edge[1]} of {edge[0]!r} is stitched twice; an edge is in one stitch")
            partners[edge] = other, len(stitch) == 3, named
        if named:
            chain = own.setdefault(named, _Chain(sides=([], []), against=([], []), name=named))
            for k in range(2):
                chain.sides[k].append(ends[k])
                chain.against[k].append(against[k])
    return partners, list(own.values())


def _find_darts(panel: _Panel, partners: Partners) -> None:
    """Find the darts of a panel: from each dent outwards as far as edges on both sides are stitched to each other."""
    count = len(panel.lines)
    for tip in range(count):
        (before_tip, at_tip), after_tip = panel.lines[tip][-2:], panel.lines[(tip + 1) % count][1]
        into, out = at_tip - before_tip, after_tip - at_tip
        if into[0] * out[1] - into[1] * out[0] >= 0.0:
            continue
        left, right = list[int](), list[int]()
        for step in range(count // 2):
            before, after = (tip - step) % count, (tip + 1 + step) % count
            partner, same_way, _ = partners.get((panel.key, before), ((panel.key, -1), False, ""))
            if partner != (panel.key, after) or same_way:
                break
            left, right = [before, *left], [*right, after]
        # A panel that is sewn to itself all around is a bag.
        if left and len(left) + len(right) < count:
            panel.darts.append((left, right, partners[panel.key, left[0]][2]))
    for left, right, _ in panel.darts:
        for number in (*left, *right):
            del partners[panel.key, number]


def _chains(panels: Mapping[str, _Panel], partners: Partners) -> list[_Chain]:
    """Return the stitches in the order in which they follow each other on both sides."""
    after: dict[EdgeKey, EdgeKey] = {}
    for key, panel in panels.items():
        ring = panel.ring
        after |= {(key, k): (key, other) for k, other in zip(ring, ring[1:] + ring[:1], strict=True)}
    before = {other: edge for edge, other in after.items()}
    length = {(key, k): polyline_length(line) for key, panel in panels.items() for k, line in enumerate(panel.lines)}

    def onward(edge: EdgeKey, step: Mapping[EdgeKey, EdgeKey], back: Mapping[EdgeKey, EdgeKey]) -> EdgeKey | None:
        """Return the next edge of the same seam."""
        other, same_way, _ = partners[edge]
        if (following := step[edge]) not in partners:
            return None
        beside, runs, _ = partners[following]
        if beside != (step if same_way else back)[other] or runs != same_way:
            return None
        # As long by the other's ease, whichever of the four is the longest: a short edge says little of the ease.
        one, two = (length[edge], length[other]), (length[following], length[beside])
        apart = abs(one[0] * two[1] - one[1] * two[0]) / max(*one, *two)
        return following if apart <= SEAM_TOLERANCE else None

    found, used = list[_Chain](), set[EdgeKey]()
    for edge in partners:
        if edge in used:
            continue
        # Back to where the seam begins, and on to its end.
        seen = {edge, partners[edge][0]}
        while (previous := onward(edge, before, after)) is not None and previous not in seen:
            edge = previous
            seen |= {edge, partners[edge][0]}
        chain, seen = [edge], {edge, partners[edge][0]}
        while (following := onward(chain[-1], after, before)) is not None and following not in seen:
            chain.append(following)
            seen |= {following, partners[following][0]}
        used |= seen
        others, same_way = [partners[each][0] for each in chain], partners[chain[0]][1]
        found.append(_Chain(sides=(chain, others), against=([False] * len(chain), [not same_way] * len(chain))))
    return found


def _seams(chains: Sequence[_Chain], panels: Mapping[str, _Panel], named: Mapping[EdgeKey, str]) -> list[Seam]:
    """Return the seams of chains, a longer side last; where stretches differ in ease, it lies between the first and the last eased."""
    seams = []
    for number, chain in enumerate(chains, start=1):
        lengths = [np.array([polyline_length(panels[key].lines[k]) for key, k in side]) for side in chain.sides]
        sides = []
        for side, against in zip(chain.sides, chain.against, strict=True):
            edges = {(key, named[key, k]): against[at] for at, (key, k) in enumerate(side)}
            sides.append(tuple(SeamSide(piece=key, edge=edge, reversed=back) for (key, edge), back in edges.items()))
        if lengths[0].sum() > lengths[1].sum() + SEAM_TOLERANCE:
            sides, lengths = sides[::-1], lengths[::-1]
        excess, whole = lengths[1] - lengths[0], float(lengths[0].sum())
        if abs(excess.sum()) <= SEAM_TOLERANCE:
            ease, eased = 0.0, (0.0, 1.0)
        else:
            ease = float(excess.sum()) / whole
            at = np.concatenate([[0.0], np.cumsum(lengths[0])]) / whole
            longer = np.flatnonzero(excess > 0.1 * ease * lengths[0])
            eased = (float(at[longer[0]]), min(float(at[longer[-1] + 1]), 1.0))
        seams.append(Seam(name=chain.name or f"seam_{number}", sides=(sides[0], sides[1]), ease=ease, eased=eased))
    return seams
