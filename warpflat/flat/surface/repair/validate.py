"""Validation and repair: any polygons become a checked :class:`Surface`, or are refused.

The steps are: numbers and indices, corners, split corners, double faces, edges with too many faces, the component, winding, thickness,
points in which the surface only touches itself, the border, slivers. Faults with one plain remedy are repaired and noted; the others
are refused with advice. Vertices that stay keep their order and their exact position.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.core.file_names import check_file_name, check_label
from warpflat.core.text import area_words, format_count, list_some, quote_value
from warpflat.flat.surface.connectivity import (
    border_loops,
    components,
    corner_fans,
    euler_characteristic,
    orient,
    part_fans,
)
from warpflat.flat.surface.half_edges import HalfEdges, half_edges
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.normals import flat_areas
from warpflat.flat.surface.repair.polygons import (
    distinct_corners,
    find_crossed_quads,
    pad_polygons,
    split_polygons,
    split_quads,
)
from warpflat.flat.surface.repair.sheets import THICKEST, outer_sheet, part_sheets
from warpflat.flat.surface.repair.slivers import merge_degenerate_faces
from warpflat.flat.surface.repair.weld import t_junction, welding

__all__ = ["ClosedSurfaceError", "check_positions", "make_surface", "parts_of_faces"]


# Bounds of coordinates, and of a whole surface [m]: areas and squares of areas beyond them are no numbers any more.
_SMALLEST, _LARGEST = 1e-20, 1e20
# So many sheets at most meet at an edge. One that comes off with less than this share of the area is left out if one piece is asked for.
_MOST_SHEETS, _FIN = 8, 0.05
# A wall between two sheets is joined to others along this share of its border.
_WALL = 0.8
# Odd factors by which the vertices of a face are mixed to one number.
_HASH = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0xD6E8FEB86659FD93], dtype=np.uint64)


class ClosedSurfaceError(InputError):
    """A surface without a border."""


@dataclass
class _Mesh:
    """A mesh under repair.

    Attributes:
        vertices: #V by 3 [m].
        faces: #F by 4.
        origin: #F, the input face of each.
        index: #V, the input row of each vertex.
        notes: repairs made, one sentence each.
        crowded: where more than two faces met, and the surface was parted into sheets; "" for nowhere.
    """

    vertices: FloatArray
    faces: IntArray
    origin: IntArray
    index: IntArray
    notes: list[str] = field(default_factory=list)
    crowded: str = ""
    _made: dict[str, tuple[IntArray, Any]] = field(default_factory=dict)

    @property
    def half_edges(self) -> HalfEdges:
        """The half-edges of the faces."""
        made: HalfEdges = self._once("half_edges", lambda: half_edges(self.faces))
        return made

    @property
    def part(self) -> IntArray:
        """#F, the connected component of each face."""
        made: IntArray = self._once("part", lambda: components(self.half_edges))
        return made

    def _once(self, name: str, make: Callable[[], Any]) -> Any:
        """Return what follows from the faces, made once for each array of them."""
        faces, made = self._made.get(name, (None, None))
        if faces is not self.faces:
            made = make()
            self._made[name] = self.faces, made
        return made

    def describe(self, which: BoolArray) -> str:
        """Return how many faces of which area are chosen (#F), in words."""
        area = flat_areas(self.vertices, self.faces[which]).sum()
        return f"{format_count(int(which.sum()), 'face')} of {area_words(float(area))}"

    def keep(self, which: BoolArray) -> None:
        """Drop all faces but these (#F)."""
        self.faces, self.origin = self.faces[which], self.origin[which]

    def drop_unused_vertices(self) -> IntArray:
        """Drop vertices without a face; return #V, the new number of each that there was, -1 for those dropped."""
        kept, number = _used_vertices(self.faces), np.full(len(self.vertices) + 1, -1, dtype=np.int32)
        number[kept] = np.arange(len(kept), dtype=np.int32)
        if len(kept) < len(self.vertices):
            self.faces, self.vertices, self.index = number[self.faces], self.vertices[kept], self.index[kept]
        return number[:-1]


