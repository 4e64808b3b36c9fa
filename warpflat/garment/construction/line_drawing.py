"""The line drawing of a garment, front and back, as its designed surface shows it; and its measures beside the body's."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core import FloatArray, IntArray, arc_lengths, other_side, resample, unit, without_side
from warpflat.flat import area_vectors, border_loops, judge, triangulate, vertex_normals
from warpflat.garment.construction.button_stand import button_depths
from warpflat.garment.construction.drawn_finishing import Rises, finishing_views, lost_along
from warpflat.garment.construction.edges import lengths_of
from warpflat.garment.construction.form_garment import FormGarment
from warpflat.garment.construction.girths import drawn_in
from warpflat.garment.construction.mark_openings import TIE_WIDTH
from warpflat.garment.construction.openings import place_opening
from warpflat.pattern import ClothKind, Measure, NeededOpening, Pattern, Piece, ViewedPiece, Worn, line_name

if TYPE_CHECKING:
    from warpflat.flat import Flattening
    from warpflat.garment.construction.garment import Garment

__all__ = ["bands_of", "describe_worn"]

# Lines are drawn to within this [m]; what covers less [m2] is a sliver of the projection.
_WITHIN, _LEAST_AREA = 0.001, 1e-5
# Slits and spikes of an outline are narrower than twice this [m].
_SLIT = 1e-4
# A triangle of less than this area [m2] in the view is seen edge on: it covers nothing.
_SEEN_EDGE_ON = 5e-13
# A face whose normal points away from the viewer by more than this cosine is on the far side.
_NEAR_SIDE, _EDGE_ON = -0.1, -0.6
# Teeth of a zip are drawn so far apart; the bar at its end, and a circle of radius 1 [m].
_TOOTH = 0.009
_BAR = np.array([[-0.009, 0.0], [0.009, 0.0]])
# What a slanted hem loses is cut off so far beyond the silhouette and below the edge [m].
_BESIDE = 0.04
# Half of what shows of a godet's hem, as a share of that.
_FOLDED = 0.15
# How far the ends of a tie hang [m], and how much each goes sideways for that.
_TIE_HANGS, _TIES = 0.22, (-0.25, 0.2)
_CIRCLE = np.column_stack([f(np.linspace(0.0, 2.0 * np.pi, 17)) for f in (np.cos, np.sin)])


def describe_worn(garments: Mapping[str, Garment], pattern: Pattern, rises: Rises) -> Worn:
    """Return the line drawing of a garment in its sample size, the measures of all sizes, and the openings that it needs.

    Args:
        garments: flattened, by size, on their bodies.
        pattern: of the garment, on which places of pockets are marked, and whose cuffs and bands draw it in.
        rises: of its slanted hems.
    """
    garment = garments[pattern.sample]
    cloth, on_form = list(garment.pieces.values()), garment if isinstance(garment, FormGarment) else None
    # What hangs nearer to the viewer hides what lies behind it: the inside of a back shows above the neck of a front.
    depth = np.array([flat.surface.vertices[:, 2].mean() for flat in cloth])
    drawn = [_views(flat, half=on_form is not None and on_form.form.half) for flat in cloth]
    views = {}
    for index, (name, sign) in enumerate((("front", 1.0), ("back", -1.0))):
        order = np.argsort(sign * depth, kind="stable").tolist()
        seen = [drawn[k][index] for k in order]
        if on_form is not None:
            names = [list(garment.pieces)[k] for k in order]
            seen = [_without_lost_strips(on_form, *each, sign, rises) for each in zip(names, seen, strict=True)]
            behind, before = finishing_views(on_form, sign, rises)
            seen = [*behind, *_wrapped(on_form, seen, names, sign), *before, *_openings(on_form, sign)]
            seen += _pockets(on_form, pattern.pieces[pattern.sample], sign)
        views[name] = tuple(piece for piece in seen if piece.outlines or piece.lines)
    bands = {size: bands_of(pattern, size) for size in garments}
    girths = {size: drawn_in(each.girths, bands[size]) for size, each in garments.items()}
    measures = {}
    for size, own in girths.items():
        found = list[Measure]()
        for level, girth in own.items():
            # Arms and legs are told once.
            if level.endswith(" right") and other_side(level) in own:
                continue
            name, asked = without_side(level), girth.get("ease_wanted_m")
            found.append(Measure(name=name, body=girth["body_m"], finished=girth["pattern_m"], asked=asked))
        if found:
            measures[size] = tuple(found)
    needed = tuple(
        NeededOpening(
            ring=ring.name, length=ring.length, over=ring.over, girth=ring.girth, depth=ring.opening_needed_mm / 1000
        )
        for ring in (ring.drawn_in(bands[pattern.sample]) for ring in garment.rings)
        if ring.passes is False and ring.girth is not None
    )  # fmt: skip
    knits = dict.fromkeys(flat.fabric.name for flat in cloth if flat.fabric.is_knit)
    verdict = judge({**garment.metrics(), "girths": girths[pattern.sample]})
    failing = dict.fromkeys(finding.kind for finding in verdict.findings if finding.fails) if verdict else {}
    mens = on_form is not None and re.search(r"\bmen\b", on_form.mannequin.source) is not None
    fabrics = {flat.fabric.name: flat.fabric for flat in cloth}
    cloths = {
        name: ClothKind(
            kind="knit" if fabric.is_knit else "woven", weight=fabric.areal_density,
            stretch=(fabric.stretch("warp"), fabric.stretch("weft")), examples=fabric.examples,
        )
        for name, fabric in fabrics.items()
    }  # fmt: skip
    return Worn(
        views=views, measures=measures, needed=needed, knits=tuple(knits), failing=tuple(failing), cloths=cloths,
        buttonholes="left" if mens else "right",
    )  # fmt: skip


def _without_lost_strips(garment: FormGarment, name: str, view: ViewedPiece, sign: float, rises: Rises) -> ViewedPiece:
    """Return a piece as it is seen without the strips that it loses along its edges: above slanted hems, and beyond what is sewn on."""
    import shapely

    for edge, ids in garment.form.pieces[name].edges.items():
        lost_there = lost_along(garment, name, edge, rises)
        if not lost_there.any():
            continue
        low = garment.pieces[name].surface.vertices[ids, :2] * [sign, 1.0]
        high = low + lost_there[:, :2] * [sign, 1.0]
        # Out beyond the silhouette on both sides, which curves in between, and beyond the edge.
        way = unit((high - low).mean(axis=0))
        side = np.array([way[1], -way[0]])
        ends = [(int((towards * low @ side).argmax()), towards * _BESIDE * side) for towards in (-1.0, 1.0)]
        far = low - _BESIDE * way
        cells = [(far[k : k + 2], high[k : k + 2]) for k in range(len(low) - 1)]
        cells += [(far[k] + [0.0 * out, out], high[k] + [0.0 * out, out]) for k, out in ends]
        lost = shapely.union_all([shapely.MultiPoint(np.concatenate(cell)).convex_hull for cell in cells])
        whole = shapely.union_all([shapely.Polygon(ring).buffer(0.0) for ring in view.outlines])
        near = _towards(garment, name, ids, sign) > _NEAR_SIDE
        rows = [shapely.LineString(line).difference(lost) for line in view.lines]
        rows += [shapely.LineString(high[near]).intersection(whole)] if near.sum() > 1 else []
        parts = [part for part in shapely.get_parts(whole.difference(lost)) if part.area > _LEAST_AREA]
        lines = [np.asarray(part.coords) for row in rows for part in shapely.get_parts(row) if part.length > _BAR[1, 0]]
        view = ViewedPiece(outlines=tuple(np.asarray(part.exterior.coords)[:-1] for part in parts), lines=tuple(lines))
    return view


def _towards(garment: Garment, name: str, ids: IntArray, sign: float) -> FloatArray:
    """Return the cosine of the angle by which each vertex of a piece faces the viewer in front (1) or behind (-1)."""
    surface = garment.pieces[name].surface
    triangles, _ = triangulate(surface.faces)
    normals = vertex_normals(surface.vertices, triangles)
    return np.asarray(sign * normals[ids, 2])


def _wrapped(garment: FormGarment, seen: list[ViewedPiece], names: list[str], sign: float) -> list[ViewedPiece]:
    """Return the pieces as they are seen with those of the right half of a wrap in front, out to their edges on the left half."""
    import shapely

    upper, ties = dict[str, ViewedPiece](), list[ViewedPiece]()
    for opening in garment.openings:
        if opening.kind != "wrap":
            continue
        for part in place_opening(garment.form, opening, garment.positions):
            if _towards(garment, part.piece, part.vertices, sign).mean() < _EDGE_ON:
                continue
            both = [name for name in {part.piece, other_side(part.piece)} if name in names]
            right = min(both, key=lambda name: float(garment.pieces[name].surface.vertices[:, 0].mean()))
            at = garment.form.pieces[part.piece].surface.vertices[part.vertices, :2] * [sign, 1.0]
            # From the neckline to the waist, and on beside the line.
            arc = arc_lengths(garment.positions[part.piece][part.vertices])
            share = arc / arc[-1] if "neck" in garment.form.pieces[part.piece].edges else np.ones(len(arc))
            edge = at + np.outer(opening.width * share, [sign, 0.0])
            flap = shapely.Polygon(np.concatenate([at - [sign * _WITHIN, 0.0], edge[::-1]])).buffer(0.0)
            view = seen[names.index(right)]
            whole = shapely.union_all([flap, *(shapely.Polygon(ring).buffer(0.0) for ring in view.outlines)])
            hidden = flap.buffer(2.0 * _WITHIN)
            rows = [shapely.LineString(line).difference(hidden) for line in view.lines]
            parts = [each for row in rows for each in shapely.get_parts(row) if each.length > _BAR[1, 0]]
            upper[right] = ViewedPiece(
                outlines=tuple(np.asarray(each.exterior.coords)[:-1] for each in shapely.get_parts(whole)),
                lines=(*(np.asarray(each.coords) for each in parts), edge),
            )
            if opening.tie and "neck" in garment.form.pieces[part.piece].edges:
                # The ends of the bow hang from the corner of the half that lies above.
                corner = edge[edge[:, 1].argmin()]
                for slope in _TIES:
                    down = np.array([sign * slope, -1.0]) * _TIE_HANGS
                    side = 0.5 * TIE_WIDTH * np.array([1.0, 0.0])
                    ring = np.array(
                        [corner - 0.3 * side, corner + down - side, corner + down + side, corner + 0.3 * side]
                    )
                    ties.append(ViewedPiece(outlines=(ring,), lines=(ring[[0, 1, 2, 3, 0]],)))
    return [*(view for name, view in zip(names, seen, strict=True) if name not in upper), *upper.values(), *ties]


def _openings(garment: FormGarment, sign: float) -> Iterator[ViewedPiece]:
    """Yield zips, as teeth and a bar at the lower end, the upper end of slits and vents, as a bar, buttons, and edges of godets."""
    bust = garment.mannequin.layout.lines["bust"]
    for opening in garment.openings:
        if opening.kind in ("keyhole", "wrap"):
            continue
        parts = place_opening(garment.form, opening, garment.positions)
        end = min(opening.start + opening.length, sum(part.whole for part in parts))
        lines, at_bust = list[FloatArray](), list[float]()
        arcs = [part.before + arc_lengths(garment.positions[part.piece][part.vertices]) for part in parts]
        for part, arc in zip(parts, arcs, strict=True):
            on_bust = np.isin(garment.form.pieces[part.piece].grid_vertices[part.vertices], bust)
            at_bust += arc[on_bust].tolist()
        for part, arc in zip(parts, arcs, strict=True):
            seen = garment.form.pieces[part.piece].surface.vertices[part.vertices, :2] * [sign, 1.0]
            # A side seam is the outline of both views.
            if _towards(garment, part.piece, part.vertices, sign).mean() < _EDGE_ON:
                continue
            if opening.kind == "godet":
                # Its edges, from the tip down to the hem, where it hangs in folds.
                tip, half = [np.interp(end, arc, seen[:, axis]) for axis in (0, 1)], [_FOLDED * opening.width, 0.0]
                lines.append(np.array([seen[0] - half, tip, seen[0] + half]))
                continue
            # Where something lies, and its shape about there.
            shapes = [(end, _BAR)]
            if opening.kind == "zip":
                shapes += [(float(tooth), _BAR / 3) for tooth in np.arange(opening.start, end, _TOOTH)]
            if opening.kind == "buttons":
                depths = button_depths(opening, end, next(iter(at_bust), None))
                shapes = [(depth, 0.5 * opening.button * _CIRCLE) for depth in depths.tolist()]
            for at, shape in shapes:
                if arc[0] <= at <= arc[-1]:
                    lines.append(shape + [np.interp(at, arc, seen[:, axis]) for axis in (0, 1)])
        if lines:
            yield ViewedPiece(outlines=(), lines=tuple(lines))


def bands_of(pattern: Pattern, size: str) -> dict[str, float]:
    """Return by line of the body the length [m] of the cuff or band that a garment ends in there, and that draws it in."""
    found = dict[str, float]()
    for seam in pattern.seams:
        for own, other in (seam.sides, seam.sides[::-1]):
            band, shell = ([pattern.piece(side.piece, size) for side in row] for row in (own, other))
            if any(piece.on_fold for piece in shell) or {piece.role for piece in shell} != {"shell"}:
                continue
            lengths = [sum(lengths_of(pattern, row, size)) for row in (own, other)]
            lines = {line_name(side.edge) for side in other}
            if (
                all(piece.role in ("strip", "cuff") for piece in band)
                and lengths[0] < lengths[1] - 1e-3
                and len(lines) == 1
            ):
                found[lines.pop()] = lengths[0]
    return found


def _pockets(garment: FormGarment, pieces: Sequence[Piece], sign: float) -> Iterator[ViewedPiece]:
    """Yield the edges of patches and welts, and the slanted openings of hip pockets, on both sides of the body."""
    import shapely
    from scipy.interpolate import LinearNDInterpolator

    for piece in (piece for piece in pieces if piece.name in garment.pieces):
        sides = [line for name, line in piece.internal_lines.items() if name.startswith("pocket")]
        rings = shapely.get_parts(shapely.line_merge(shapely.MultiLineString(sides)))
        lines = [np.asarray(shapely.LinearRing(ring.coords).coords) for ring in rings]
        lines += [edge.points for edge in piece.edges if edge.name.startswith("pocket opening")]
        if not lines:
            continue
        flat, on_fold = garment.pieces[piece.name], garment.form.pieces[piece.name].fold
        surface = flat.surface
        normals = vertex_normals(surface.vertices, triangulate(surface.faces)[0])[flat.vertex_origin]
        lift = LinearNDInterpolator(flat.positions, np.hstack([surface.vertices[flat.vertex_origin], normals]))
        lifted = [lift(resample(line, np.linspace(0.0, 1.0, 41))) for line in lines]
        lifted = [row[np.isfinite(row).all(axis=1)] for row in lifted]
        if other_side(piece.name) not in {piece.name, *(each.name for each in pieces)} or on_fold:
            lifted += [row * [-1.0, 1.0, 1.0, -1.0, 1.0, 1.0] for row in lifted]
        shown = [row[:, :2] * [sign, 1.0] for row in lifted if len(row) > 1 and sign * row[:, 5].mean() > _EDGE_ON]
        yield ViewedPiece(outlines=(), lines=tuple(shown))


def _merged(shown: FloatArray) -> list[Any]:
    """Return polygons that together cover triangles (#T by 3 by 2 [m]) which face one way: those that do not cover each other are merged
    as a coverage, by their shared sides, at a twentieth of the cost of a union."""
    import shapely

    if not len(shown):
        return []
    with suppress(shapely.errors.GEOSException):
        merged = shapely.coverage_union_all(shapely.polygons(shown))
        if merged.is_valid or len(shown) == 1:
            return [merged]
    middle = shown.mean(axis=1)
    order = np.argsort(middle[:, np.argmax(np.ptp(middle, axis=0))], kind="stable")
    return [part for half in np.array_split(order, 2) for part in _merged(shown[half])]


def _views(flat: Flattening, *, half: bool) -> tuple[ViewedPiece, ViewedPiece]:
    """Return a piece as it is seen from the front and from the back; of a half garment with its mirror image."""
    import shapely

    faces, space = flat.faces, flat.surface.vertices[flat.vertex_origin]
    triangles = np.concatenate([faces[:, :3], faces[faces[:, 3] >= 0][:, [0, 2, 3]]])
    mirrored = [space[:, :2], space[:, :2] * [-1.0, 1.0]] if half else [space[:, :2]]
    shown, vectors = space[triangles][:, :, :2], area_vectors(space, triangles)
    merged = [part for side in (1.0, -1.0) for part in _merged(shown[side * vectors[:, 2] > _SEEN_EDGE_ON])]
    if half:
        merged += [shapely.transform(part, lambda xy: xy * [-1.0, 1.0]) for part in merged]
    # What it covers from the back is the mirror image of what it covers from the front.
    covered = shapely.union_all(merged, grid_size=1e-6)
    # Slits and spikes between faces that rounding has parted are no lines of the garment.
    for grown in (_SLIT, -2.0 * _SLIT, _SLIT):
        covered = covered.buffer(grown, join_style="mitre")
    covered = covered.simplify(_WITHIN)
    parts = [part for part in shapely.get_parts(covered) if part.geom_type == "Polygon" and part.area > _LEAST_AREA]
    outlines = [np.asarray(part.exterior.coords)[:-1] for part in parts]
    forward = np.repeat(unit(vectors)[:, 2], 3)
    sides = list(zip(triangles.ravel().tolist(), np.roll(triangles, -1, axis=1).ravel().tolist(), strict=True))
    views = []
    for sign in (1.0, -1.0):
        near = dict(zip(sides, (sign * forward > _NEAR_SIDE).tolist(), strict=True))
        lines = []
        for loop in border_loops(faces):
            ends = list(zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True))
            # The fold of a half is no line of the garment.
            shows = [
                near.get(pair, True) and not (half and float(np.abs(space[list(pair), 0]).max()) <= _WITHIN)
                for pair in ends
            ]
            # Begun where the line turns to the far side, so that no visible stretch is split.
            start = next((k for k, show in enumerate(shows) if not show), 0)
            around = [*zip(ends, shows, strict=True)]
            for visible, stretch in groupby([*around[start:], *around[:start]], key=lambda each: each[1]):
                if visible:
                    pairs = [pair for pair, _ in stretch]
                    ids = [pairs[0][0], *(pair[1] for pair in pairs)]
                    drawn = (shapely.LineString(points[ids] * [sign, 1.0]) for points in mirrored)
                    lines += [np.asarray(line.simplify(_WITHIN).coords) for line in drawn]
        views.append(ViewedPiece(outlines=tuple(outline * [sign, 1.0] for outline in outlines), lines=tuple(lines)))
    return views[0], views[1]
