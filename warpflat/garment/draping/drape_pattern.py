"""A pattern from outside is meshed, put around a body by its seams, and draped there."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import shapely
import warp as wp

from warpflat.core import (
    AXES,
    FloatArray,
    InputError,
    StepError,
    nearest,
    polyline_length,
    reflected,
    short_repr,
    start_warp,
)
from warpflat.flat import Fabric, Surface, triangulate, vertex_normals
from warpflat.garment.construction.form_garment import FormGarment
from warpflat.garment.construction.mirror import mirror_plane
from warpflat.garment.draping.body import Body
from warpflat.garment.draping.check_sewn import check_sewn
from warpflat.garment.draping.continue_pieces import continue_pieces, hang_from_edges, hood_beside_head
from warpflat.garment.draping.drape_garment import come_to_rest, line_height, thread_elastics
from warpflat.garment.draping.lay_around import Laid, lay_around
from warpflat.garment.draping.lift import Lift, surface_lift, whole_lifts
from warpflat.garment.draping.limbs import armpit_heights, limb_lines, on_arm
from warpflat.garment.draping.mesh_pieces import FlatMesh, MeshedPieces, mesh_pieces, sew_meshes
from warpflat.garment.draping.openings import Opening, find_openings
from warpflat.garment.draping.options import DrapeOptions
from warpflat.garment.draping.result import Drape
from warpflat.garment.draping.sew_around import sew_around
from warpflat.garment.draping.sewn_cloth import SewnCloth, worn_surface
from warpflat.garment.draping.thin_body import ThinBody, draw_out_limbs
from warpflat.garment.draping.worn_layer import closures, in_one_layer, right_side_out, turned_down
from warpflat.garment.mannequin.head import head_of
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.pattern import MIRRORED, Edge, Pattern, Piece, Seam, SeamSide, is_flounce, whole_pieces

__all__ = ["Placement", "drape_pattern", "lay_pieces", "place_drafted"]

# Where a file's units stand.
_UNITS = (
    "are its units right (in DXF the text UNITS or $INSUNITS, in SVG width and viewBox, in GarmentCode units_in_meter)?"
)
# The largest piece of a garment is between so short and so long [m].
_SIZES = (0.05, 10.0)
# A designed surface does not belong to a body where more than this share of it lies so deep [m] within.
_WITHIN, _DEEP = 0.05, 0.01
# Nor where its top, from this share of its vertices on, lies so far [m] off, or less than this share of it looks as the skin does.
_TOP, _OFF, _ALIKE = 0.9, 0.05, 0.75
# Pieces are sewn on a mesh of this spacing at least [m]. Cloth around less than this share of the body's waist is no garment for it.
_COARSE, _LEAST_GIRTH = 0.02, 0.5
# Where a piece lies that is said, or named, to be there.
_LOOKS = {"front": AXES["+z"], "back": AXES["-z"], "left arm": AXES["+x"], "right arm": AXES["-x"]}
# What is sewn to less than this share of its length is gathered or pleated. A patch lies this far over its piece [m].
_FULL, _ON_TOP = 0.85, 0.0015
# A flounce stands out by this share of its length, and what is gathered or pleated by this one.
_FLOUNCE_FLARES, _GATHERS_FLARE = 0.4, 0.1
# The halves of a hood start this far beside the head [m].
_BESIDE_HEAD = 0.01


@dataclass(frozen=True, kw_only=True)
class Placement:
    """Where the pieces of a pattern go, and how they are meshed.

    Attributes:
        top: a level of the body or a height [m] for the highest point of what does not hang from the shoulders.
        lifts: by piece the map to its designed surface, where there is one; it must be there for all of them or for none.
        size: of the pattern; its sample size if not given.
        spacing: wished edge of the mesh [m].
        hold: edges that stay where they are, as "piece.edge", or "edge" for every piece that has one.
    """

    __repr__ = short_repr

    top: str | float | None = None
    lifts: Mapping[str, Lift] = field(default_factory=dict)
    size: str | None = None
    spacing: float = 0.01
    hold: Sequence[str] = ()


def drape_pattern(
    pattern: Pattern,
    body: Mannequin | None,
    *,
    fabric: Fabric,
    placement: Placement | None = None,
    options: DrapeOptions | None = None,
    callback: Callable[[int, float], None] | None = None,
    device: str | None = None,
) -> tuple[Drape, list[str]]:
    """Sew a pattern of outlines, put it on a body, and let it come to rest there.

    Without a designed surface the worn cloth is compared with the body.

    Args:
        pattern: pieces and their seams.
        body: a mannequin, of a size or on a scan; None for the designed surface itself.
        fabric: of all pieces.
        placement: where the pieces go, and how finely they are meshed.
        options: friction, tolerance and limits.
        callback: called with the number of steps and the residual now and then.
        device: Warp device.

    Returns:
        The drape, and notes.

    Raises:
        InputError: the pattern has no seams, no such size or wrong units, a piece cannot be meshed or placed, an edge is unknown,
            or nothing holds the garment.
    """
    placement, options = placement or Placement(), options or DrapeOptions()
    chosen = pattern.sample if placement.size is None else placement.size
    pattern.piece(next(iter(pattern.pieces.values()))[0].name, chosen)
    pieces, seams, notes = whole_pieces(pattern.pieces[chosen], pattern.seams)
    pieces, seams, layers = in_one_layer(pieces, seams, placement.lifts)
    pieces, seams, turned = right_side_out(pieces, seams, placement.lifts)
    notes += layers
    if not pattern.seams:
        raise InputError(
            f"pattern {pattern.name!r} has no seams; name them in a file of [[seams]] and give --seams FILE"
        )
    if not pieces:
        raise InputError(f"pattern {pattern.name!r}: nothing of it is draped: {'; '.join(layers)}")
    # A garment of an impossible size comes from a file whose units are wrong.
    sizes = {name: np.ptp(piece.outline, axis=0) for name, piece in pieces.items()}
    name = max(sizes, key=lambda each: float(sizes[each].max()))
    wide, high = sizes[name]
    if not _SIZES[0] <= max(wide, high) <= _SIZES[1]:
        raise InputError(
            f"piece {name!r}, the largest, is {1e3 * wide:.1f} by {1e3 * high:.1f} mm; it must be between {1e3 * _SIZES[0]:.0f} "
            f"and {1e3 * _SIZES[1]:.0f} mm long: {_UNITS}"
        )
    meshed = mesh_pieces(pieces, seams, placement.spacing)
    meshes = meshed.meshes
    start_warp()
    where = wp.get_device(device)
    lifts = whole_lifts(pattern.pieces[chosen], placement.lifts)
    solid = None if body is None else _worn_body(body, pieces, device=where)
    # On another body than that of its designed surface a garment starts as one that has none, if it can.
    placed = _where_designed(meshed, lifts)
    lifted = len(placed) == len(meshes) or bool(placed and body is not None)
    elsewhere = _elsewhere(placed, meshes, solid) if lifted and solid is not None else ""
    if not lifted and body is None:
        raise InputError(f'pattern {pattern.name!r} has no designed surface; name a body: --body "EU 38"')
    if body is not None and (not lifted or elsewhere):
        try:
            solid, lifts = _sew(pieces, seams, body, placement, fabric, turned, where)
        except InputError:
            if not lifted:
                raise
        else:
            if lifted:
                notes.append(f"{elsewhere}: the pieces are placed by their seams")
            lifted, placed = False, {name: lifts[name](mesh.points) for name, mesh in meshes.items()}
    drafted = [name for name in meshes if name not in placed]
    placed = _continued(placed, meshed, body)
    cloth = sew_meshes(meshed, fabric, placed, turned=turned)
    solid = Body(cloth.designed, cloth.faces, device=where) if solid is None else solid
    if not lifted or drafted:
        cloth = _sewn_to(cloth, set(meshes) - set(drafted) if lifted else (), solid)
    threaded = sorted({elastic.edge for elastic in pattern.elastics})
    cloth, gripped = thread_elastics(cloth, threaded, solid)
    if gripped:
        notes.append(f"held by an elastic: {', '.join(threaded)}")
    worn, frames = come_to_rest(cloth, solid, [*placement.hold, *gripped], options, callback, body)
    designed = solid
    if not lifted:
        # What it should lie on is the body below it.
        cloth = replace(cloth, designed=solid.nearest(worn.positions)[0])
    elif body is not None:
        designed = Body(cloth.designed, cloth.faces, device=where)
    return Drape(
        cloth=cloth,
        worn=worn,
        body=solid,
        designed=designed,
        options=options,
        frames=frames,
        drafted=drafted,
        hangs_below=line_height(body, "hip"),
        threaded=gripped,
    ), notes


def place_drafted(pattern: Pattern, garment: FormGarment) -> dict[str, list[Surface]]:
    """Return what of a pattern has no designed surface, such as collars and flounces, where it is worn: sewn to the rest, not draped.

    Args:
        pattern: of the garment; its sample size is placed.
        garment: flattened, on its body.

    Returns:
        By piece its copies; none of what lies within the garment, such as a facing.

    Raises:
        InputError: a piece cannot be meshed, or hangs together with none that has a designed surface.
    """
    lifts = {
        name: surface_lift(flat.surface.vertices[flat.vertex_origin], flat.positions, triangulate(flat.faces)[0])
        for name, flat in garment.pieces.items()
    }
    body, fabric = garment.mannequin, next(iter(garment.pieces.values())).fabric
    given = pattern.pieces[pattern.sample]
    pieces, seams, _ = whole_pieces(given, pattern.seams)
    pieces, seams, _ = in_one_layer(pieces, seams, lifts)
    pieces, seams, turned = right_side_out(pieces, seams, lifts)
    whole, found = whole_lifts(given, lifts), dict[str, list[Surface]]()
    for name, piece in pieces.items():
        # Patches and welts, on what they are sewn to.
        titles = [f"{name.removesuffix(MIRRORED)}_pocket{kind}" for kind in ("", "_welt")]
        title = next((each.name for each in given if each.name in titles), "")
        outlines = [line for line_name, line in piece.internal_lines.items() if line_name.startswith("pocket")]
        for ring in shapely.get_parts(shapely.line_merge(shapely.MultiLineString(outlines))) if title else ():
            corners = shapely.orient_polygons(shapely.Polygon(ring)).exterior.coords
            sides = [Edge(name=str(k), points=np.array(side)) for k, side in enumerate(pairwise(corners))]
            patch = mesh_pieces({title: Piece(name=title, edges=sides)}, [], _COARSE).meshes[title]
            at = whole[name](patch.points)
            at = at + _ON_TOP * vertex_normals(at, patch.triangles)
            copies = found.setdefault(title, [])
            copies.append(worn_surface(f"{title} {len(copies) + 1}", at, patch.triangles))
    drafted = [name for name in pieces if name not in whole]
    if not drafted:
        return found
    meshed = mesh_pieces(pieces, seams, _COARSE)
    meshes = meshed.meshes
    start_warp()
    solid = _worn_body(body, pieces, device=wp.get_device("cpu"))
    placed = _where_designed(meshed, whole)
    falling = {name: _FLOUNCE_FLARES for name in drafted if is_flounce(pieces[name])}
    falling |= {
        side.piece: _GATHERS_FLARE
        for seam in seams
        for long, short in (seam.sides, seam.sides[::-1])
        for side in long
        if side.piece in drafted and _length(pieces, short) < _FULL * _length(pieces, long)
    }
    placed |= hang_from_edges(placed, meshed, falling)
    placed = _continued(placed, meshed, body)
    cloth = sew_meshes(meshed, fabric, placed, turned=turned)
    # The body wears what is designed: a collar that is turned down lies on it.
    vertices, faces = [solid.vertices], [solid.triangles]
    for name in (name for name in meshes if name in whole):
        triangles, count = meshes[name].triangles, sum(map(len, vertices))
        outward = float((vertex_normals(placed[name], triangles) * solid.nearest(placed[name])[1]).sum())
        faces.append(count + (triangles if outward > 0.0 else triangles[:, ::-1]))
        vertices.append(placed[name])
    dressed = Body(np.concatenate(vertices), np.concatenate(faces), device=solid.device)
    cloth = _sewn_to(cloth, {*meshes} - {*drafted} | {*falling}, dressed)
    for name in drafted:
        title = next(each.name for each in given if name == each.name or name.startswith(each.name + " "))
        points = cloth.designed[cloth.welded[cloth.piece_vertices[name]]]
        found.setdefault(title, []).append(worn_surface(name, points, meshes[name].triangles))
    return found


def _length(pieces: Mapping[str, Piece], row: Sequence[SeamSide]) -> float:
    return sum(pieces[side.piece].edge(side.edge).length for side in row)


def _sewn_to(cloth: SewnCloth, stay: Collection[str], body: Body) -> SewnCloth:
    """Return cloth drawn together around a body; the pieces that are named stay where they are."""
    stays = np.zeros(len(cloth.designed), dtype=bool)
    for name in stay:
        stays[cloth.welded[cloth.piece_vertices[name]]] = True
    return replace(cloth, designed=sew_around(cloth, cloth.designed, body, fixed=stays))


def _worn_body(body: Mannequin, pieces: Mapping[str, Piece], *, hooded: bool = False, device: wp.Device) -> Body:
    """Return the body that pieces are worn on: its limbs run on beyond their ends, below a hood with a head, if that is known.

    What has the openings of a hood is one, too, whatever its pieces are called.
    """
    surface = body.surface()
    vertices, faces = draw_out_limbs(surface.vertices, surface.faces)
    above = head_of(body) if hooded or any(piece.role == "hood" for piece in pieces.values()) else None
    if above is not None:
        faces = np.concatenate([triangulate(faces)[0], above[1] + len(vertices)])
        vertices = np.concatenate([vertices, above[0]])
    return Body(vertices, faces, device=device)


def _sew(
    pieces: Mapping[str, Piece],
    seams: Sequence[Seam],
    body: Mannequin,
    placement: Placement,
    fabric: Fabric,
    turned: frozenset[str],
    device: wp.Device,
) -> tuple[Body, dict[str, Lift]]:
    """Sew pieces around a body on a coarse mesh; return the body, and by piece the map to where it lies.

    Raises:
        InputError: a piece cannot be meshed or placed, or was sewn beside its limb.
    """
    spacing = max(placement.spacing, _COARSE)
    try:
        meshed = mesh_pieces(pieces, seams, spacing)
    except InputError:
        meshed = mesh_pieces(pieces, seams, placement.spacing)
    cloth = sew_meshes(meshed, fabric, turned=turned)
    buttons, lines = closures(pieces), limb_lines(body)
    openings = find_openings(cloth, meshed.welds[-1] if buttons else ())
    girth = polyline_length(body.line("waist"), closed=True)
    around = max((each.length for each in openings), default=np.inf)
    if around < _LEAST_GIRTH * girth:
        raise InputError(
            f"the pattern goes {1e3 * around:.0f} mm around the body, whose waist has {1e3 * girth:.0f} mm: {_UNITS} Is a piece missing?"
        )
    armpit, refused = min(armpit_heights(body).values()), list[StepError]()
    while True:
        # What is sewn wrong as it hangs from the shoulders may come right as it hangs from the collar: tops far too wide for a body do.
        laid = lay_pieces(cloth, meshed, openings, body, top=placement.top, on_shoulders=not refused)
        start, limbs = laid.positions, laid.limbs
        solid = _worn_body(body, pieces, hooded=laid.hooded, device=device)
        # What begins below the arms passes through.
        below = np.zeros(len(start), dtype=bool)
        for rows in cloth.piece_vertices.values():
            below[cloth.welded[rows]] |= start[cloth.welded[rows], 1].max() < armpit
        thin = ThinBody(solid, on_arm(solid.vertices, lines), below)
        arms = [(each.vertices, lines[limb]) for each, limb in zip(openings, limbs, strict=True) if limb[-3:] == "arm"]
        sewn = sew_around(cloth, start, thin, level=laid.level, rings=arms)
        try:
            check_sewn(cloth, sewn, openings, limbs, lines, buttoned=bool(buttons))
            break
        except StepError as error:
            if refused or laid.hooded or laid.level.all():
                raise (refused or [error])[0] from None
            refused.append(error)
    lifts = {
        name: surface_lift(sewn[cloth.welded[cloth.piece_vertices[name]]], mesh.points, mesh.triangles)
        for name, mesh in meshed.meshes.items()
    }
    return solid, lifts


def _continued(placed: Mapping[str, FloatArray], meshed: MeshedPieces, body: Mannequin | None) -> dict[str, FloatArray]:
    """Return the places of all pieces: a hood is worn up, beside a head; what else does not lie goes on from what it is sewn to."""
    hood = {name for name, piece in meshed.pieces.items() if piece.role == "hood"}
    head = head_of(body) if body is not None and hood else None
    found = dict(placed)
    if head is not None:
        halves = hood_beside_head(placed, meshed, hood, float(np.abs(head[0][:, 0]).max()) + _BESIDE_HEAD)
        found = {name: points for name, points in placed.items() if name not in hood} | halves
    return continue_pieces(found, meshed, turned_down(meshed.pieces))


def _where_designed(meshed: MeshedPieces, lifts: Mapping[str, Lift]) -> dict[str, FloatArray]:
    """Return the places (#P by 3 [m] by piece) of pieces that have a designed surface.

    What is cut turned over lies on the other side of the garment's own plane of symmetry. A garment may stand beside x = 0 and lean: its
    plane is that in which pieces turned over come to the seams of the others.
    """
    placed = {name: lifts[name](mesh.points) for name, mesh in meshed.meshes.items() if name in lifts}
    across = np.array([-1.0, 1.0, 1.0])
    met = [
        (placed[turned][i] * across, placed[other][j])
        for seam in meshed.welds
        for joint in seam
        for turned, i in joint
        for other, j in joint
        if turned.endswith(MIRRORED) and not other.endswith(MIRRORED) and {turned, other} <= placed.keys()
    ]
    if not met:
        return placed
    normal, off = mirror_plane(*np.array(met).transpose(1, 0, 2))
    return {
        name: reflected(points * across, normal, off) if name.endswith(MIRRORED) else points
        for name, points in placed.items()
    }


def _elsewhere(placed: Mapping[str, FloatArray], meshes: Mapping[str, FlatMesh], body: Body) -> str:
    """Return in words why a designed surface (#P by 3 [m] by piece) is not worn by a body; "" if it may be.

    What is worn lies outside, looks as the skin below it does, and touches where it hangs, at its top.
    """
    points = np.concatenate(list(placed.values()))
    gap = body.gaps(points)
    deep = float((gap < -_DEEP).mean())
    if deep > _WITHIN:
        return f"{100 * deep:.0f} % of the designed surface lies in this body"
    off = float(np.median(gap[points[:, 1] >= np.quantile(points[:, 1], _TOP)]))
    corner = np.concatenate([points[meshes[name].triangles] for name, points in placed.items()])
    vector = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    facing = np.einsum("ta,ta->t", vector, body.nearest(corner.mean(axis=1))[1])
    alike = float(np.linalg.norm(vector[facing > 0.0], axis=1).sum() / np.linalg.norm(vector, axis=1).sum())
    if off > _OFF or max(alike, 1.0 - alike) < _ALIKE:
        return f"the designed surface lies beside this body, its top {100 * off:.0f} cm off"
    return ""


def lay_pieces(
    cloth: SewnCloth,
    meshed: MeshedPieces,
    openings: Sequence[Opening],
    body: Mannequin,
    *,
    top: str | float | None = None,
    on_shoulders: bool = True,
) -> Laid:
    """Return how sewn pieces are laid around a body: see `lay_around`.

    What lies in front and high is told by the places of a file, else by `at`, names, and how pieces are drawn.

    Raises:
        InputError: as there, or the level `top` is unknown.
    """
    pieces, meshes, _ = meshed
    heights = {name: level.height for name, level in body.levels().items()}
    if isinstance(top, str) and top not in heights:
        raise InputError(f"top: level {top!r} is unknown: {nearest(top, heights)}")
    hung = {
        name: np.column_stack([mesh.points, np.ones(len(mesh.points))]) @ place.T
        for name, mesh in meshes.items()
        if (place := pieces[name].placement) is not None
    }
    is_hung = len(hung) == len(meshes)
    everything = np.concatenate([*hung.values(), np.zeros((0, 3))]) if is_hung else np.zeros((1, 3))
    middle = 0.5 * (everything.min(axis=0) + everything.max(axis=0))
    up, hints = np.zeros(len(cloth.designed)), np.zeros((len(cloth.designed), 3))
    for name, rows in cloth.piece_vertices.items():
        own, flat = cloth.welded[rows], meshes[name].points
        up[own] = hung[name][:, 1] if is_hung else flat[:, 1] - flat[:, 1].mean()
        hints[own] = (
            np.sign(hung[name] - middle) * [1.0, 0.0, 1.0] if is_hung else _LOOKS.get(pieces[name].worn_at, np.zeros(3))
        )
    # A file's own levels, where it has some.
    off = [
        heights[level] - float(hung[name][meshes[name].edges[edge], 1].mean())
        for name in hung
        for edge, level in pieces[name].levels.items()
    ]
    shoulder = max(float(body.line(f"shoulder {side}")[:, 1].max()) for side in ("left", "right"))

    def hangs_at(high: float) -> float:
        if top is not None:
            return heights[top] if isinstance(top, str) else float(top)
        if is_hung and off:
            return high + float(np.mean(off))
        return high if is_hung and heights["hip"] < high < shoulder else heights["waist"]

    return lay_around(
        cloth, openings, body, limb_lines(body), up=up, hints=hints, top=hangs_at, on_shoulders=on_shoulders
    )