def make_surface(
    vertices: ArrayLike,
    polygons: ArrayLike | Sequence[Sequence[int]],
    *,
    name: str = "piece",
    lines: Mapping[str, ArrayLike] | None = None,
    component: int | Literal["largest"] | None = None,
    weld: bool | None = None,
    split_corners: bool = False,
    closed: bool = False,
    sliver_tolerance: float = 1e-3,
    source: str | None = None,
) -> Surface:
    """Return a surface that can be flattened, from any polygons.

    Args:
        vertices: #I by 3, positions [m].
        polygons: #F by k vertex indices (counted from 0) filled up with -1 on the right, or a list of lists.
        name: of the piece in files and messages; it must be able to name a file on any system.
        lines: feature lines by name: vertex indices (of `vertices`) along edges.
        component: the connected part to take if there are several: "largest", or its number, that of the largest area first, from 0.
        weld: true to join vertices at the same place. By default they are joined if `split_corners` says that the format
            splits them (unless that would close a piece that is one sheet as it stands), if faces are connected in no
            other way, or if several parts become one sheet by it. A cut in one connected part thus stays open.
        split_corners: true if the format has one vertex per corner of a face, or per texture coordinate.
        closed: true to accept a surface without a border, or with handles, that is cut before it is flattened.
        sliver_tolerance: a face whose least width is below this share of the edge length around it is degenerate and
            merged into its neighbours (see :mod:`warpflat.flat.surface.repair.slivers`).
        source: name of the input in messages, such as a file's; by default `name`.

    Raises:
        InputError: with one line, if the input is no surface or no such part of one, or the name cannot name a file.
    """
    check_file_name(name)
    try:
        positions = check_positions(vertices)
        mesh = _checked_faces(positions, polygons)
        paths = {key: checked_line(key, line, len(positions)) for key, line in (lines or {}).items()}
        place = _weld(mesh, weld, split_corners, component is not None)
        _order_corners(mesh)
        _drop_double_faces(mesh)
        _part_sheets(mesh)
        _drop_double_layers(mesh)
        _choose_component(mesh, component)
        faces, turned = orient(mesh.half_edges)
        if turned:
            mesh.faces = faces
            mesh.notes.append(f"the winding of {format_count(turned, 'face')} was turned to agree with the others")
        if (mesh.half_edges.count == 2).all() and (sheet := outer_sheet(mesh.vertices, mesh.half_edges)) is not None:
            # A closed surface that is cloth drawn with its thickness.
            mesh.keep(sheet.faces)
            mesh.notes.append(sheet.describe())
        _separate_touching_fans(mesh)
        mesh.drop_unused_vertices()
        kept_lines, off = renumber_lines(
            mesh.index, mesh.half_edges.edges, {key: place[path] for key, path in paths.items()}
        )
        mesh.notes += off
        if not closed:
            _require_border(mesh.half_edges)
        mesh.faces, mesh.origin, cut = split_quads(mesh.vertices, mesh.half_edges, mesh.origin, sliver_tolerance)
        for what, which in cut.items():
            mesh.notes.append(f"{format_count(len(which), 'quad')} {what} cut into triangles: {list_some(which)}")
        faces, of, kept_lines, merged, left = merge_degenerate_faces(
            mesh.vertices, mesh.half_edges, kept_lines, sliver_tolerance
        )
        if len(left):
            raise InputError(
                f"{format_count(len(left), 'degenerate face')} (narrower than {sliver_tolerance:g} of the edges around) cannot be "
                f"merged without changing the piece: {list_some(np.unique(mesh.origin[left]))} (counted from 0); delete or "
                "redraw them"
            )
        if len(merged):
            names, before = list_some(np.unique(mesh.origin[merged])), len(mesh.vertices)
            mesh.faces, mesh.origin = faces, mesh.origin[of]
            number = mesh.drop_unused_vertices()
            kept_lines = {key: number[line].tolist() for key, line in kept_lines.items()}
            mesh.notes.append(
                f"{format_count(len(merged), 'degenerate face')} (narrower than {sliver_tolerance:g} of the edges around) merged into "
                f"neighbours, {before - len(mesh.vertices)} of their vertices fell away: {names}"
            )
        return Surface(
            vertices=np.ascontiguousarray(mesh.vertices),
            faces=np.ascontiguousarray(mesh.faces, dtype=np.int32),
            lines={key: np.array(line, dtype=np.int32) for key, line in kept_lines.items() if len(line) > 1},
            name=name,
            input_vertices=positions,
            input_index=mesh.index.astype(np.int32),
            notes=tuple(mesh.notes),
        )
    except InputError as error:
        raise type(error)(f"{source or name}: {error}") from error


