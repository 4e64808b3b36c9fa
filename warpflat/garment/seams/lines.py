"""Lines along which a piece that stays strained may be cut, and what each of them is worth, without a trial.

A dart runs from the border to where the surface bulges, or to where the laid cloth stays beyond its limits; both are smoothed over a few
centimetres, as what is smaller is the mesh or a wrinkle. A seam runs along a tailor's line: the middle, the waist, a yoke, a princess line,
a panel. Each line is a crack in the laid piece (`warpflat.flat.cutting.crack`), which prices it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpflat.core import FloatArray, reflected, unit
from warpflat.flat import LEAST_MOUTH, TRIED, LaidCloth, border_loops, components
from warpflat.garment.seams.anatomy import END, Anatomy, has_role
from warpflat.garment.seams.by_hand import level_of
from warpflat.garment.seams.cloth import ALIKE, Cloth
from warpflat.garment.seams.fields import TriangleMesh
from warpflat.garment.seams.measure import Measured
from warpflat.garment.seams.options import SeamOptions, in_family
from warpflat.garment.seams.tailor import FACING, LEFT

__all__ = ["APART", "WAIST", "Line", "Offer", "first_of_equals", "offers"]

Ids = NDArray[np.int64]

#: The seam around the narrowest of the trunk.
WAIST = "waist"
# Lengths are shares of the garment's size. Bulges and misfits are smoothed over this one.
_SMOOTH = 0.05
# A bulge has at least this curvature [rad], a misfit this share of what is beyond the limit; of each kind so many are looked at.
# Without the first two the dress of the measured garments gets a dart on one side alone when it is fitted to EU 44.
_BULGE, _MISFIT, _PLACES = 0.12, 0.08, 6
# Darts to a place at the border reach inwards by these shares.
_REACHES = (0.06, 0.11)
# A dart is no longer than this.
_LONGEST = 0.32
#: Nearer than this a dart's ends, its tip and the border, two darts, two places, and a place and the plane of symmetry are one.
APART = 0.03
#: What opens wider than this share of its length is a wedge, and no dart.
WIDE = 0.6
# A centimetre sewn counts as this much cloth beyond the limit [m2].
_PRICE = 1e-5


@dataclass(frozen=True, kw_only=True, eq=False)
class Line:
    """A line that may be cut.

    Attributes:
        name: of the seam, without its side.
        normal, point: of its plane.
        start, end: only what projects between them along the line is cut; all of the piece if start is None [m].
        level: of a line that parts, the field and its value there, instead of a plane.
    """

    name: str
    normal: FloatArray
    point: FloatArray
    start: FloatArray | None = None
    end: FloatArray | None = None
    level: tuple[str, float] | None = None

    @property
    def parts(self) -> bool:
        """Whether it parts the piece."""
        return self.start is None

    def beside(self, anatomy: Anatomy) -> float:
        """Return how far it lies to the left of the garment's plane of symmetry [m]."""
        return float(anatomy.across(self.point))

    def is_lopsided(self, anatomy: Anatomy) -> bool:
        """Return whether it has a mirror image that is another one."""
        if anatomy.mirror is None or (self.parts and self.level is None):
            return False
        # A line around the front runs on both sides, wherever its place is.
        around = self.level is not None and self.level[0] == FACING
        return around or abs(self.beside(anatomy)) > APART * anatomy.size

    def mirrored(self, anatomy: Anatomy) -> Line:
        """Return its mirror image."""
        level = self.level
        if level is not None and level[0] == LEFT:
            level = LEFT, -level[1]
        point, start, end = (None if one is None else anatomy.image(one) for one in (self.point, self.start, self.end))
        assert point is not None
        return replace(
            self, normal=reflected(self.normal, anatomy.normal), point=point, start=start, end=end, level=level
        )

    def field(self, cloth: Cloth) -> FloatArray:
        """Return a field on the cloth that is zero along it, #V."""
        if self.level is None:
            return np.asarray((cloth.vertices - self.point) @ self.normal)
        return cloth.values[self.level[0]] - self.level[1]


