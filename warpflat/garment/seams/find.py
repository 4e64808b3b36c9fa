"""`find_seams`: a whole garment, made by somebody else as one mesh, becomes pieces that sew up into it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core import (
    InputError,
    expect,
    find_unused_name,
    format_count,
    polyline_length,
    segment_lengths,
    short_repr,
)
from warpflat.flat import (
    Fabric,
    Flattening,
    Surface,
    as_fabric,
    border_loops,
    flat_areas,
    line_from_curve,
    line_on_plane,
    load_library,
    triangulate,
)
from warpflat.garment.seams.anatomy import (
    HOLE,
    ROLES,
    TAILORED,
    Anatomy,
    averaged_limbs,
    axis_name,
    describe,
    find_anatomy,
    has_role,
)
from warpflat.garment.seams.by_hand import HAND, cut_by_hand, join_ends, keep_seams, leave_to_hand
from warpflat.garment.seams.cloth import ALIKE, Cloth, PieceMesh, are_among
from warpflat.garment.seams.energy import Trial, cut_by_energy
from warpflat.garment.seams.measure import laid_flat
from warpflat.garment.seams.openings import open_tubes
from warpflat.garment.seams.options import NO_PATTERN, SeamOptions
from warpflat.garment.seams.section import plane_sections
from warpflat.garment.seams.solid import LaidFlat, is_panel, part_solids, parts_within
from warpflat.garment.seams.symmetric import averaged, mirrored
from warpflat.garment.seams.tailor import FACING, cut_as_a_tailor, draw_fields, side_word, with_drawn_sleeves
from warpflat.garment.seams.thickness import without_thickness
from warpflat.pattern import FoundSeam

__all__ = ["GRAIN", "FoundSeams", "find_seams"]

Ids = NDArray[np.int64]

# A band has no more than this share of the cloth, and its border, squared, is so many times its area: 4.5 times as long as wide.
_BAND_AREA, _BAND = 0.12, 27.0
# It runs along an opening by at least this share of its border: a panel of a leg only ends there.
_ALONG = 0.2
#: What a band is called, by the border along which it runs.
BANDS = {"waist": "waistband", "neck": "neck_band", "hem": "hem_band", "sleeve": "cuff", "leg": "cuff"}

# A piece whose parts in front and behind differ by less than this share is of neither.
_AROUND = 0.35

# A piece is longer than wide from this ratio of the second moments of its length and width on.
_LONG = 2.0

# A pattern is nowhere narrower than this share of its seams' allowance.
_WIDTH = 0.5

#: The line of a piece along which its grain runs.
GRAIN = "grain"


@dataclass(frozen=True, kw_only=True, eq=False)
class FoundSeams:
    """The pieces of a garment, and the seams between them.

    Attributes:
        pieces: surfaces of different names, whose borders meet vertex by vertex along the seams; the line "grain" of each runs with the
            body, other lines name the stretches of its border.
        seams: by name.
        what: the garment in words.
        up, front: the axes of space that are nearest to its own, as "+y" and "+z".
        notes: what was chosen or left out, one sentence each, the most important first.
        along: what of the garment's file the seams follow, in words; "" where they were found or drawn.
    """

    __repr__ = short_repr

    pieces: tuple[Surface, ...]
    seams: tuple[FoundSeam, ...]
    what: str
    up: str
    front: str
    notes: tuple[str, ...] = ()
    along: str = ""

    def beyond_limit(self, fabric: Fabric) -> float:
        """Return the share of the cloth that is beyond its limit where the pieces are laid flat, about."""
        area = [float(flat_areas(piece.vertices, piece.faces[:, :3]).sum()) for piece in self.pieces]
        return float(np.average([laid_flat(piece, fabric, 0.0).outside for piece in self.pieces], weights=area))

    def knit_for(self, fabric: Fabric) -> str:
        """Return the name of the knit that gives the least of those in which the pieces are a pattern; "" if there is none."""
        knits = [knit for knit in load_library().values() if knit.is_knit and knit.strain_limit > fabric.strain_limit]
        for knit in sorted(knits, key=lambda one: one.strain_limit):
            if self.beyond_limit(knit) <= NO_PATTERN:
                return knit.name
        return ""

    def describe(self) -> str:
        """Return what was found in one line."""
        total = 100 * sum(seam.length for seam in self.seams)
        along = f", along {self.along}" if self.along else ""
        return f"{self.what}: {format_count(len(self.pieces), 'piece')}, {format_count(len(self.seams), 'seam')} of {total:.0f} cm{along}"

    def entry(self, pieces: Sequence[Flattening], allowance: float) -> dict[str, Any]:
        """Return the entry `garment` of `metrics.json`: what it is, its seams, and whether this is a pattern yet.

        Args:
            pieces: flat.
            allowance: of seams [m].
        """
        area = np.array([float(piece.fit.area.sum()) for piece in pieces])
        outside = np.array([piece.fit.outside for piece in pieces])
        share = float((outside * area).sum() / area.sum())
        entry: dict[str, Any] = {
            "what": self.what,
            "outside": share,
            "found_seams": [seam.as_dict() for seam in self.seams],
            "notes": list(self.notes),
        }
        if share > NO_PATTERN:
            worst = pieces[int((outside * area).argmax())].surface.name
            entry["no_pattern"] = (
                f"no pattern yet: {100 * share:.0f} % of the cloth is beyond its limit, most of it in {worst}; take a fabric that gives "
                "more, smooth wrinkles (--smooth 5), or cut the mesh further"
            )
        elif narrow := [
            one.surface.name for one in pieces if parts_within(one.faces, one.positions, _WIDTH * allowance) != 1
        ]:
            entry["no_pattern"] = (
                f"no pattern yet: {', '.join(narrow)} {'is' if len(narrow) == 1 else 'are'} somewhere narrower than "
                f"{1e3 * _WIDTH * allowance:g} mm, so that nothing is left within the seams; leave seams out (--no), or draw "
                "others (--cut-seam)"
            )
        return entry


def find_seams(
    surface: Surface | Sequence[Surface],
    options: SeamOptions | None = None,
    *,
    fabric: Fabric | str | None = None,
) -> FoundSeams:
    """Find the seams of a whole garment, and cut it there.

    Seams are zero lines of smooth fields (harmonic, or screened by where the cloth faces), averaged over both sides of a symmetric garment.
    Faces are split along them.

    Args:
        surface: one connected layer of cloth, or several of one garment.
        options: see `SeamOptions`.
        fabric: the cloth; with it further seams and darts are tried where it stays strained beyond its limit.

    Raises:
        InputError: an option is wrong.
    """
    options = options or SeamOptions()
    options.validate()
    layers = [surface] if isinstance(surface, Surface) else list(surface)
    for layer in layers:
        expect(layer, Surface, "surface", "a Surface, or a sequence of them")
    # What the user draws lies on any of the layers, and before anything is changed in them.
    cloths, drawn = cut_by_hand([cloth_of(layer) for layer in layers], layers, options.cuts)
    found: list[FoundSeams] = []
    for layer, cloth in zip(layers, cloths, strict=True):
        found.append(_find_in_layer(cloth, layer, options, None if fabric is None else as_fabric(fabric)))
        # All layers of a garment are worn the same way up.
        options = replace(options, up=options.up or found[0].up, front=options.front or found[0].front)
    often = Counter(piece.name for one in found for piece in one.pieces)
    pieces, taken = list[Surface](), set[str]()
    for one in found:
        for piece in one.pieces:
            name = piece.name if often[piece.name] == 1 else f"{one.what.split(',')[0]} {piece.name}"
            name = find_unused_name(name, taken)
            taken.add(name)
            pieces.append(replace(piece, name=name))
    return FoundSeams(
        pieces=tuple(pieces),
        seams=tuple(seam for one in found for seam in one.seams),
        what="; ".join(
            what if count == 1 else f"{count} x {what}" for what, count in Counter(one.what for one in found).items()
        ),
        up=found[0].up,
        front=found[0].front,
        notes=(*drawn, *(note for one in found for note in one.notes)),
    )


def _find_in_layer(cloth: Cloth, surface: Surface, options: SeamOptions, fabric: Fabric | None) -> FoundSeams:
    cloth, holes = _without_holes(cloth)
    cloth, turned = without_thickness(cloth)
    smoothed = list[str]()
    if options.smooth:
        # Smoothing once draws a tube in by the square of length over radius; what it took from its own result is given back, so that the
        # fourth power is left.
        once = cloth.smooth(cloth.vertices, options.smooth)
        vertices = 2.0 * once - cloth.smooth(once, options.smooth)
        shifts = 1e3 * np.linalg.norm(vertices - cloth.vertices, axis=1)
        words = f"it moved by {shifts.mean():.1f} mm in the mean, {shifts.max():.1f} mm at most"
        smoothed = [f"smoothed over {1e3 * options.smooth:g} mm, on request: {words}"]
        cloth = replace(cloth, vertices=vertices)
    anatomy = find_anatomy(cloth, up=options.up, front=options.front)
    moved, even = "", False
    if not options.cuts:  # what the user draws on one side is on that side alone
        cloth, moved, even = averaged(cloth, anatomy)
    anatomy = replace(anatomy, limbs=averaged_limbs(anatomy, alike=even))
    role = np.zeros(len(cloth.vertices))
    for border in anatomy.borders:
        role[border.vertices] = 1.0 + ROLES.index(border.role)
    cloth = cloth.with_values(role=role)
    cloth, notes, why = _first_seams(cloth, anatomy, surface, options, fabric, even=even)
    cloth = open_tubes(cloth, anatomy, options)
    by_hand = tuple(name.removeprefix(HAND) for name in cloth.seams if name.startswith(HAND))
    options = replace(options, keep=(*options.keep, *by_hand))
    cloth = replace(cloth, seams={name.removeprefix(HAND): edges for name, edges in cloth.seams.items()})
    trials, basic = list[Trial](), set(cloth.seams)
    if options.find == "none":
        # What no cut opens is refused: closed pieces, and those with a handle.
        for mesh in cloth.pieces():
            loops = len(mesh.loops)
            if loops == 0 or sum(mesh.shape) != 2:
                x, y, z = (100.0 * mesh.vertices.mean(axis=0)).tolist()
                what = "is closed" if loops == 0 else "has a handle"
                raise InputError(
                    f"what the cuts leave {what}, about ({x:.0f}, {y:.0f}, {z:.0f}) cm: cut it once more, or let "
                    'find = "auto" (--seams auto) find the other seams'
                )
    elif fabric is not None:
        try:
            cloth, trials = cut_by_energy(
                cloth, anatomy, fabric, options, lambda trial, mesh: _surface_of(trial, anatomy, mesh, surface)
            )
        except InputError as reason:
            notes.append(f"no further seams were looked for: {reason}")
        if even:
            cloth, why = mirrored(cloth, anatomy)
        if closed := sorted(basic - cloth.seams.keys()):
            notes.append(f"{', '.join(closed)} closed again: the cloth lies flat without, within its limit")
    if why:
        moved = f"both sides are averaged, but each is cut by itself, as {why}{'; ' if moved else ''}{moved}"
    elif even and moved:
        moved = f"both sides are averaged and cut alike: {moved}"
    price = {trial.name: trial for trial in trials}
    pieces = _as_surfaces(cloth, anatomy, surface)
    alike = [] if anatomy.kind in TAILORED else _alike(pieces)
    return FoundSeams(
        pieces=tuple(pieces),
        seams=tuple(
            FoundSeam(
                name=name,
                length=cloth.seam_length(name),
                released=price[name].released if name in price else None,
                needed=price[name].needed if name in price else "",
            )
            for name in cloth.seams
        ),
        what=describe(anatomy),
        up=axis_name(anatomy.up),
        front=axis_name(anatomy.front),
        notes=(*notes, *smoothed, *holes, *turned, *filter(None, [moved]), *alike, *anatomy.notes),
    )


def _first_seams(
    cloth: Cloth, anatomy: Anatomy, surface: Surface, options: SeamOptions, fabric: Fabric | None, *, even: bool
) -> tuple[Cloth, list[str], str]:
    """Return the cloth with the seams that its kind has, or its shape asks for, and those of the user; notes; and why sides differ.

    Args:
        cloth: with the user's seams.
        anatomy: of the garment.
        surface: as it was read.
        options: which seams are made.
        fabric: by which a closed thing is measured.
        even: whether both sides are to be cut alike.
    """
    notes, why, auto = list[str](), "", options.find == "auto"
    if anatomy.kind in TAILORED:
        cloth = draw_fields(cloth, anatomy)
        if auto or options.keep:
            cloth, notes = cut_as_a_tailor(cloth, anatomy, hood=not options.forbids("hood"))
        else:
            cloth = with_drawn_sleeves(cloth, anatomy, anywhere=True)
        for name in list(cloth.seams):
            if not (auto or name.startswith(HAND) or options.keeps(name)):
                cloth = cloth.without_seam(name)
    for step in (
        lambda cloth: leave_to_hand(cloth, options),
        lambda cloth: keep_seams(cloth, anatomy, options),
        join_ends,
    ):
        cloth, told = step(cloth)
        notes += told
    if auto:
        shape = anatomy.kind not in TAILORED and not is_panel(cloth)
        if even and shape:
            cloth, why = mirrored(cloth, anatomy)
        measure = None
        if fabric is not None and anatomy.kind not in TAILORED:
            measure = partial(_laid_flat, anatomy=anatomy, surface=surface, fabric=fabric)
        mirror = anatomy if even and shape and not why else None
        cloth, told = part_solids(cloth, shape=shape, mirror=mirror, most=options.most_pieces, measure=measure)
        notes += told
    if even:
        cloth, why = mirrored(cloth, anatomy)
    for name in list(cloth.seams):
        if not name.startswith(HAND) and options.forbids(name):
            cloth = cloth.without_seam(name)
    return cloth, notes, why


def _laid_flat(
    cloth: Cloth, mesh: PieceMesh, width: float, *, anatomy: Anatomy, surface: Surface, fabric: Fabric
) -> LaidFlat:
    return laid_flat(_surface_of(cloth, anatomy, mesh, surface), fabric, width)


def _without_holes(cloth: Cloth) -> tuple[Cloth, list[str]]:
    """Return the cloth with its holes closed, and a note if there were any: nobody sews around a fault of the mesh, or a buttonhole."""
    vertices, fans, longest = [cloth.vertices], list[Ids](), 0.0
    for loop in cloth.loops:
        ring = cloth.vertices[loop]
        length = polyline_length(ring, closed=True)
        if length < HOLE * cloth.size:
            middle = np.full(len(loop), len(cloth.vertices) + len(fans))
            vertices.append(ring.mean(axis=0)[None])
            fans.append(np.stack([np.roll(loop, -1), loop, middle], axis=1))
            longest = max(longest, length)
    if not fans:
        return cloth, []
    added = len(np.concatenate(fans))
    cloth = replace(
        cloth,
        vertices=np.concatenate(vertices),
        faces=np.concatenate([cloth.faces, *fans]),
        values={name: np.append(value, np.zeros(len(fans))) for name, value in cloth.values.items()},
        labels={name: np.append(label, np.zeros(added, dtype=np.int64)) for name, label in cloth.labels.items()},
    )
    return cloth, [f"{format_count(len(fans), 'hole')} of at most {1e3 * longest:.0f} mm around closed"]


def cloth_of(surface: Surface) -> Cloth:
    """Return the cloth of a surface: its triangles, wound so that their normals point out."""
    triangles, _ = triangulate(surface.faces)
    cloth = Cloth(vertices=surface.vertices.copy(), faces=triangles.astype(np.int64))
    # Six times the volume inside, with borders closed by fans, is negative where normals point inwards.
    points = cloth.vertices - cloth.vertices[np.unique(cloth.faces)].mean(axis=0)
    a, b, c = points[cloth.faces].transpose(1, 0, 2)
    total = float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum())
    for loop in cloth.loops:
        ring = points[loop]
        following, middle = np.roll(ring, -1, axis=0), ring.mean(axis=0)
        total += float((np.cross(following, ring) @ middle).sum())
    return cloth if total >= 0.0 else replace(cloth, faces=cloth.faces[:, ::-1].copy())


def _as_surfaces(cloth: Cloth, anatomy: Anatomy, whole: Surface) -> list[Surface]:
    """Return the pieces as surfaces: named, with the stretches of their borders and their grain as lines."""
    meshes = list(cloth.pieces())
    # Pieces are called "left_sleeve", "front", "right_back_leg", with a number behind names that occur twice.
    area = cloth.face_areas
    plain, bands = list[str](), [_band(cloth, mesh) for mesh in meshes]
    sleeves = [cloth.sleeve_of(mesh) for mesh in meshes]
    # A short sleeve from the armhole on is no cuff.
    bands = [
        "" if band == "cuff" and sleeves.count(sleeve) == 1 and sleeve >= 0 else band
        for band, sleeve in zip(bands, sleeves, strict=True)
    ]
    for mesh, band, sleeve in zip(meshes, bands, sleeves, strict=True):
        weight = area[mesh.face_of]
        corners = cloth.faces[mesh.face_of]
        facing = cloth.values.get(FACING, np.zeros(len(cloth.vertices)))
        across = anatomy.across(cloth.vertices[corners].mean(axis=1)) * weight
        # Wholly on one side, or over the middle; of the front and the back, or of one of them.
        lopsided = abs(float(across.sum())) > 0.6 * float(np.abs(across).sum())
        side = float(across.sum())
        turned = facing[corners].mean(axis=1) * weight
        face = ("front" if float(turned.sum()) > 0.0 else "back") if FACING in cloth.values else ""
        if FACING in cloth.values and abs(float(turned.sum())) < _AROUND * float(np.abs(turned).sum()):
            face = ""
        if sleeve >= 0:
            of_hood = sleeve >= len(anatomy.limbs_of("sleeve"))
            name = f"{side_word(side)}_{'hood' if of_hood else 'sleeve'}"
        elif anatomy.kind == "trousers":
            # By its role: vertices of a cloth that has been mirrored have other numbers.
            part = "leg" if has_role(cloth, mesh.vertex_of, "leg").any() else "yoke"
            name = "_".join(filter(None, [side_word(side) if lopsided else "", face, part]))
        elif anatomy.kind in TAILORED:
            name = f"{side_word(side)}_{face or 'side'}" if lopsided else face or "body"
        elif len(meshes) == 1:
            name = anatomy.kind if anatomy.kind not in ("other", "closed") else "piece"
        else:
            name = "piece"
        if band:
            # What lies ahead of the middle is in front, whichever way the faces of a band point.
            middle = (cloth.vertices[corners].mean(axis=1) * weight[:, None]).sum(axis=0) / weight.sum()
            ahead = float((middle - 0.5 * (cloth.vertices.min(axis=0) + cloth.vertices.max(axis=0))) @ anatomy.front)
            part = side_word(side) if lopsided else "front" if ahead > 0.0 else "back"
            name = f"{part}_{band}" if bands.count(band) > 1 else band
        plain.append(name)
    often, seen = Counter(plain), Counter[str]()
    names = []
    for name in plain:
        seen[name] += 1
        names.append(f"{name}_{seen[name]}" if often[name] > 1 else name)
    label = {tuple(edge): name for name, edges in cloth.seams.items() for edge in edges.tolist()}
    role = {
        vertex: ROLES[int(number) - 1]
        for vertex, number in enumerate(np.round(cloth.values["role"]).tolist())
        if number > 0.0
    }
    he, beside = cloth.half_edges, dict[tuple[int, ...], list[int]]()
    at_seam = np.flatnonzero(are_among(he.edges, cloth.seam_edges())[he.edge])
    for edge, number in zip(he.edges[he.edge[at_seam]].tolist(), cloth.parts[he.face[at_seam]].tolist(), strict=True):
        beside.setdefault(tuple(edge), []).append(number)
    made = []
    for number, mesh in enumerate(meshes):
        piece = _surface_of(cloth, anatomy, mesh, whole, name=names[number])
        lines = _edge_lines(piece, mesh, number, names, label, role, beside)
        made.append(replace(piece, lines={**lines, **piece.lines}))
    # Repairs of the whole are told once.
    if made and whole.notes:
        made[0] = replace(made[0], notes=whole.notes)
    return made


def _surface_of(cloth: Cloth, anatomy: Anatomy, mesh: PieceMesh, whole: Surface, *, name: str = "piece") -> Surface:
    """Return a piece as a surface, with its grain if it has one: down the trunk and the leg, along a sleeve."""
    piece = replace(mesh.as_surface(name), sources=whole.sources)
    sleeve = cloth.sleeve_of(mesh)
    sleeves = anatomy.limbs_of("sleeve")
    # A garment that leans in its file hangs along its own plane of symmetry.
    upright = anatomy.up if anatomy.mirror is None else anatomy.up - (anatomy.up @ anatomy.normal) * anatomy.normal
    along = sleeves[sleeve].along if 0 <= sleeve < len(sleeves) else upright
    if anatomy.kind not in TAILORED:
        # A gore, a strip: nothing but its own length says how it hangs.
        spread, axes = np.linalg.eigh(np.cov((piece.vertices - piece.vertices.mean(axis=0)).T))
        along = axes[:, 2] if spread[2] > _LONG * spread[1] else along
    facing = mesh.area_vectors.sum(axis=0)
    middle = np.average(mesh.vertices[mesh.faces].mean(axis=1), axis=0, weights=np.maximum(mesh.face_areas, 1e-300))
    count = np.bincount(mesh.vertex_of, minlength=len(cloth.vertices))
    opened = mesh.vertices[count[mesh.vertex_of] > 1]
    around = len(opened) > 0 and np.linalg.norm(facing) < 0.6 * mesh.face_areas.sum()
    if around:
        # It lies around a limb or the trunk: opposite to where it is opened.
        facing = middle - opened.mean(axis=0)
        rims = [limb for limb in anatomy.limbs if np.isin(anatomy.borders[limb.border].vertices, mesh.vertex_of).all()]
        along = rims[0].along if len(rims) == 1 and rims[0].kind == "leg" else along
    across = np.cross(along, facing)
    if np.linalg.norm(across) < 0.1 * np.linalg.norm(facing) or not facing.any():
        return piece
    try:
        if around:
            # The plane meets it on both sides.
            beyond = np.cross(across, along)
            sections = plane_sections(piece, middle, across, towards=beyond if beyond @ facing > 0.0 else -beyond)
            line = line_from_curve(piece, max(sections, key=lambda one: polyline_length(one.points)).points, name=GRAIN)
        else:
            line = line_on_plane(piece, middle, across)
    except (InputError, ValueError):
        return piece
    reach = float(np.linalg.norm(piece.vertices[line[-1]] - piece.vertices[line[0]])) if len(line) > 1 else 0.0
    if len(np.unique(line)) < len(line) or reach < 0.3 * float(np.ptp(piece.vertices @ along)):
        return piece
    return replace(piece, lines={GRAIN: np.asarray(line, dtype=np.int32)})


def _band(cloth: Cloth, mesh: PieceMesh) -> str:
    """Return what a piece is called that is a narrow strip along the waist, the neck, a sleeve's or a leg's end; "" for others."""
    area = float(mesh.face_areas.sum())
    steps = [segment_lengths(mesh.vertices[loop], closed=True) for loop in mesh.loops]
    around = float(sum(step.sum() for step in steps))
    if area > _BAND_AREA * float(cloth.face_areas.sum()) or around**2 < _BAND * area:
        return ""

    def along(role: str) -> float:
        own = has_role(cloth, mesh.vertex_of, role)
        pairs = zip(mesh.loops, steps, strict=True)
        return sum(float(step[own[loop] & own[np.roll(loop, -1)]].sum()) for loop, step in pairs)

    most = max(BANDS, key=along)
    return BANDS[most] if along(most) > _ALONG * around else ""


def _alike(pieces: Sequence[Surface]) -> list[str]:
    """Return a note on pieces that are much the same, or mirror images: a maker draws them once."""
    measures = []
    for piece in pieces:
        length = sum(polyline_length(piece.vertices[loop], closed=True) for loop in border_loops(piece.faces))
        area = flat_areas(piece.vertices, piece.faces[:, :3]).sum()
        axes = np.linalg.eigh(np.cov((piece.vertices - piece.vertices.mean(axis=0)).T))[1]
        measures.append([np.sqrt(area), length, *np.ptp(piece.vertices @ axes, axis=0)])
    left = list(range(len(pieces)))
    notes = []
    while left:
        first, *others = left
        size, around, *extents = measures[first]
        off = ALIKE * np.array([size, around, *[max(extents)] * 3])
        same = [first, *(k for k in others if (np.abs(np.subtract(measures[k], measures[first])) < off).all())]
        left = [k for k in left if k not in same]
        names = [pieces[k].name for k in same]
        if len(names) > 2 or (len(names) == 2 and names[0].startswith("piece")):
            notes.append(f"{', '.join(names)} are alike: cut {len(names)}, or some of them mirrored")
    return notes


def _edge_lines(
    piece: Surface,
    mesh: PieceMesh,
    number: int,
    names: Sequence[str],
    label: Mapping[tuple[int, ...], str],
    role: Mapping[int, str],
    beside: Mapping[tuple[int, ...], list[int]],
) -> dict[str, NDArray[np.int32]]:
    """Return the stretches of a piece's border as lines, by the seam and the piece to which each is sewn, or by its role."""
    lines: dict[str, NDArray[np.int32]] = {}
    for loop in border_loops(piece.faces):
        around = loop.tolist()
        origin = mesh.vertex_of[loop].tolist()
        keys = []
        for k, vertex in enumerate(origin):
            edge = tuple(sorted((vertex, origin[(k + 1) % len(origin)])))
            seam = label.get(edge)
            if seam is None:
                keys.append((role.get(edge[0], role.get(edge[1], "edge")), -1))
            else:
                others = [other for other in beside[edge] if other != number]
                keys.append((seam, others[0] if others else number))
        starts = [k for k in range(len(keys)) if keys[k] != keys[k - 1]]
        if not starts:
            continue
        for a, b in zip(starts, [*starts[1:], starts[0] + len(keys)], strict=True):
            run = [around[k % len(around)] for k in range(a, b + 1)]
            seam, other = keys[a]
            plain = seam.removesuffix(" left").removesuffix(" right")
            several = len({key[1] for key in keys if key[0] == seam}) > 1
            words = names[other].split("_")
            words = words[: words.index(plain)] if plain in words[1:] else words
            title = f"{plain} {words[-1]}" if several and other >= 0 else plain
            lines[find_unused_name(title, lines)] = np.array(run, dtype=np.int32)
    return lines