def parts_of_faces(vertices: ArrayLike, polygons: ArrayLike, *, weld: bool, notes: list[str] | None = None) -> IntArray:
    """Return the connected part of each polygon (#F), from 0 in their order; -1 for those that repair drops.

    Args:
        vertices, polygons: as :func:`make_surface`.
        weld: whether vertices at the same place are joined before.
        notes: gets a sentence for each repair that parts or drops faces.

    Raises:
        InputError: without the input's name, as :func:`make_surface`.
    """
    mesh = _checked_faces(check_positions(vertices), polygons)
    _weld(mesh, weld, split_corners=False, chosen=True)
    before = len(mesh.notes)
    _order_corners(mesh)
    _drop_double_faces(mesh)
    _part_sheets(mesh)
    if notes is not None:
        notes += mesh.notes[before:]
    part = np.full(len(np.asarray(polygons)), -1, dtype=np.int32)
    part[mesh.origin] = mesh.part
    return part


def check_positions(vertices: ArrayLike) -> FloatArray:
    """Return vertices as #V by 3 numbers.

    Raises:
        InputError: of another shape, not finite, or out of all bounds; names the vertex.
    """
    try:
        given = np.asarray(vertices)
        if np.iscomplexobj(given):
            raise TypeError("a place in space is of real numbers")
        positions = np.array(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError("vertices must be numbers, #V by 3") from error
    if positions.size == 0:
        raise InputError("there are no vertices")
    if positions.ndim != 2 or positions.shape[1] != 3:
        raise InputError(f"vertices must be #V by 3, got an array of shape {positions.shape}")
    bad = np.flatnonzero(~np.isfinite(positions).all(axis=1))
    if len(bad):
        x, y, z = positions[bad[0]].tolist()
        more = f" (and {len(bad) - 1:,} more like it)" if len(bad) > 1 else ""
        raise InputError(
            f"vertex {bad[0]} (counted from 0) is not finite: ({x:g}, {y:g}, {z:g}){more}; coordinates must be numbers"
        )
    far = int(np.argmax(np.abs(positions).max(axis=1)))
    if np.abs(positions[far]).max() > _LARGEST:
        x, y, z = positions[far].tolist()
        raise InputError(
            f"vertex {far} (counted from 0) lies at ({x:.3g}, {y:.3g}, {z:.3g}) m, too far to compute with; positions are in metres"
        )
    return positions


def _checked_faces(positions: FloatArray, polygons: ArrayLike | Sequence[Sequence[int]]) -> _Mesh:
    padded = pad_polygons(polygons)
    real = padded >= 0
    wrong = (padded < -1).any(axis=1)
    for column in range(padded.shape[1]):
        # The first three corners are there, and behind a gap there is none.
        wrong |= ~real[:, column] if column < 3 else real[:, column] & ~real[:, column - 1]
    gaps = np.flatnonzero(wrong)
    if len(gaps):
        raise InputError(f"face {gaps[0]} (counted from 0) has a negative vertex index or fewer than 3 corners")
    if padded.max() >= len(positions):
        row = np.flatnonzero((padded >= len(positions)).any(axis=1))[0]
        raise InputError(
            f"face {row} (counted from 0) refers to vertex {padded[row].max()}, but there are {len(positions):,} "
            f"vertices (0 to {len(positions) - 1})"
        )
    size = float(np.ptp(positions[_used_vertices(padded)], axis=0).max())
    if size < _SMALLEST:
        raise InputError(f"all vertices of faces lie within {size:.3g} m of each other; positions are in metres")
    notes: list[str] = []
    distinct, keep, lost = distinct_corners(padded)
    _note_repeated(notes, np.flatnonzero(~keep), np.flatnonzero(lost))
    rows = np.flatnonzero(keep)
    if len(rows) == 0:
        raise InputError("every face has repeated vertices: nothing remains")
    faces, of = split_polygons(positions, distinct[rows])
    many = len(np.unique(of[np.flatnonzero(of[1:] == of[:-1])]))
    if many:
        notes.append(f"{format_count(many, 'face')} of more than four corners cut into triangles")
    index = np.arange(len(positions), dtype=np.int32)
    return _Mesh(positions, faces, rows[of].astype(np.int32), index, notes)


def _note_repeated(notes: list[str], dropped: NDArray[np.integer], reduced: NDArray[np.integer]) -> None:
    if len(dropped):
        notes.append(f"{format_count(len(dropped), 'face')} with repeated vertices dropped: {list_some(dropped)}")
    if len(reduced):
        notes.append(f"{format_count(len(reduced), 'face')} with a doubled corner reduced by it: {list_some(reduced)}")


def _weld(mesh: _Mesh, weld: bool | None, split_corners: bool, chosen: bool) -> IntArray:
    """Join vertices at the same place if the user or the mesh asks for it; return #V, the vertex that each one became."""
    place, note = None, ""
    if weld is not False:
        parts = int(mesh.part.max()) + 1
        place, note = welding(
            mesh.vertices, mesh.faces, parts=parts, weld=weld, split_corners=split_corners, part_chosen=chosen
        )
    if note:
        mesh.notes.append(note)
    if place is None:
        return np.arange(len(mesh.vertices), dtype=np.int32)
    distinct, keep, lost = distinct_corners(np.where(mesh.faces >= 0, place[mesh.faces], -1))
    mesh.faces = distinct.astype(np.int32)
    _note_repeated(mesh.notes, mesh.origin[~keep], mesh.origin[lost])
    mesh.keep(keep)
    if len(mesh.faces) == 0:
        raise InputError("every face has repeated vertices once vertices at the same place are joined: nothing remains")
    return place


def _order_corners(mesh: _Mesh) -> None:
    """Cut quads with their corners in the right order whose sides cross, where the file goes from corner to corner in a wrong one.

    Another order is right if the quad shares more sides with other faces in it; of two such, the one in which its sides do not cross. A
    quad that is crossed in space alone is cut later.
    """
    he = mesh.half_edges
    alone = np.bincount(he.face[he.count[he.edge] == 1], minlength=len(mesh.faces))
    rows = np.flatnonzero((mesh.faces[:, 3] >= 0) & (alone >= 2))
    rows = rows[find_crossed_quads(mesh.vertices, mesh.faces[rows])]
    if len(rows) == 0:
        return
    orders = np.array([[0, 1, 2, 3], [0, 2, 1, 3], [0, 1, 3, 2]])
    quads = mesh.faces[rows][:, orders]
    # Each side as one number: lower vertex, higher vertex.
    digits = (len(mesh.vertices), 1)
    sides = np.sort(np.stack([quads, np.roll(quads, -1, axis=2)], axis=3), axis=3).astype(np.int64) @ digits
    known = he.edges.astype(np.int64) @ digits
    at = np.minimum(np.searchsorted(known, sides), len(known) - 1)
    own = (sides[..., None] == sides[:, :1, None]).any(axis=3)
    with_others = (np.where(known[at] == sides, he.count[at], 0) > own).sum(axis=2)
    straight = np.ones(with_others.shape, dtype=bool)
    for order in range(len(orders)):
        straight[find_crossed_quads(mesh.vertices, quads[:, order]), order] = False
    best = np.argmax(2 * with_others + straight, axis=1)
    wrong = with_others[np.arange(len(rows)), best] > with_others[:, 0]
    if wrong.any():
        cut, none = rows[wrong], np.full((int(wrong.sum()), 1), -1, dtype=np.int32)
        right = quads[wrong, best[wrong]]
        mesh.notes.append(
            f"{format_count(len(cut), 'quad')} with corners out of order, whose sides crossed, cut into triangles: "
            f"{list_some(mesh.origin[cut])}"
        )
        faces = mesh.faces.copy()
        faces[cut] = np.hstack([right[:, :3], none])
        mesh.faces = np.insert(faces, cut + 1, np.hstack([right[:, [0, 2, 3]], none]), axis=0)
        mesh.origin = np.insert(mesh.origin, cut + 1, mesh.origin[cut])


def _drop_double_faces(mesh: _Mesh) -> None:
    key = np.sort(mesh.faces, axis=1)
    # Faces with different hashes are different, and hardly any two that differ have the same.
    hashed = key.astype(np.uint64) @ _HASH
    hashed.sort()
    if not (hashed[1:] == hashed[:-1]).any():
        return
    _, first = np.unique(key, axis=0, return_index=True)
    if len(first) == len(mesh.faces):
        return
    keep = np.zeros(len(mesh.faces), dtype=bool)
    keep[first] = True
    mesh.notes.append(
        f"{mesh.describe(~keep)} dropped that had the vertices of another: {list_some(mesh.origin[~keep])}"
    )
    mesh.keep(keep)


def _drop_double_layers(mesh: _Mesh) -> None:
    """Drop parts that lie on another part everywhere, with vertices of their own, and inner sheets of thick cloth."""
    count = int(mesh.part.max()) + 1
    if count == 1:
        return
    from warpflat.flat.surface.repair.layers import Layer, surplus_layers

    layers = []
    for number in range(count):
        faces = mesh.faces[mesh.part == number]
        used, place = np.unique(faces, return_inverse=True)
        rows = place.reshape(faces.shape).astype(np.int32) - (used[0] < 0)
        with suppress(InputError):  # a one-sided part has no sides
            rows, _ = orient(rows)
        layers.append(Layer(mesh.vertices[used[used >= 0]], rows))
    surplus = surplus_layers(layers)
    if surplus:
        mesh.notes += surplus.values()
        mesh.keep(~np.isin(mesh.part, list(surplus)))


def _choose_component(mesh: _Mesh, component: int | Literal["largest"] | None) -> None:
    label = mesh.part
    sizes = np.bincount(label)
    # By area: a fine button, or a body, may have more faces than the cloth.
    area = np.bincount(label, flat_areas(mesh.vertices, mesh.faces))
    rank = np.argsort(-np.round(area, 9), kind="stable")
    valid = f'component = "largest" or a number from 0 to {len(sizes) - 1}, by area, largest first'
    if component is None:
        if len(sizes) > 1 and mesh.crowded:
            small = area < _FIN * area.sum()
            if small.sum() < len(area) - 1:
                raise InputError(
                    f"{mesh.crowded}; parted there, it falls into {len(sizes):,} sheets of {_sizes(sizes[rank])} faces: choose one with "
                    f'{valid}, or take all with component = "all"'
                )
            mesh.keep(~small[label])
            mesh.notes.append(
                f"{format_count(int(small.sum()), 'small sheet')} left out ({area_words(float(area[small].sum()))})"
            )
        elif len(sizes) > 1:
            if (meeting := t_junction(mesh.vertices, mesh.faces, label)) is not None:
                vertex, a, b = meeting
                raise InputError(
                    f"{len(sizes):,} components that share no edge, though they meet: vertices of one lie on edges of another (a "
                    f"T-junction: vertex {vertex} on the edge between {a} and {b}, counted from 0); give both the same vertices there, or "
                    f"choose one with {valid}"
                )
            raise InputError(
                f"{len(sizes):,} components that share no edge, of {_sizes(sizes[rank])} faces; a piece is one: choose "
                f'it with {valid}, or take all with component = "all" (in Python warpflat.read_pieces)'
            )
        return
    if component == "largest":
        component = 0
    if isinstance(component, bool) or not isinstance(component, (int, np.integer)) or not 0 <= component < len(sizes):
        raise InputError(f"component {component!r} does not exist: {_sizes(sizes[rank])} faces; valid: {valid}")
    if len(sizes) > 1:
        keep = label == rank[component]
        mesh.notes.append(f"component {component} of {len(sizes)} taken, {mesh.describe(~keep)} left out")
        mesh.keep(keep)


def _sizes(sizes: NDArray[np.int64]) -> str:
    shown = [f"{size:,}" for size in sizes[:6].tolist()]
    if len(sizes) > 6:
        return ", ".join(shown) + f", ... (and {len(sizes) - 6:,} smaller)"
    return " and ".join([", ".join(shown[:-1]), shown[-1]]) if len(shown) > 1 else shown[0]


def _part_sheets(mesh: _Mesh) -> None:
    """Part the surface into sheets where more than two faces meet, as at a fin or a pocket.

    Raises:
        InputError: so many meet at an edge that they are no cloth.
    """
    he = mesh.half_edges
    crowded = np.flatnonzero(he.count > 2)
    if len(crowded) == 0:
        return
    a, b = he.edges[crowded[0]].tolist()
    at = mesh.origin[he.face[he.edge == crowded[0]]]
    more = f" ({format_count(len(crowded) - 1, 'more edge')} like it)" if len(crowded) > 1 else ""
    mesh.crowded = (
        f"the edge between vertices {a} and {b} is not manifold: {len(at)} faces meet there ({list_some(at)}; counted "
        f"from 0){more}"
    )
    if he.count.max() > _MOST_SHEETS:
        raise InputError(
            f"{mesh.crowded}; cloth has at most two at an edge, and {_MOST_SHEETS} sheets at most are parted: delete the surplus faces"
        )
    faces, origin = part_sheets(mesh.vertices, he)
    before = int(mesh.part.max()) + 1
    mesh.faces, mesh.vertices, mesh.index = faces, mesh.vertices[origin], mesh.index[origin]
    # A narrow strip that was joined along both sides is a wall between two sheets of thick cloth, as where panels were glued rim to rim.
    parted = mesh.half_edges
    alone = parted.count[parted.edge] == 1
    sides = np.stack([parted.tail[alone], parted.head[alone]], axis=1)
    digits = (len(origin), 1)
    met = np.isin(np.sort(origin[sides], axis=1).astype(np.int64) @ digits, he.edges[crowded].astype(np.int64) @ digits)
    length, own = np.linalg.norm(np.diff(mesh.vertices[sides], axis=1)[:, 0], axis=1), mesh.part[parted.face[alone]]
    border, joined = (np.bincount(own, each, minlength=int(mesh.part.max()) + 1) for each in (length, length * met))
    area = np.bincount(mesh.part, flat_areas(mesh.vertices, faces))
    walls = (area <= 0.5 * THICKEST * border) & (joined >= _WALL * border) & (border > 0.0)
    left_out = ""
    if walls.any() and not walls.all():
        left_out = f", {format_count(int(walls.sum()), 'wall')} between sheets left out ({area_words(float(area[walls].sum()))})"
        mesh.keep(~walls[mesh.part])
    areas = np.sort(np.bincount(mesh.part, flat_areas(mesh.vertices, mesh.faces)))[::-1]
    off = [area_words(area) for area in areas[1 : 1 + max(len(areas) - before, 0)]]
    mesh.notes.append(
        f"{format_count(len(crowded), 'edge')} at which more than two faces meet: the sheets were parted there"
        + (f", {format_count(len(off), 'sheet')} came off ({', '.join(off[:4])})" if off else "")
        + left_out
    )


def _separate_touching_fans(mesh: _Mesh) -> None:
    """Give each fan of faces its own vertex where several touch in one point only."""
    he = mesh.half_edges
    tails = he.tail[he.count[he.edge] == 1]
    if len(np.unique(tails)) == len(tails) and euler_characteristic(he) == 2 - len(border_loops(he)):
        # With fans apart the characteristic would be greater, and no connected surface has a greater one.
        return
    faces, origin = part_fans(he, corner_fans(he), np.ones(len(mesh.vertices), dtype=bool))
    copies = origin[len(mesh.vertices) :]
    if len(copies) == 0:
        return
    mesh.faces, mesh.vertices, mesh.index = faces, mesh.vertices[origin], mesh.index[origin]
    mesh.notes.append(f"parts that touched only in a point were separated at vertices {list_some(np.unique(copies))}")


def _require_border(he: HalfEdges) -> None:
    """Refuse a surface without a border, or with a handle."""
    loops = border_loops(he)
    if not loops:
        raise ClosedSurfaceError(
            "the surface is closed (it has no border): cut the mesh open along a line, its vertices doubled "
            "there, or give the part that becomes one piece of cloth; [[cuts]] cut what is flat already"
        )
    handles = (2 - len(loops) - euler_characteristic(he)) // 2
    if handles:
        raise InputError(
            f"the surface has {format_count(handles, 'handle')} (a tunnel, as where a strap joins two openings): cut it "
            "through there, or give a part without"
        )


def _used_vertices(faces: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return the vertices that faces (filled up with -1) have, sorted."""
    return np.flatnonzero(np.bincount(faces.ravel() + 1)[1:])


def checked_line(name: str, line: ArrayLike, size: int) -> NDArray[np.int64]:
    """Return a line of a file of `size` vertices as an array.

    Raises:
        InputError: it is no row of its vertices.
    """
    check_label(name, "lines")
    path = np.asarray(line)
    if path.ndim != 1 or len(path) < 2 or not np.issubdtype(path.dtype, np.integer):
        raise InputError(f"line {quote_value(name)} must be a list of at least two vertex indices")
    wrong = path[(path < 0) | (path >= size)]
    if len(wrong):
        raise InputError(
            f"line {quote_value(name)} refers to vertex {wrong[0]}, but there are {size:,} (0 to {size - 1})"
        )
    return path.astype(np.int64)


def renumber_lines(
    index: IntArray, edges: IntArray, paths: Mapping[str, IntArray]
) -> tuple[dict[str, list[int]], list[str]]:
    """Return lines given in input rows, in the mesh's own vertices, and a note for each that is off it and left out.

    Args:
        index: #V, the input row of each vertex.
        edges: #E by 2, of the mesh.
        paths: input rows by name.

    Raises:
        InputError: a line leaves the mesh.
    """
    lines: dict[str, list[int]] = {}
    if not paths:
        return lines, []
    notes = []
    places: dict[int, list[int]] = {}
    wanted = np.isin(index, np.concatenate(list(paths.values())))
    for vertex in np.flatnonzero(wanted).tolist():
        places.setdefault(int(index[vertex]), []).append(vertex)
    joined = {tuple(edge) for edge in edges.tolist()}
    for name, path in paths.items():
        rows = [row for i, row in enumerate(path.tolist()) if i == 0 or row != path[i - 1]]
        if not any(row in places for row in rows):
            notes.append(f"line {quote_value(name)} does not lie on the piece and was left out")
            continue
        missing = [row for row in rows if row not in places]
        if missing:
            raise InputError(f"line {quote_value(name)} leaves the piece at vertex {missing[0]} (counted from 0)")
        line: list[int] = []
        for i, row in enumerate(rows):
            choice = places[row]
            if i > 0:
                choice = [v for v in choice if (min(v, line[-1]), max(v, line[-1])) in joined]
                if not choice:
                    raise InputError(
                        f"line {quote_value(name)} breaks between vertices {rows[i - 1]} and {row} (counted from 0): no edge there"
                    )
            elif len(choice) > 1 and len(rows) > 1:
                follow = places[rows[1]]
                choice = [v for v in choice if any((min(v, w), max(v, w)) in joined for w in follow)] or choice
            line.append(choice[0])
        lines[name] = line
    return lines, notes