@dataclass(frozen=True, kw_only=True, eq=False)
class Offer:
    """A line and its price.

    Attributes:
        line: and its mirror image, if the piece lies across the plane of symmetry.
        gain: cloth that it brings back within the limits [m2], on both sides of the garment.
        length: sewn [m], likewise.
        more: how many pieces more there are with it.
    """

    line: Line
    gain: float
    length: float
    more: int

    @property
    def middle(self) -> FloatArray:
        """Where it is [m]."""
        return self.line.point if self.line.end is None else 0.5 * (self.line.point + self.line.end)

    @property
    def value(self) -> float:
        """What it is worth, less the price of its length, by each piece more [m2]."""
        return (self.gain - _PRICE * 100.0 * self.length) / max(self.more, 1)


def first_of_equals(values: FloatArray) -> Ids:
    """Return the order of values from the largest on; those that are alike keep their places."""
    bins = np.floor(np.log(np.maximum(values, 1e-12)) / ALIKE)
    return np.lexsort((np.arange(len(values)), -bins))


def offers(
    cloth: Cloth, piece: Measured, anatomy: Anatomy, options: SeamOptions, *, twice: bool, may_part: bool
) -> list[Offer]:
    """Return what may be cut in a piece, the best first.

    Args:
        cloth: of the garment.
        piece: laid flat.
        anatomy: of the garment.
        options: seams that are not wanted are left out.
        twice: whether another piece is its mirror image, and is cut alike.
        may_part: whether seams are looked for, too.
    """
    laid = LaidCloth(piece.result.network, piece.result.positions)
    found = list[Offer]()
    # Where a piece bulges, and where it stays beyond the cloth's limits: vertices, those of each kind with the most first.
    vertices, faces = piece.surface.vertices, piece.surface.faces[:, :3].astype(np.int64)
    mesh = TriangleMesh(vertices=vertices, faces=faces)
    defect = mesh.curvature.copy()
    defect[mesh.loops[0]] = 0.0
    fit = piece.result.fit
    beyond = np.where(fit.demand.beyond, fit.area, 0.0)
    misfit = np.bincount(faces.ravel(), np.repeat(beyond / 3.0, 3), minlength=len(vertices))
    edges = np.concatenate([mesh.half_edges.edges, mesh.half_edges.edges[:, ::-1]])
    places = list[int]()
    for whole, least in ((defect, _BULGE), (misfit, _MISFIT * misfit.sum())):
        density = mesh.smooth(whole / mesh.mass, _SMOOTH * anatomy.size)
        # Each vertex belongs to the peak that is reached from it by climbing.
        by_density = edges[np.lexsort((density[edges[:, 1]], edges[:, 0]))]
        steepest = by_density[np.append(by_density[1:, 0] != by_density[:-1, 0], True)]
        up = np.arange(len(vertices))
        climbs = density[steepest[:, 1]] > density[steepest[:, 0]]
        up[steepest[climbs, 0]] = steepest[climbs, 1]
        while (up[up] != up).any():
            up = up[up]
        total = np.bincount(up, np.maximum(density, 0.0) * mesh.mass, minlength=len(vertices))
        tops = np.flatnonzero(total > max(least, 1e-12))
        for top in tops[first_of_equals(np.asarray(total[tops], dtype=np.float64))][:_PLACES].tolist():
            if all(np.linalg.norm(vertices[top] - vertices[one]) > APART * anatomy.size for one in places):
                places.append(top)
    for line, rows in (
        *(_darts(cloth, piece, laid, places, anatomy, twice=twice) if not options.forbids("dart") else ()),
        *(_seams(cloth, piece, laid, places, anatomy, options, twice=twice) if may_part else ()),
    ):
        cost, sides = laid.price(rows), 2 if twice else 1
        if not line.parts and not (cost.opens and LEAST_MOUTH <= cost.opening <= WIDE * cost.length / len(rows)):
            continue
        more = sides * len(rows) if line.parts else 0
        found.append(Offer(line=line, gain=sides * cost.relieved, length=sides * cost.length, more=more))
    order = first_of_equals(np.array([one.value for one in found]))
    best = list[Offer]()
    for one in (found[k] for k in order.tolist()):
        alike = [other for other in best if other.line.name == one.line.name]
        apart = all(np.linalg.norm(one.middle - other.middle) > APART * anatomy.size for other in alike)
        if one.gain > 0.0 and apart and len(alike) < TRIED:
            best.append(one)
    return best


