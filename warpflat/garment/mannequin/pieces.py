"""Pieces of a form: bricks joined into one disk each, with named edges."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from warpflat.core import FloatArray, InputError, IntArray, find_unused_name, nearest, short_repr
from warpflat.flat import Surface, border_loops, euler_characteristic, fan_labels, half_edges, paired_half_edges
from warpflat.garment.mannequin.bricks import select_bricks
from warpflat.garment.mannequin.halves import check_halves, fold_among, is_side, lies_on_both
from warpflat.garment.mannequin.layout import Layout, joined_runs

__all__ = ["FormPiece", "cut_pieces", "is_part_of"]

# The lines of the trunk that run on down a leg: a piece that has both has one edge, under the leg's name.
_CONTINUED = {
    "centre front": "crotch front", "centre back": "crotch back", "side left": "outseam left", "side right": "outseam right",
}  # fmt: skip

#: For each piece its brick patterns, its datum line, and the lines along which it is cut open.
Recipes = Mapping[str, tuple[Sequence[str], str, Sequence[str]]]
#: By piece and dart the mannequin's vertices along a dart, from the border of the piece to the tip; of a fish-eye dart from tip to tip.
Darts = Mapping[str, Mapping[str, IntArray]]


@dataclass(frozen=True, kw_only=True, eq=False)
class FormPiece:
    """One piece of cloth on the body.

    Attributes:
        surface: the piece; its `lines` hold every feature line that runs through it and every edge. An edge that goes on inside
            as the same feature line is there with all of it.
        edges: the border, counter-clockwise from outside, cut where one feature line ends and the next begins: vertex
            indices of the piece along each edge, both ends included.
        datum: the feature line to develop from; a name in `surface.lines`. Of one that falls into parts the longest.
        fold: the edge that lies on the fold if this is a half piece, else None.
        grid_vertices: #V, for each vertex of the piece its vertex on the mannequin.
        face_brick: #F, for each face its brick's name.
        darts: by name, the edges along the left leg, from the border to the tip, and along the right one, back to the border.
        fisheyes: darts with two tips by name, the vertices along their left and right leg, both from the first tip to the second. They
            are there in `surface.lines`, too, as "NAME.left" and "NAME.right".
        parts: where darts interrupt an edge, the name of the whole edge by each of its parts.
    """

    __repr__ = short_repr

    surface: Surface
    edges: Mapping[str, IntArray]
    datum: str
    fold: str | None
    grid_vertices: IntArray
    face_brick: tuple[str, ...]
    darts: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    fisheyes: Mapping[str, tuple[IntArray, IntArray]] = field(default_factory=dict)
    parts: Mapping[str, str] = field(default_factory=dict)

    @property
    def leg_edges(self) -> frozenset[str]:
        """Names of the edges along the legs of its darts."""
        return frozenset(leg for legs in self.darts.values() for leg in legs)

    def whole(self, edge: str) -> str:
        """Return what an edge is called without the darts that interrupt it."""
        return self.parts.get(edge, edge)

    def legs(self) -> dict[str, tuple[IntArray, IntArray]]:
        """Return by dart the vertices along its left and right leg, from the border to the tip; of a fish-eye dart from tip to tip."""
        darts = {dart: (self.edges[left], self.edges[right][::-1]) for dart, (left, right) in self.darts.items()}
        return {**darts, **self.fisheyes}

    def mouth(self, dart: str, positions: FloatArray) -> tuple[int, float]:
        """Return at which vertex of its legs a dart is widest in a pattern (#P by 2 [m]), and how wide [m]; a fish-eye dart is inside."""
        left, right = self.legs()[dart]
        apart = np.linalg.norm(positions[left] - positions[right], axis=1)
        widest = int(apart.argmax()) if dart in self.fisheyes else 0
        return widest, float(apart[widest])


def cut_pieces(
    layout: Layout,
    vertices: FloatArray,
    recipes: Recipes,
    *,
    darts: Darts | None = None,
    half: bool = False,
    known: Mapping[str, FormPiece] | None = None,
    continued: Mapping[str, str] = MappingProxyType({}),
) -> dict[str, FormPiece]:
    """Join bricks into pieces.

    Args:
        layout: the grid.
        vertices: layout.vertex_count by 3 [m].
        recipes: see :data:`Recipes`.
        darts: see :data:`Darts`.
        half: the left half of the garment: pieces that lie on both sides of a centre line end there, on the fold, and
            those of the right side are left out, being the left ones' mirror images.
        known: pieces that are there already, by name.
        continued: lines that run on as another one: a piece that has both has one edge, under the other one's name.

    Raises:
        InputError: for an unknown brick or line, a line that does not run through its piece, a brick in two pieces, a piece that
            is not one disk, or halves that are no mirror images.
    """
    owner: dict[str, str] = {}
    cuts: dict[str, tuple[list[str], str, Sequence[str]]] = {}
    for name, (patterns, datum, opened) in recipes.items():
        bricks = select_bricks(layout, patterns)
        for b in bricks:
            if b in owner:
                raise InputError(f"form: brick {b} is in two pieces, {owner[b]} and {name}; leave it out of one")
            owner[b] = name
        for line in (*opened, *([datum] if datum else [])):
            if line not in layout.lines:
                raise InputError(f"form: piece {name}: line {line!r} is unknown: {nearest(line, layout.lines)}")
        inside = layout.edges_of(bricks, inside=True) if opened else set()
        for line in opened:
            if inside.isdisjoint(layout.edges_along(line)):
                through = [each for each in layout.lines if not inside.isdisjoint(layout.edges_along(each))]
                raise InputError(
                    f"form: line {line!r} does not run through piece {name}, which is to be open along it: {nearest(line, through)}"
                )
        cuts[name] = (bricks, datum, opened)
    if half:
        check_halves(cuts)
        cuts = {name: cut for name, cut in cuts.items() if not all(is_side(b, "right") for b in cut[0])}
    darts, known = darts or {}, known or {}
    return {
        name: known.get(name)
        or _piece(layout, vertices, name, *cut, darts.get(name, {}), half, {**_CONTINUED, **continued})
        for name, cut in cuts.items()
    }


def _piece(
    layout: Layout,
    vertices: FloatArray,
    name: str,
    bricks: Sequence[str],
    datum: str,
    opened: Sequence[str],
    darts: Mapping[str, IntArray],
    half: bool,
    continued: Mapping[str, str],
) -> FormPiece:
    folded = half and lies_on_both(bricks)
    if folded:
        bricks = [b for b in bricks if is_side(b, "left")]
    rows = layout.faces_of(bricks)
    inside = set(np.unique(layout.faces[rows]).tolist())
    darts = {dart: row for dart, row in darts.items() if inside.issuperset(row.tolist())}
    slits = {(min(a, b), max(a, b)) for row in darts.values() for a, b in itertools.pairwise(row.tolist())}
    # Vertices are doubled along cuts: two corners at one vertex are one vertex of the piece if a chain of faces joins them without crossing
    # a cut.
    cut = layout.edges_along(*opened) | slits
    he = half_edges(layout.faces[rows])
    a, b = paired_half_edges(he)
    whole = np.array([(low, high) not in cut for low, high in he.edges.tolist()])[he.edge[a]]
    fan = fan_labels(he, a[whole], b[whole])
    vertex = he.tail[np.unique(fan, return_index=True)[1]]
    # Numbered in the mannequin's order, so that a piece is the same in every size.
    order = np.argsort(vertex, kind="stable")
    number = np.empty(len(order), np.int32)
    number[order] = np.arange(len(order))
    corners, grid_vertices = number[fan].reshape(-1, 4), vertex[order]
    sides = half_edges(corners)
    loops = border_loops(sides)
    # By Euler: every further loop is a hole of the one disk.
    if not loops or euler_characteristic(sides) != 2 - len(loops):
        raise InputError(_not_one_disk(name, opened=bool(opened), darts=darts))
    loop, *holes = loops
    # A fish-eye dart is a hole; its legs run from its first tip to its second.
    fisheyes = {}
    for hole in holes:
        on_grid = grid_vertices[hole]
        for dart, row in darts.items():
            if not np.array_equal(np.unique(on_grid), np.unique(row)):
                continue
            ids = np.roll(hole, -int(np.flatnonzero(on_grid == row[0])[0])).astype(np.int32)
            middle = len(row)
            # Along the border the cloth lies on the left, and so the wedge on the right of the left leg.
            fisheyes[dart] = ids[:middle], np.concatenate([ids[:1], ids[middle - 1 :][::-1]])
    if len(fisheyes) != len(holes):
        raise InputError(_not_one_disk(name, opened=bool(opened), darts=darts))
    darts = {dart: row for dart, row in darts.items() if dart not in fisheyes}
    edges, parts = _edges(layout, loop, grid_vertices, darts, continued)
    lines = _lines(layout, corners, grid_vertices, edges)
    lines |= {leg: ids for dart, legs in fisheyes.items() for leg, ids in zip(_legs(dart), legs, strict=True)}
    fold = fold_among(edges, opened, name) if folded else None
    surface = Surface(vertices=vertices[grid_vertices], faces=corners, lines=lines, name=name)
    wished = datum or fold
    along = [line for line in lines if is_part_of(line, wished)] if wished else list(lines)[:1]
    if not along:
        raise InputError(f"form: piece {name}: its datum {datum!r} does not run through it: {nearest(datum, lines)}")
    if fold and len(np.intersect1d(lines[datum if datum in lines else along[0]], edges[fold])) == 1:
        raise InputError(
            f"form: piece {name}: its datum {datum!r} runs across the fold, {fold}, along which a half piece is laid: "
            f"datum = {fold!r}, or cut it whole: half = false"
        )
    line = max(along, key=lambda line: len(lines[line]))
    names = list(layout.bricks)
    return FormPiece(
        surface=surface, edges=edges, datum=line, fold=fold, grid_vertices=grid_vertices,
        face_brick=tuple(names[i] for i in layout.face_brick[rows]), parts=parts,
        darts={dart: _legs(dart) for dart in darts}, fisheyes=fisheyes,
    )  # fmt: skip


def _not_one_disk(name: str, *, opened: bool, darts: Collection[str]) -> str:
    if darts:
        return (
            f"form: piece {name} is not one disk: its darts ({', '.join(darts)}) meet or part it; let each begin at the border or inside "
            "and end inside, two mesh edges from any other"
        )
    return (
        f"form: piece {name} is not one disk (its bricks touch at a point, fall apart, or close to a tube); "
        f"choose neighbouring bricks, or name {'another' if opened else 'a'} line to open it along"
    )


def _legs(dart: str) -> tuple[str, str]:
    """Return the names of a dart's two edges."""
    return f"{dart}.left", f"{dart}.right"


def _edges(
    layout: Layout,
    loop: IntArray,
    grid_vertices: IntArray,
    darts: Mapping[str, IntArray],
    continued: Mapping[str, str],
) -> tuple[dict[str, IntArray], dict[str, str]]:
    """Return a piece's edges, and the name of the whole edge by each part of one that darts interrupt.

    The first part, counter-clockwise, has the name of the whole; names of all other edges are as without darts.
    """
    line_of: dict[tuple[int, int], str] = {}
    for line, ids in layout.lines.items():
        for a, b in itertools.pairwise(ids.tolist()):
            line_of.setdefault((min(a, b), max(a, b)), line)
    leg_of: dict[tuple[int, int], str] = {}
    for dart, row in darts.items():
        for a, b in itertools.pairwise(row.tolist()):
            leg_of[a, b], leg_of[b, a] = _legs(dart)
    on_grid = grid_vertices[loop]
    steps = list(zip(on_grid.tolist(), np.roll(on_grid, -1).tolist(), strict=True))
    labels = [leg_of.get((a, b)) or line_of.get((min(a, b), max(a, b)), "edge") for a, b in steps]
    labels = [continued[label] if continued.get(label) in labels else label for label in labels]
    legs = set(leg_of.values())
    # A doubled line turns back on itself at its end, which starts a new edge though the label stays.
    turns = [labels[i] != labels[i - 1] or on_grid[i - 1] == on_grid[(i + 1) % len(loop)] for i in range(len(loop))]
    starts = [i for i, t in enumerate(turns) if t] or [0]
    # Begin where a whole edge does.
    first = next((n for n, i in enumerate(starts) if not {labels[i], labels[i - 1]} & legs), 0)
    starts = [*starts[first:], *(i + len(loop) for i in starts[:first])]
    stretches = [
        (labels[a % len(loop)], loop[np.arange(a, b + 1) % len(loop)].astype(np.int32))
        for a, b in itertools.pairwise([*starts, starts[0] + len(loop)])
    ]
    wholes: list[str] = []
    last, taken = "", set[str]()
    for number, (label, _) in enumerate(stretches):
        after_dart = number > 0 and stretches[number - 1][0] in legs
        goes_on = label not in legs and after_dart and is_part_of(last, label)
        wholes.append(last if goes_on else find_unused_name(label, taken))
        taken.add(wholes[-1])
        last = last if label in legs else wholes[-1]
    edges: dict[str, IntArray] = {}
    for number, (label, ids) in enumerate(stretches):
        first = wholes.index(wholes[number]) == number
        name = wholes[number] if first else find_unused_name(label, taken)
        taken.add(name)
        edges[name] = ids
    counts = {whole: wholes.count(whole) for whole in wholes}
    return edges, {name: whole for name, whole in zip(edges, wholes, strict=True) if counts[whole] > 1}


def _lines(
    layout: Layout, corners: IntArray, grid_vertices: IntArray, edges: Mapping[str, IntArray]
) -> dict[str, IntArray]:
    """Return every edge and, as vertex indices of the piece, the runs of feature lines inside it, the longest of a line first.

    Where an edge goes on inside as the same line, its name means both.
    """
    lines, sides = dict(edges), half_edges(corners)
    # Off the border, and so off all that is doubled, an edge of the mannequin is one of the piece.
    inner: dict[tuple[int, int], int] = {}
    for u, v in sides.edges[sides.count == 2].tolist():
        a, b = int(grid_vertices[u]), int(grid_vertices[v])
        inner[a, b], inner[b, a] = v, u
    for line, ids in layout.lines.items():
        runs = joined_runs((inner[b, a], inner[a, b]) for a, b in itertools.pairwise(ids.tolist()) if (a, b) in inner)
        along = [edge for edge in edges if is_part_of(edge, line)]
        for run in sorted(runs, key=len, reverse=True):
            # With what goes on at its ends as the same line; it has the first of their names.
            joined: set[str] = set()
            for edge in along * len(along):
                if edge in joined or run[0] == run[-1]:
                    continue
                ids = lines[edge].tolist()
                if run[0] in (ids[0], ids[-1]):
                    run = [*(ids if ids[-1] == run[0] else ids[::-1]), *run[1:]]
                elif run[-1] in (ids[0], ids[-1]):
                    run = [*run, *(ids if ids[0] == run[-1] else ids[::-1])[1:]]
                else:
                    continue
                joined.add(edge)
            border = next((edge for edge in along if edge in joined), None)
            lines[border or find_unused_name(line, lines)] = np.array(run, np.int32)
    return lines


def is_part_of(name: str, line: str) -> bool:
    """Return whether a name is that of a feature line or of a further part of it."""
    return name == line or (name.startswith(f"{line} ") and name[len(line) + 1 :].isdigit())
