"""The two views of the page: the form with its lines on the left, the pattern on the right."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import warp as wp
from scipy.spatial.transform import Rotation
from trimesh import Trimesh

from warpflat.app.studio.frame import PieceFrame
from warpflat.app.studio.glb import coloured_mesh
from warpflat.app.studio.maps import MapScale, face_values, vertex_values
from warpflat.app.studio.pick import Hit, pick_flat, pick_on_rays
from warpflat.core import FloatArray, IntArray
from warpflat.flat import Surface, border_edges, triangulate, vertex_normals
from warpflat.garment import Body
from warpflat.pattern import rows_on_table

__all__ = ["Shown", "Stage"]

_INK, _THIN, _PICKED, _SKIN = (45, 45, 50), (110, 105, 105), (0, 90, 200), (205, 200, 194)
# Between form and pattern, between pieces, and of lines above the cloth [m].
_BETWEEN, _GAP, _ABOVE = 0.15, 0.07, 0.002
# Radius of a point that can be dragged [m].
_HANDLE = 0.009
# So much of the body is shown beyond the garment, to the sides, up and down, and to the front and the back [m].
_BEYOND = np.array([0.05, 0.12, 0.12])
_FOV = 0.35  # radians: a long lens, so that the pattern is hardly foreshortened
_ROOM = 1.12
# On a telephone's upright page, narrower than this [CSS pixels], viser lays its panel over the lower part, and leaves this share of the
# height free.
_NARROW, _UPRIGHT, _FREE = 480, 0.7, 0.4


@dataclass(frozen=True, kw_only=True, eq=False)
class Shown:
    """What is to be drawn of a piece.

    Attributes:
        frame: the piece.
        space: #P by 3, where its vertices are shown on the body [m].
        values: #P, of the map.
        lines: vertices of feature lines by name, in the frame's topology.
        grain_angle: of the warp against the pattern's upright [degrees].
    """

    frame: PieceFrame
    space: FloatArray
    values: FloatArray
    lines: Mapping[str, IntArray]
    grain_angle: float

    @classmethod
    def of_map(cls, frame: PieceFrame, kind: str, lines: Mapping[str, IntArray], grain_angle: float) -> Shown:
        """Return what is drawn of a map of strain or energy."""
        surface = frame.surface
        values = vertex_values(face_values(kind, frame), surface.vertices, surface.faces)
        return cls(frame=frame, space=surface.vertices, values=values, lines=lines, grain_angle=grain_angle)


class Stage:
    """Draws pieces into the scene of a viser server, and tells what a click there means."""

    def __init__(self, server: Any) -> None:
        self._scene, self._server = server.scene, server
        self._scene.set_up_direction("+y")
        self._scene.world_axes.visible = False
        self._form = self._scene.add_frame("/form", show_axes=False)
        self._pattern = self._scene.add_frame("/pattern", show_axes=False)
        self._turn = np.eye(3)
        self._corners: dict[str, FloatArray] = {}
        self._boxes = np.zeros((2, 2, 3))  # form and pattern: low and high
        self._pieces: dict[str, Shown] = {}
        self._nodes: dict[str, Any] = {}
        self._sides: dict[int, float] = {}
        self._handles: dict[str, Any] = {}

    @property
    def form_position(self) -> FloatArray:
        """Where the form stands, 3 [m]."""
        return np.asarray(self._form.position)

    def lay_out(self, pieces: Mapping[str, Shown]) -> None:
        """Choose the places of pieces on the table, and of form and pattern beside each other."""
        sizes = np.array([np.ptp(piece.frame.positions, axis=0) for piece in pieces.values()])
        for (name, piece), corner in zip(pieces.items(), rows_on_table(sizes, _GAP), strict=True):
            self._corners[name] = corner - piece.frame.positions.min(axis=0)
        self._corners = {name: self._corners[name] for name in pieces}
        space = np.concatenate([piece.space for piece in pieces.values()])
        flat = np.concatenate([self._flat(name, piece) for name, piece in pieces.items()])
        self._boxes = np.array([[points.min(axis=0), points.max(axis=0)] for points in (space, flat)])
        self._place()

    def draw(self, pieces: Mapping[str, Shown], scale: MapScale, *, tentative: bool = False) -> None:
        """Draw pieces in the colours of a map.

        Args:
            pieces: by name; all of them.
            scale: of the map.
            tentative: whether a cut is only tried, so that outlines have its colour.
        """
        if set(pieces) != set(self._corners):
            self.lay_out(pieces)
        self._pieces = dict(pieces)
        space, flat, triangles, colours = [], [], [], []
        edges, grains = list[FloatArray](), list[FloatArray]()
        count = 0
        for name, piece in pieces.items():
            corners, _ = triangulate(piece.frame.surface.faces)
            triangles.append(corners + count)
            space.append(piece.space)
            flat.append(self._flat(name, piece))
            colours.append(scale.rgb(piece.values))
            edges.append(flat[-1][border_edges(piece.frame.surface.faces)])
            count += len(piece.space)
            # An arrow along the warp in the middle of the piece. Warp runs along +y, turned counter-clockwise.
            middle, size = 0.5 * (flat[-1].min(axis=0) + flat[-1].max(axis=0)), np.ptp(flat[-1], axis=0)
            angle = np.radians(piece.grain_angle)
            along = np.array([-np.sin(angle), np.cos(angle), 0.0])
            across = np.array([np.cos(angle), np.sin(angle), 0.0])
            reach, barb = 0.18 * float(size[:2].min()), 0.04 * float(size[:2].min())
            arrow = [[-reach * along, reach * along]]
            for end in (1.0, -1.0):
                tip = end * reach * along
                arrow += [[tip, tip - end * barb * along + side * 0.5 * barb * across] for side in (1.0, -1.0)]
            grains.append(np.array(arrow) + middle + [0.0, 0.0, 2.0 * _ABOVE])
        shared = np.concatenate(triangles), np.concatenate(colours)
        with self._server.atomic():
            self._mesh("/form/cloth", np.concatenate(space), *shared, lit=True)
            self._mesh("/pattern/cloth", np.concatenate(flat), *shared, lit=False)
            outline = np.concatenate(edges) + np.array([0.0, 0.0, _ABOVE])
            self._segments("/pattern/outline", outline, _PICKED if tentative else _INK, 2.5)
            self._segments("/pattern/lines", _joined(self._line_pairs(pieces, self._flat)), _THIN, 1.0)
            # Lines lie a little above the cloth, so that they are seen.
            lifted = self._line_pairs(pieces, lambda _, piece: _above(piece.space, piece.frame.surface.faces, _ABOVE))
            self._segments("/form/lines", _joined(lifted), _INK, 1.5)
            self._segments("/pattern/grain", _joined(grains), _INK, 2.0)

    def write_names(self, names: Mapping[str, str]) -> None:
        """Write each piece's name below its pattern, and a bar of ten centimetres at the end of the table.

        Args:
            names: what is written for each piece.
        """
        for name in [node for node in self._nodes if node.startswith("/pattern/name")]:
            self._nodes.pop(name).remove()
        for number, (name, words) in enumerate(names.items()):
            flat = self._flat(name, self._pieces[name])
            low, high = flat.min(axis=0), flat.max(axis=0)
            node = f"/pattern/name{number}"
            self._nodes[node] = self._scene.add_label(
                node, words, position=(0.5 * (low[0] + high[0]), low[1] - 0.008, 0.0), anchor="top-center",
                font_screen_scale=0.9,
            )  # fmt: skip
        low, high = self._boxes[1]
        # Far enough below the names on a narrow page, where letters are large beside the pattern.
        x, y = low[0], low[1] - 0.12
        bar = np.array([[(x, y), (x + 0.1, y)], *([(at, y - 0.008), (at, y + 0.008)] for at in (x, x + 0.05, x + 0.1))])
        self._segments("/pattern/bar", np.concatenate([bar, np.zeros((4, 2, 1))], axis=2), _THIN, 2.0)
        node = "/pattern/name_bar"
        self._nodes[node] = self._scene.add_label(
            node, "10 cm", position=(x + 0.11, y, 0.0), anchor="center-left", font_screen_scale=0.9
        )

    def draw_body(self, body: Surface | None) -> None:
        """Draw the body around the garment; None takes it away."""
        old = self._nodes.pop("/form/body", None)
        if old is not None:
            old.remove()
        if body is None:
            return
        low, high = self._boxes[0] + [-_BEYOND, _BEYOND]
        shown = Body(body.vertices, body.faces, device=wp.get_device("cpu"))
        near = Trimesh(shown.shrunk, shown.triangles, process=False)
        for origin, normals in ((low, np.eye(3)), (high, -np.eye(3))):
            near = near.slice_plane(np.tile(origin, (3, 1)), normals)
        self._nodes["/form/body"] = self._scene.add_mesh_simple(
            "/form/body", near.vertices.astype(np.float32), near.faces, color=_SKIN, side="double",
            cast_shadow=False, receive_shadow=False,
        )  # fmt: skip

    def mark(self, line: tuple[Surface, IntArray] | None, points: Iterable[Hit] = ()) -> None:
        """Mark what is picked: the vertices of a line of a surface, and points."""
        rows = np.zeros((0, 2, 3))
        if line is not None:
            above = _above(line[0].vertices, line[0].faces, 1.5 * _ABOVE)[line[1]]
            rows = np.stack([above[:-1], above[1:]], axis=1)
        self._segments("/form/picked", rows, _PICKED, 5.0)
        for node in [node for node in self._nodes if node.startswith("/form/point")]:
            self._nodes.pop(node).remove()
        for number, hit in enumerate(points):
            node = f"/form/point{number}"
            self._nodes[node] = self._scene.add_icosphere(node, radius=0.008, color=_PICKED, position=hit.point)

    def show_handles(self, handles: Mapping[str, tuple[str, FloatArray]], on_drag: Callable[[str, Any], Any]) -> None:
        """Show points that can be dragged; those of the same names only move, so that a drag goes on.

        Args:
            handles: by name, the piece and the place in its pattern, 2 [m].
            on_drag: a coroutine function, called with the name and viser's event.
        """
        if list(handles) != list(self._handles):
            for node in self._handles.values():
                node.remove()
            self._handles = {
                name: self._scene.add_icosphere(
                    f"/pattern/handle{number}", radius=_HANDLE, color=_PICKED, subdivisions=2
                )
                for number, name in enumerate(handles)
            }
            for name, node in self._handles.items():
                node.on_drag(partial(on_drag, name))
        for name, (piece, place) in handles.items():
            self._handles[name].position = (*(place + self._corners[piece]).tolist(), _ABOVE)

    def on_table(self, piece: str, point: Sequence[float]) -> FloatArray:
        """Return where a point of the scene lies in a piece's pattern, 2 [m]."""
        local = (np.asarray(point, dtype=float) - np.asarray(self._pattern.position)) @ self._turn
        return np.asarray(local[:2] - self._corners[piece])

    def pick(self, origin: Sequence[float], direction: Sequence[float]) -> Hit | None:
        """Return the place of a piece that a ray from the eye meets, on the form or in the pattern."""
        start, ray = np.asarray(origin, dtype=float), np.asarray(direction, dtype=float)
        hit = pick_on_rays(
            start - np.asarray(self._form.position),
            ray,
            {name: (piece.space, piece.frame.surface.faces) for name, piece in self._pieces.items()},
        )
        local, along = (start - np.asarray(self._pattern.position)) @ self._turn, ray @ self._turn
        if hit is None and abs(along[2]) > 1e-9:
            place = (local - local[2] / along[2] * along)[:2]
            hit = pick_flat(place, {name: self._flat(name, piece)[:, :2] for name, piece in self._pieces.items()})
        if hit is None:
            return None
        x, y, z = self._pieces[hit[0]].frame.surface.vertices[hit[1]].tolist()
        return Hit(piece=hit[0], point=(x, y, z))

    def face(self, wxyz: Sequence[float]) -> None:
        """Turn the pattern towards a camera, and keep form and pattern side by side before it.

        Dragging then turns the form on its stand; the pattern stays in the plane of the screen.
        """
        w, x, y, z = wxyz
        columns = Rotation.from_quat([x, y, z, w]).as_matrix()
        # A camera looks along its z axis, and its y axis points down.
        turn = columns * [1.0, -1.0, -1.0]
        if not np.allclose(turn, self._turn, atol=1e-5):
            self._turn = turn
            self._place()

    def show_all(self, client: Any, side: float | None = None) -> None:
        """Move a client's camera so that form and pattern fill its window, or what the panel leaves free of it.

        Args:
            client: of the server.
            side: from where the form is seen: 0 the front, 90 its left side, 180 the back [degrees]; as before if not given.
        """
        side = self._sides.setdefault(client.client_id, 0.0) if side is None else side
        self._sides[client.client_id] = side
        width, height = self.size
        aspect = client.camera.aspect or 1.5
        half = np.tan(0.5 * _FOV)
        free = _FREE if client.camera.image_width < _NARROW and aspect < _UPRIGHT else 1.0
        away = _ROOM * max(0.5 * height / (half * free), 0.5 * width / (half * aspect))
        low = (free - 1.0) * half * away
        angle = np.radians(side)
        # A page that is closed in this moment is none to be warned of.
        with client.atomic(), client._websock_connection.get_message_buffer().sanctioned_dead_writes():
            client.camera.fov = _FOV
            client.camera.up_direction = (0.0, 1.0, 0.0)
            # Moving a camera moves what it looks at along with it.
            client.camera.position = (away * np.sin(angle), low, away * np.cos(angle))
            client.camera.look_at = (0.0, low, 0.0)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of form and pattern together, however the form is turned [m]."""
        form, pattern = np.ptp(self._boxes, axis=1)
        across = float(np.hypot(form[0], form[2]))
        return across + _BETWEEN + float(pattern[0]), max(float(form[1]), float(pattern[1]) + 0.14)

    def _place(self) -> None:
        """Set form and pattern beside each other, about the origin."""
        width, _ = self.size
        middle, half = self._boxes.mean(axis=1), 0.5 * np.ptp(self._boxes, axis=1)
        right, up = self._turn[:, 0], self._turn[:, 1]
        pattern = float(half[1][0])
        across = width - _BETWEEN - 2.0 * pattern
        self._form.position = right * (0.5 * across - 0.5 * width) - middle[0]
        self._pattern.position = right * (0.5 * width - pattern - middle[1][0]) - up * (middle[1][1] - 0.03)
        x, y, z, w = Rotation.from_matrix(self._turn).as_quat().tolist()
        self._pattern.wxyz = (w, x, y, z)

    def _flat(self, name: str, piece: Shown) -> FloatArray:
        """Return the pattern of a piece at its place on the table, #P by 3 [m]."""
        place = piece.frame.positions + self._corners[name]
        return np.column_stack([place, np.zeros(len(place))])

    def _line_pairs(self, pieces: Mapping[str, Shown], places: Any) -> Iterable[FloatArray]:
        for name, piece in pieces.items():
            at = places(name, piece)
            for ids in piece.lines.values():
                row = at[ids] + [0.0, 0.0, 0.5 * _ABOVE if places == self._flat else 0.0]
                yield np.stack([row[:-1], row[1:]], axis=1)

    def _mesh(self, node: str, vertices: FloatArray, triangles: IntArray, colours: FloatArray, *, lit: bool) -> None:
        data = coloured_mesh(vertices, triangles, colours, lit=lit)
        if node in self._nodes:
            self._nodes[node].glb_data = data
        else:
            self._nodes[node] = self._scene.add_glb(node, data, cast_shadow=False, receive_shadow=False)

    def _segments(self, node: str, rows: FloatArray, colour: tuple[int, int, int], thickness: float) -> None:
        old = self._nodes.pop(node, None)
        if old is not None and len(rows) == 0:
            old.remove()
        if len(rows):
            self._nodes[node] = self._scene.add_line_segments(
                node, rows.astype(np.float32), colour, thickness=thickness, thickness_units="screen"
            )


def _joined(parts: Iterable[FloatArray]) -> FloatArray:
    rows = list(parts)
    return np.concatenate(rows) if rows else np.zeros((0, 2, 3))


def _above(vertices: FloatArray, faces: IntArray, height: float) -> FloatArray:
    triangles, _ = triangulate(faces)
    normals = vertex_normals(vertices, triangles)
    return np.asarray(vertices + height * normals)