def _darts(
    cloth: Cloth, piece: Measured, laid: LaidCloth, places: list[int], anatomy: Anatomy, *, twice: bool
) -> Iterator[tuple[Line, list[Ids]]]:
    """Yield darts to the bulges and misfits of a piece, with the rows of its vertices that each cuts."""
    surface, flat, size = piece.surface, laid.positions, anatomy.size
    own, loop = piece.mesh.vertex_of, border_loops(surface.faces)[0].astype(np.int64)
    # A dart begins at no free end below, for what hangs is shaped from above, nor at the lower end of an opening, nor at another dart.
    heights, hangs = cloth.vertices @ anatomy.up, has_role(cloth, own[loop], "hem", "sleeve", "leg")
    low = heights[own[loop]] < heights.min() + END * np.ptp(heights)
    hangs |= low & has_role(cloth, own[loop], "opening")
    starts = loop[~hangs & (np.bincount(own)[own[loop]] == 1)]
    inner = np.flatnonzero(~laid.border)
    across, near = anatomy.across(surface.vertices), APART * size
    whole = anatomy.mirror is not None and not twice and across.min() < -near and across.max() > near
    away = np.linalg.norm(flat[loop][:, None] - flat[inner], axis=2).min(axis=0)
    deep = inner[away >= near]
    ends = list[tuple[int, int]]()
    for place in places:
        if whole and across[place] < -near:
            continue
        if place in deep:
            ends += [(mouth, place) for mouth in laid.mouths(place) if mouth in starts]
        elif len(starts) and len(deep):
            # A place at the border is reached from there: inwards by a hand.
            mouth = laid.nearest(starts, flat[place])
            inwards = unit(flat[laid.nearest(deep, flat[mouth])] - flat[mouth])
            ends += [(mouth, laid.nearest(deep, flat[mouth] + reach * size * inwards)) for reach in _REACHES]
    for mouth, tip in dict.fromkeys(ends):
        if not near < float(np.linalg.norm(flat[tip] - flat[mouth])) < _LONGEST * size:
            continue
        start, end = surface.vertices[[mouth, tip]]
        normal = np.cross(end - start, piece.mesh.vertex_normals[tip])
        if not normal.any():
            continue
        line = Line(name="dart", normal=normal / np.linalg.norm(normal), point=start, start=start, end=end)
        pairs = [(mouth, tip)]
        if whole and np.abs(across[[mouth, tip]]).max() > near:
            if np.abs(across[[mouth, tip]]).min() < near or across[mouth] * across[tip] < 0.0:
                continue
            ends_there = ((loop, anatomy.image(start)), (inner, anatomy.image(end)))
            there = [np.linalg.norm(surface.vertices[among] - image, axis=1).argmin() for among, image in ends_there]
            pairs.append((int(loop[there[0]]), int(inner[there[1]])))
        rows = [row for pair in pairs if (row := laid.dart(*pair)) is not None]
        if len(rows) == len(pairs) and _are_apart(rows):
            yield line, rows


def _are_apart(rows: Sequence[Ids]) -> bool:
    """Return whether no vertex is in two rows, or twice in one."""
    return len(np.unique(np.concatenate(rows))) == sum(len(row) for row in rows)


def _seams(
    cloth: Cloth,
    piece: Measured,
    laid: LaidCloth,
    places: list[int],
    anatomy: Anatomy,
    options: SeamOptions,
    *,
    twice: bool,
) -> Iterator[tuple[Line, list[Ids]]]:
    """Yield a tailor's lines through a piece, with the rows of its vertices that each cuts."""
    own, loop = piece.mesh.vertex_of, border_loops(piece.surface.faces)[0].astype(np.int64)
    edges = laid.half_edges.edges
    long = np.linalg.norm(np.diff(laid.positions[edges], axis=1)[:, 0], axis=1)
    for line in _tailored(cloth, piece, places, anatomy, options):
        if options.forbids(line.name):
            continue
        rows = list[Ids]()
        for one in (line, line.mirrored(anatomy)) if not twice and line.is_lopsided(anatomy) else (line,):
            field = one.field(cloth)[own]
            # As lengths.
            off = np.abs(field) / np.maximum(np.median(np.abs(np.diff(field[edges], axis=1)[:, 0]) / long), 1e-300)
            # Of several lines the longest; around the front one runs on either side.
            faces = piece.surface.faces[(field < 0.0)[piece.surface.faces[:, :3]].sum(axis=1) % 3 > 0]
            part = components(faces)
            longest = np.argsort(-np.bincount(part, minlength=2), kind="stable")[
                len(rows) if line.level == one.level else 0
            ]
            strip = np.isin(loop, faces[part == longest, :3])
            following = np.roll(loop, -1)
            crossed = np.flatnonzero(((field[loop] < 0.0) != (field[following] < 0.0)) & strip & np.roll(strip, -1))
            ends = [min((loop[k], following[k]), key=lambda v: off[v]) for k in crossed.tolist()]
            row = laid.row(int(ends[0]), int(ends[1]), off) if len(ends) == 2 else None
            if row is None:
                break
            rows.append(row)
        else:
            if _are_apart(rows):
                yield line, rows


def _tailored(
    cloth: Cloth, piece: Measured, places: list[int], anatomy: Anatomy, options: SeamOptions
) -> Iterator[Line]:
    """Yield the lines along which a tailor parts a piece: the middle, the waist or a yoke, princess lines and panels."""
    surface, size = piece.surface, anatomy.size
    if not places:
        return
    facing = piece.mesh.area_vectors
    heights = surface.vertices @ anatomy.up
    across = anatomy.across(surface.vertices)
    sleeve = cloth.sleeve_of(piece.mesh) >= 0
    whole = across.min() < -0.08 * size and across.max() > 0.08 * size
    if not sleeve:
        if whole:
            name = "centre front" if float((facing @ anatomy.front).sum()) > 0.0 else "centre back"
            yield Line(name=name, normal=anatomy.normal, point=anatomy.offset * anatomy.normal)
        tall = float(np.ptp(heights))
        name, level, waist = "yoke", float(heights[places[0]]), None
        if tall > 0.8 * size or options.waist is not None:
            # Where the body has it, or the trunk is narrowest.
            waist = level_of(cloth, anatomy, WAIST, options)
        if waist is not None and 0.2 * tall < waist - heights.min() < 0.8 * tall:
            name, level = WAIST, waist
        known = [edges for other, edges in cloth.seams.items() if in_family(other, name)]
        if known:
            # Front and back meet at the sides.
            level = float((cloth.vertices[np.unique(known[0])] @ anatomy.up).mean())
        if 0.2 * tall < level - heights.min() < 0.8 * tall and tall > 0.5 * size:
            yield Line(name=name, normal=anatomy.up, point=level * anatomy.up)
    # Further lines of the families to which centre and side belong: through the first place, and half way.
    place = places[0]
    for field, name in ((LEFT, "princess"), (FACING, "panel")):
        if field not in cloth.values or (sleeve and field == LEFT):
            continue
        own = cloth.values[field][piece.mesh.vertex_of]
        low, high = np.quantile(own, [0.15, 0.85])
        half = own[own > 0.0] if whole and field == LEFT else own
        for value in (float(own[place]), float(np.median(half))):
            if low < value < high and (field == FACING or not whole or abs(across[place]) > 0.04 * size):
                yield Line(name=name, normal=anatomy.normal, point=surface.vertices[place], level=(field, value))
