"""The price of every seam, by trial: what closing it would cost, and what further seams and darts bring where cloth stays strained.

Seams that cost nothing are closed again; darts and seams that release enough are made.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from warpflat.core import (
    BoolArray,
    FloatArray,
    InputError,
    arc_lengths,
    find_unused_name,
    points_at_lengths,
    report_activity,
    two_at_a_time,
)
from warpflat.flat import (
    Fabric,
    Flattening,
    RelaxOptions,
    Surface,
    as_rigid_layout,
    border_loops,
    coarse_options,
    euler_characteristic,
    flatten,
    is_injective,
)
from warpflat.garment.construction.sew_pieces import sew_pieces
from warpflat.garment.seams.anatomy import ROLES, Anatomy
from warpflat.garment.seams.by_hand import level_of
from warpflat.garment.seams.cloth import Cloth, PieceMesh, edge_components
from warpflat.garment.seams.options import SeamOptions
from warpflat.garment.seams.solid import NARROW, SEWABLE, SOLID, LaidFlat, parts_within
from warpflat.garment.seams.symmetric import other_side
from warpflat.garment.seams.tailor import FACING, LEFT, side_word

__all__ = ["Trial", "cut_by_energy", "laid_flat"]

Ids = NDArray[np.int64]

# A dart or a seam is made if it brings this share of the whole garment's cloth back within its limit, and this share of what is beyond in
# its piece.
_WORTH, _WORTH_OF_PIECE = 0.002, 0.15
# A garment of which more than the first share is beyond the limit is parted further before darts are looked for; one of which more than the
# second is, after them.
_PARTED_FIRST, _PARTED = 0.05, 0.015
# A centimetre sewn counts as this much cloth beyond the limit [m2].
_PRICE = 1e-5
# One that brings back this share of what is beyond in its piece is taken without a look at others.
_ENOUGH = 0.5
# A dart opens by at least this [m], and its legs do not lie over each other by more than this [m2].
_MOUTH, _OVERLAP = 4e-3, 1e-5
# Of a piece so many places are looked at, and from each so many stretches of border.
_PLACES, _STRETCHES = 3, 2
# A place is looked at if it has this share of what is beyond in its piece.
_HEARD = 0.08
# Nor is a dart's mouth wider than this share of its length: such a wedge is no dart.
_WIDE = 0.6
# A piece is narrow between stretches of its border that are longer than so many times its width.
_BESIDE_NECK = 3.0
# So many of the best lines are sewn on trial: two sides that differ in length strain each other.
_SEWN_ON_TRIAL = 3
# Two ways to the border are different from this angle on [cosine].
_OTHER_WAY = 0.6
# Lengths are shares of the garment's size. A dart is between these long, and its tip a little behind the place.
_SHORTEST, _LONGEST, _BEHIND = 0.03, 0.32, 0.01
# What hangs by a neck of so many times what can be sewn hangs by less once it is sewn.
_HARDLY = 1.5
# So many lines are tried at most, mirrored ones counted once.
_MOST_TRIALS = 96
# Pieces of as many faces are the same if the sums of their coordinates agree within this [m].
_SAME = 1e-6
# A seam costs nothing if closing it brings no more than this share of the garment's cloth beyond the limit, and no more strain energy than
# this share of all, and this much [J/m2].
_NOTHING, _NO_ENERGY, _NO_DENSITY = 1.5e-3, 0.02, 1e-2
# Seams of a closed thing are alike if their lengths agree within this share.
_EQUAL = 0.015
# Seams that a garment keeps even so: it is put together at them. A leg can do without a side seam, a trunk cannot.
_STRUCTURAL = ("armhole", "inseam", "shoulder", "underarm", "side")
# Labels of faces: the number that each had when its piece was measured, and that piece's.
_FACE, _OWNER = "face before", "piece before"
# The hem of what opens in front is the lowest share of its height.
_HEM = 0.15
# The seam around the narrowest of the trunk; pieces that reach no farther above or below it, as a share of the size, are not cut.
_WAIST, _BESIDE_WAIST = "waist", 0.04
# Names of a seam on trial, and of its mirror image.
_TRIAL, _MATE = "on trial", "on trial, mirrored"
# Prices are known to this share, what is made to the second.
_PRICE_LEFT, _TRIAL_LEFT = 0.1, 0.02


@dataclass(frozen=True, kw_only=True, eq=False)
class Trial:
    """What a seam or a dart was found to do.

    Attributes:
        name: of the seam.
        released: strain energy released [J]; None where the cloth could not be laid flat without the seam.
        outside: share of the garment's cloth that it brings back within the limit.
        needed: why there is no such price: "opens a tube".
    """

    name: str
    released: float | None
    outside: float
    needed: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Candidate:
    """A line that may be cut.

    Attributes:
        name: of the seam, without its side.
        normal, point: of its plane.
        start, end: only what projects between them along the line is cut; all of the piece if start is None [m].
        parts: whether it parts the piece.
        level: of a line that parts, the field and its value there, instead of a plane.
    """

    name: str
    normal: FloatArray
    point: FloatArray
    start: FloatArray | None = None
    end: FloatArray | None = None
    parts: bool = False
    level: tuple[str, float] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class _Measured:
    """A piece, flattened coarsely; `mirrored` if it was its mirror image that was flattened.

    `mesh` is that of the cloth as it was when the piece was measured (see `_remembered`).
    """

    mesh: PieceMesh
    surface: Surface
    result: Flattening
    outside: float
    energy: float
    area: float
    place: FloatArray
    mirrored: bool = False


Prepare = Callable[[Cloth, PieceMesh], Surface]


def cut_by_energy(
    cloth: Cloth, anatomy: Anatomy, fabric: Fabric, options: SeamOptions, prepare: Prepare
) -> tuple[Cloth, list[Trial], float]:
    """Return the cloth with further seams and darts, what each of them does, and the share that is beyond the limit at the end.

    Args:
        cloth: cut by a tailor.
        anatomy: of the garment.
        fabric: the cloth's.
        options: how many pieces there may be, and how much may be beyond the limit.
        prepare: makes the surface of a piece, with its grain.
    """
    pieces = _measured(cloth, anatomy, fabric, prepare, [])
    # A tube is not measured until it is opened: there may be nothing else.
    total = sum(piece.area for piece in pieces) or 1.0
    cloth, pieces, trials = _priced(cloth, pieces, anatomy, fabric, options, prepare)
    exhausted = set[int]()
    tried = 0
    # Who asks for less beyond the limit than is usual takes what brings less.
    wished = min(options.limit / SeamOptions.limit, 1.0)
    parting = _PARTED_FIRST * total < sum(piece.outside for piece in pieces)
    most = options.most_pieces if options.most_pieces is not None else _usual_pieces(anatomy, len(pieces))
    if "hood" in cloth.seams and options.most_pieces is None:
        most += 2
    if parting and options.most_pieces is None and anatomy.open_front:
        # A jacket has two panels more, one in each sleeve.
        most += 2
    while (beyond := sum(piece.outside for piece in pieces)) > options.limit * total:
        worst = next(
            (
                piece
                for piece in sorted(pieces, key=lambda one: -one.outside)
                if not piece.mirrored and _key(piece.mesh) not in exhausted and piece.outside > wished * _WORTH * total
            ),
            None,
        )
        if worst is None and not parting and beyond > min(_PARTED, options.limit) * total:
            # Darts alone do not do.
            parting = True
            exhausted.clear()
            continue
        if worst is None or tried >= _MOST_TRIALS:
            break
        twin, now = _twin(worst, pieces, anatomy), len(pieces)
        good = list[tuple[float, _Candidate, Cloth, list[_Measured]]]()
        cloth = _remembered(cloth, pieces)
        least = max(wished * _WORTH * total * (1 if twin is None else 0.5), _WORTH_OF_PIECE * worst.outside)
        number = next(k for k, piece in enumerate(pieces) if piece is worst)
        candidates = [
            candidate
            for candidate in _candidates(cloth, worst, anatomy, options, may_part=parting and now < most)
            if not options.forbids(candidate.name)
        ]

        def on_trial(
            candidate: _Candidate, worst: _Measured = worst, twin: _Measured | None = twin, number: int = number,
            cloth: Cloth = cloth, pieces: Sequence[_Measured] = pieces, most: int = most,
        ) -> tuple[Cloth, list[_Measured]] | None:  # fmt: skip
            report_activity(f"seams: trying {candidate.name}")
            made = _cut(cloth, worst.mesh, candidate, _TRIAL)
            if made is None:
                return None
            if twin is None and _is_lopsided(candidate, anatomy):
                # Both sides of a piece are cut alike.
                target = _mesh_at(made, worst.mesh)
                both = None if target is None else _cut(made, target, _mirrored(candidate, anatomy), _MATE)
                if both is None and candidate.parts:
                    # A panel on one side alone is no tailor's.
                    return None
                made = both or made
            # Where a twin is cut alike, it adds as many.
            more = (int(made.parts.max()) + 1 - len(pieces)) * (1 if twin is None else 2)
            if candidate.name == _WAIST:
                more = len(_across(cloth, candidate, anatomy))
            if more and len(pieces) + more > most:
                return None
            try:
                return made, _measured(made, anatomy, fabric, prepare, pieces, changed={number})
            except InputError:
                return None

        for candidate, trial in zip(candidates, two_at_a_time(on_trial, candidates), strict=False):
            tried += 1
            if trial is None:
                continue
            made, new = trial
            if sum(piece.energy for piece in new) >= worst.energy:
                continue
            if not _can_be_sewn(made, candidate, worst, new, anatomy.size):
                continue
            gain = worst.outside - sum(piece.outside for piece in new)
            if gain >= least:
                good.append((gain, candidate, made, new))
                if gain >= _ENOUGH * worst.outside and not candidate.parts:
                    break
        best: tuple[float, _Candidate, Cloth, list[_Measured]] | None = None
        good.sort(key=lambda one: _value(one[0], one[2], len(one[3]) - 1), reverse=True)
        chosen = good[:_SEWN_ON_TRIAL]
        strained = two_at_a_time(lambda one: _strained_by_sewing(one[2], one[3]), chosen)
        for (gain, candidate, made, new), loss in zip(chosen, strained, strict=True):
            value = _value(gain - loss, made, len(new) - 1)
            if gain - loss >= least and (best is None or value > best[0]):
                best = value, candidate, made, new
        if best is None:
            exhausted.add(_key(worst.mesh))
            if twin is not None:
                exhausted.add(_key(twin.mesh))
            continue
        _, candidate, made, new = best
        both = anatomy.mirror is not None and (twin is not None or _is_lopsided(candidate, anatomy))
        side = 0 if not both else _side_of(worst.mesh, anatomy) if twin is not None else _beside(candidate, anatomy)
        names = [_free_name(cloth, candidate, side)]
        cloth = _renamed(made, _TRIAL, names[0])
        if both:
            names.append(_free_name(cloth, candidate, -side))
            if _MATE in cloth.seams:
                cloth = _renamed(cloth, _MATE, names[1])
            else:
                target = None if twin is None else _mesh_at(cloth, twin.mesh)
                other = None if target is None else _cut(cloth, target, _mirrored(candidate, anatomy), names[1])
                names = names if other is not None else names[:1]
                cloth = other or cloth
        if candidate.name == _WAIST:
            # Front and back have it together.
            title = _free_name(cloth, candidate, 0) if both else names[0]
            tried_on = set[int]()
            while left := [one for one in _across(cloth, candidate, anatomy) if _key(one) not in tried_on]:
                tried_on.add(_key(left[0]))
                cloth = _cut(cloth, left[0], candidate, title) or cloth
            names = [*names, *([title] if title not in names and title in cloth.seams else [])]
        before, pieces = pieces, _measured(cloth, anatomy, fabric, prepare, [*pieces, *new])
        gain = (sum(one.outside for one in before) - sum(one.outside for one in pieces)) / total
        released = sum(one.energy for one in before) - sum(one.energy for one in pieces)
        trials += [Trial(name=name, released=released / len(names), outside=gain / len(names)) for name in names]
    labels = {key: label for key, label in cloth.labels.items() if key not in (_FACE, _OWNER)}
    return replace(cloth, labels=labels), trials, sum(piece.outside for piece in pieces) / total


def _priced(
    cloth: Cloth,
    pieces: list[_Measured],
    anatomy: Anatomy,
    fabric: Fabric,
    options: SeamOptions,
    prepare: Prepare,
) -> tuple[Cloth, list[_Measured], list[Trial]]:
    """Return the cloth without seams whose price is nothing, its pieces, and what each of its seams does.

    The price of a seam is what closing it would bring: strain energy, and cloth beyond the limit. Left and right go together.
    """
    area, energy = sum(one.area for one in pieces), sum(one.energy for one in pieces)
    outside = sum(one.outside for one in pieces)
    found: dict[str, Trial] = {}

    def group_of(name: str) -> list[str]:
        """Return the seams that are closed together with one."""
        if name.startswith(SOLID):
            # What lies between equal pieces: they stay equal, and are drawn once.
            long = cloth.seam_length(name)
            alike = [one for one in cloth.seams if one.startswith(SOLID) and one != name]
            return [name, *(one for one in alike if abs(cloth.seam_length(one) - long) < _EQUAL * long)]
        mate = other_side(name)
        return [name, mate] if mate != name and mate in cloth.seams else [name]

    def of_equal_price(name: str) -> list[str]:
        return group_of(name) if anatomy.mirror is not None or name.startswith(SOLID) else [name]

    waiting = list[str]()
    for name in sorted(cloth.seams, key=lambda one: cloth.seam_length(one), reverse=True):
        if not any(one in waiting for one in of_equal_price(name)):
            waiting.append(name)
    closed = True
    while waiting and closed:
        closed = False
        cloth = _remembered(cloth, pieces)
        for name in waiting:
            found |= {
                one: Trial(name=one, released=None, outside=0.0, needed="opens a tube") for one in of_equal_price(name)
            }
        waiting = [name for name in waiting if not _opens_a_tube(cloth, [name])]
        price = partial(_without, cloth, pieces=pieces, anatomy=anatomy, fabric=fabric, prepare=prepare)
        # Until one of them is closed, no price depends on another.
        for name, (trial, new) in zip(tuple(waiting), two_at_a_time(price, [[name] for name in waiting]), strict=False):
            waiting.remove(name)
            both = group_of(name)
            found |= {one: replace(trial, name=one) for one in of_equal_price(name)}
            # What closed things are made of must lie within its limit, no more.
            most = np.inf if name.startswith(SOLID) else _NO_ENERGY * energy + _NO_DENSITY * area
            of_leg = name.startswith("side") and anatomy.kind == "trousers"
            kept = (name.startswith(_STRUCTURAL) and not of_leg) or any(options.keeps(one) for one in both)
            if kept or trial.released is None or trial.outside > _NOTHING or trial.released > most:
                continue
            # Before it is closed, it is known well: the layout of what is joined is far from rest.
            trial, new = price(both, energy_left=_TRIAL_LEFT)
            now = outside + trial.outside * area
            if (
                trial.released is None
                or _least_width(new, anatomy.size) < _least_width(pieces, anatomy.size)
                or trial.released > len(both) * most
                or now > max(outside + _NOTHING * area, options.limit * area)
            ):
                continue
            for one in both:
                cloth = cloth.without_seam(one)
                found.pop(one, None)
            pieces = _measured(cloth, anatomy, fabric, prepare, [*pieces, *new])
            outside, energy = sum(one.outside for one in pieces), sum(one.energy for one in pieces)
            waiting, closed = [one for one in waiting if one in cloth.seams], True
            break
    return cloth, pieces, [found[name] for name in cloth.seams if name in found]


def _without(
    cloth: Cloth,
    names: Sequence[str],
    *,
    pieces: Sequence[_Measured],
    anatomy: Anatomy,
    fabric: Fabric,
    prepare: Prepare,
    energy_left: float = _PRICE_LEFT,
) -> tuple[Trial, list[_Measured]]:
    """Return what seams do, by the pieces that there were without them, and those pieces that are new.

    Args:
        cloth: as the pieces remember it (see `_remembered`).
        names: of the seams.
        pieces: all of it.
        anatomy, fabric, prepare: see `cut_by_energy`.
        energy_left: how well the energy is known, as a share.
    """
    report_activity(f"seams: what {names[0]} is worth")
    needed = Trial(name=names[0], released=None, outside=0.0, needed="opens a tube")
    if _opens_a_tube(cloth, names):
        return needed, []
    closed, joined = _closed(cloth, names)
    before = [piece for number, piece in enumerate(pieces) if number in joined]
    try:
        # What costs much need not be known well: joined pieces are large, and far from rest.
        after = _measured(closed, anatomy, fabric, prepare, pieces, changed=joined, energy_left=energy_left)
    except InputError:
        return replace(needed, needed="cannot lie flat without it"), []
    if sum(one.result.overlap for one in after) > sum(one.result.overlap for one in before) + _OVERLAP:
        return replace(needed, needed="lies over itself without it"), []
    released = sum(one.energy for one in after) - sum(one.energy for one in before)
    total = sum(one.area for one in pieces)
    gain = (sum(one.outside for one in after) - sum(one.outside for one in before)) / total
    return Trial(name=names[0], released=released, outside=gain), after


def _closed(cloth: Cloth, names: Sequence[str]) -> tuple[Cloth, set[int]]:
    """Return the cloth with seams closed, and the numbers of the pieces beside them (see `_remembered`)."""
    beside = np.isin(cloth.faces, np.concatenate([cloth.seams[name] for name in names])).sum(axis=1) >= 2
    for name in names:
        cloth = cloth.without_seam(name)
    return cloth, set(cloth.labels[_OWNER][beside].tolist())


def _opens_a_tube(cloth: Cloth, names: Sequence[str]) -> bool:
    """Return whether the cloth without seams has a piece that is no disk."""
    closed, joined = _closed(cloth, names)
    return not all(_is_disk(mesh.faces) for mesh in closed.pieces(np.isin(cloth.labels[_OWNER], list(joined))))


def _remembered(cloth: Cloth, pieces: Sequence[_Measured]) -> Cloth:
    """Return the cloth with the number of each face, and of its piece, as labels, by which what is cut or joined has its old layout."""
    owner = np.full(len(cloth.faces), -1, dtype=np.int64)
    for number, piece in enumerate(pieces):
        owner[piece.mesh.face_of] = number
    return replace(cloth, labels={**cloth.labels, _FACE: np.arange(len(owner)), _OWNER: owner})


def _corners_laid(piece: _Measured, anatomy: Anatomy) -> FloatArray:
    """Return where the corners of a piece's faces lie in its layout, #F by 3 by 2 [m]."""
    faces = piece.surface.faces[:, :3]
    flat = piece.result.positions[faces]
    if not piece.mirrored:
        return flat
    there, here = piece.surface.vertices[faces], piece.mesh.vertices[piece.mesh.faces]
    there = there - 2.0 * (there @ anatomy.normal - anatomy.offset)[..., None] * anatomy.normal
    face = cKDTree(there.mean(axis=1)).query(here.mean(axis=1))[1]
    corner = np.linalg.norm(here[:, :, None] - there[face][:, None], axis=3).argmin(axis=2)
    return np.asarray(flat[face[:, None], corner] * [-1.0, 1.0])


def _layout_before(
    cloth: Cloth, mesh: PieceMesh, surface: Surface, pieces: Sequence[_Measured], anatomy: Anatomy
) -> FloatArray | None:
    """Return the layout that a piece had before it was cut, or those of two that were joined, side by side; None if there is none.

    Each vertex lies in its face as it did: both sides of a new cut lie on each other.
    """
    if _OWNER not in cloth.labels or (cloth.labels[_OWNER][mesh.face_of] < 0).any():
        return None
    owner, face = cloth.labels[_OWNER][mesh.face_of], cloth.labels[_FACE][mesh.face_of]
    numbers, areas = np.unique(owner), np.bincount(owner, cloth.face_areas[mesh.face_of])
    laid = np.full((len(mesh.vertices), 2), np.nan)
    for number in sorted(numbers.tolist(), key=lambda one: -areas[one]):
        old, chosen = pieces[number], owner == number
        place = np.searchsorted(old.mesh.face_of, face[chosen])
        a, b, c = old.mesh.vertices[old.mesh.faces[place]].transpose(1, 0, 2)
        way = mesh.vertices[mesh.faces[chosen]] - a[:, None]
        ab, ac = b - a, c - a
        # Barycentric coordinates in the plane of the face.
        uu, uv, vv = (np.einsum("ij,ij->i", p, q)[:, None] for p, q in ((ab, ab), (ab, ac), (ac, ac)))
        wu, wv = np.einsum("ikj,ij->ik", way, ab), np.einsum("ikj,ij->ik", way, ac)
        least = np.maximum(uu * vv - uv * uv, 1e-30)
        share = np.stack([(vv * wu - uv * wv) / least, (uu * wv - uv * wu) / least], axis=2)
        share = np.concatenate([1.0 - share.sum(axis=2, keepdims=True), share], axis=2)
        corners = np.einsum("ikj,ijd->ikd", share, _corners_laid(old, anatomy)[place]).reshape(-1, 2)
        # Of the faces at a vertex, the one in which it lies the deepest.
        at, depth = mesh.faces[chosen].ravel(), share.min(axis=2).ravel()
        order = np.lexsort((-depth, at))
        vertices, first = np.unique(at[order], return_index=True)
        own = corners[order[first]]
        both = np.isfinite(laid[vertices, 0])
        if np.isfinite(laid).any():
            if both.sum() < 2:
                return None
            # It is turned and shifted onto the others along what they share.
            here, there = own[both], laid[vertices[both]]
            middle, goal = here.mean(axis=0), there.mean(axis=0)
            u, _, v = np.linalg.svd((here - middle).T @ (there - goal))
            turn = u @ np.diag([1.0, np.sign(np.linalg.det(u @ v))]) @ v
            own = (own - middle) @ turn + goal
            own[both] = 0.5 * (own[both] + there)
        laid[vertices] = own
    p = laid[mesh.faces]
    double = (p[:, 1, 0] - p[:, 0, 0]) * (p[:, 2, 1] - p[:, 0, 1]) - (p[:, 1, 1] - p[:, 0, 1]) * (
        p[:, 2, 0] - p[:, 0, 0]
    )
    if len(numbers) == 1 and (np.all(double > 0.0) or np.all(double < 0.0)):
        return laid
    unfolded = as_rigid_layout(surface, laid)
    return unfolded if unfolded is not None and is_injective(surface, unfolded) else None


def _is_disk(faces: Ids) -> bool:
    return euler_characteristic(faces.astype(np.int32)) == 1 and len(border_loops(faces.astype(np.int32))) == 1


def _usual_pieces(anatomy: Anatomy, now: int) -> int:
    """Return how many pieces a tailor would cut at most."""
    return max(now, {"top": 6, "dress": 6, "skirt": 4, "trousers": 4, "jumpsuit": 12, "sleeve": 2}.get(anatomy.kind, 8))


def _measured(
    cloth: Cloth,
    anatomy: Anatomy,
    fabric: Fabric,
    prepare: Prepare,
    known: Sequence[_Measured],
    *,
    changed: Collection[int] | None = None,
    energy_left: float = _TRIAL_LEFT,
) -> list[_Measured]:
    """Return the pieces, flattened coarsely; those that are as they were are taken over, and mirror images are flattened once.

    The energy is right to a share of `energy_left`, from above.

    Args:
        cloth: cut.
        anatomy, fabric, prepare: see `cut_by_energy`.
        known: pieces that are known, first those by whose numbers the cloth is labelled (see `_remembered`).
        changed: only what was of the pieces of these numbers is returned; all if not given.
        energy_left: how well the energy is known, as a share.

    Raises:
        InputError: a piece cannot be flattened.
    """
    trial_options = _trial_options(energy_left)
    axes = np.stack([anatomy.normal, anatomy.up, anatomy.front], axis=1)
    found: list[_Measured] = []
    for mesh in cloth.pieces(None if changed is None else np.isin(cloth.labels[_OWNER], list(changed))):
        # By the sums of their coordinates in the garment's own axes: those of a mirror image differ in one sign.
        place = (mesh.vertices @ axes - [anatomy.offset, 0.0, 0.0]).sum(axis=0)
        alike = [one for one in (*known, *found) if len(one.mesh.faces) == len(mesh.faces)]
        same = next((one for one in alike if np.abs(one.place - place).max() < _SAME), None)
        if same is not None:
            found.append(replace(same, mesh=mesh))
            continue
        image = place * [-1.0, 1.0, 1.0]
        same = next((one for one in alike if not one.mirrored and np.abs(one.place - image).max() < _SAME), None)
        if same is not None and anatomy.mirror is not None:
            found.append(replace(same, mesh=mesh, place=place, mirrored=True))
            continue
        surface = prepare(cloth, mesh)
        if not _is_disk(mesh.faces):
            # A tube is opened when all seams are known.
            continue
        datum = "grain" if "grain" in surface.lines else None
        start = _layout_before(cloth, mesh, surface, known, anatomy)
        result = flatten(surface, fabric=fabric, datum=datum, start=start, relax=trial_options)
        fit = result.fit
        area = float(fit.area.sum())
        found.append(
            _Measured(
                mesh=mesh,
                surface=surface,
                result=result,
                outside=fit.outside * area,
                energy=result.layout_measures["strain_energy_j"],
                area=area,
                place=place,
            )
        )
    return found


def laid_flat(surface: Surface, fabric: Fabric, width: float) -> LaidFlat:
    """Return what becomes of a piece that is laid flat coarsely.

    Args:
        surface: of the piece, a disk.
        fabric: the cloth's.
        width: see `_narrowest` [m].

    Returns:
        What it is; all of it is beyond its limit where it cannot be laid flat.
    """
    try:
        datum = "grain" if "grain" in surface.lines else None
        result = flatten(surface, fabric=fabric, datum=datum, relax=_trial_options(_PRICE_LEFT))
    except InputError:
        return LaidFlat(outside=1.0, overlap=0.0, width=width)
    least, ends = _narrowest(surface, result.positions, max(width, SEWABLE))
    neck = surface.vertices[ends] if len(ends) and parts_within(surface.faces, result.positions, SEWABLE) > 1 else None
    return LaidFlat(outside=result.fit.outside, overlap=result.overlap, width=min(least, width), neck=neck)


def _can_be_sewn(
    cloth: Cloth, candidate: _Candidate, before: _Measured, after: Sequence[_Measured], size: float
) -> bool:
    """Return whether nothing lies over itself that did not before, a dart opens wide enough and not too wide, a piece is nowhere narrow.

    Beside a dart's mouth its piece is narrow, and may be: what counts is that it hangs together around the tip.
    """
    if sum(piece.result.overlap for piece in after) > before.result.overlap + _OVERLAP:
        return False
    if candidate.parts:
        return _least_width(after, size) >= _least_width([before], size)
    # A flap that hangs by what is hardly sewn counts while it is small, too.
    for necks in ((NARROW * size,), (_HARDLY * SEWABLE, 0.005)):
        before_it, *after_it = (
            parts_within(one.surface.faces, one.result.positions, *necks) for one in (before, *after)
        )
        if max(after_it) > before_it:
            return False
    line = np.unique(cloth.seams[_TRIAL])
    widest = 0.0
    for piece in after:
        own = piece.mesh.vertex_of
        order = np.argsort(own, kind="stable")
        twice = np.flatnonzero((own[order][1:] == own[order][:-1]) & np.isin(own[order][1:], line))
        if len(twice):
            gap = piece.result.positions[order[twice]] - piece.result.positions[order[twice + 1]]
            widest = max(widest, float(np.linalg.norm(gap, axis=1).max()))
    return _MOUTH <= widest <= _WIDE * cloth.seam_length(_TRIAL)


def _trial_options(energy_left: float) -> RelaxOptions:
    """Return options that tell good from bad, no more; what is left is estimated at every step, and checked where it is little."""
    return replace(coarse_options(), energy_left=energy_left, outline_left_mm=100.0 * energy_left, check_every=100)


def _strained_by_sewing(cloth: Cloth, pieces: Sequence[_Measured]) -> float:
    """Return how much more of the cloth is beyond its limit where the pieces beside a line on trial are sewn along it [m2]."""
    beside = [one for one in pieces if not one.mirrored and len(_edges_of(one, cloth.seams[_TRIAL]))]
    flat = [
        replace(one.result, surface=replace(one.result.surface, name=f"piece {number}"))
        for number, one in enumerate(beside)
    ]
    sewn = sew_pieces(flat, options=_trial_options(_TRIAL_LEFT), eased=True).pieces.values()
    return sum(piece.fit.outside * one.area for piece, one in zip(sewn, beside, strict=True)) - sum(
        one.outside for one in beside
    )


def _edges_of(piece: _Measured, seam: Ids) -> Ids:
    """Return those edges of a seam of the cloth (#E by 2) that are a piece's border, as its own vertices."""
    stride = np.int64(max(seam.max(), piece.mesh.vertex_of.max()) + 1)
    loop = border_loops(piece.surface.faces)[0].astype(np.int64)
    edges = np.stack([loop, np.roll(loop, -1)], axis=1)
    own = np.sort(piece.mesh.vertex_of[edges], axis=1)
    return np.asarray(edges[np.isin(own[:, 0] * stride + own[:, 1], seam[:, 0] * stride + seam[:, 1])])


def _narrowest(surface: Surface, flat: FloatArray, width: float) -> tuple[float, Ids]:
    """Return the least width of a pattern between stretches of its border that are long compared with a width [m]; that width at most.

    Returns:
        The width, and the two vertices between which it is; none where it is not less.
    """
    from matplotlib.path import Path as Outline

    border = border_loops(surface.faces)[0].astype(np.int64)
    loop = flat[border]
    arc = arc_lengths(np.concatenate([loop, loop[:1]]))
    count = int(np.clip(4.0 * arc[-1] / width, 24, 400))
    at = np.arange(count) * arc[-1] / count
    points = points_at_lengths(np.concatenate([loop, loop[:1]]), at)
    apart = np.abs(at[:, None] - at)
    around = np.minimum(apart, arc[-1] - apart)
    distance = np.linalg.norm(points[:, None] - points, axis=2)
    one, other = np.nonzero((around > _BESIDE_NECK * width) & (distance < width))
    # Across an open dart or a concave corner there is no cloth.
    inside = Outline(points).contains_points(0.5 * (points[one] + points[other]))
    across = distance[one, other][inside]
    if len(across) == 0:
        return width, np.empty(0, dtype=np.int64)
    least = int(across.argmin())
    ends = points[[one[inside][least], other[inside][least]]]
    return float(across[least]), border[np.linalg.norm(loop - ends[:, None], axis=2).argmin(axis=1)]


def _least_width(pieces: Sequence[_Measured], size: float) -> float:
    """Return the least width of some patterns in a garment of a size [m]; what nobody calls narrow at most."""
    width = NARROW * size
    return min((_narrowest(one.surface, one.result.positions, width)[0] for one in pieces), default=width)


def _key(mesh: PieceMesh) -> int:
    """Return a number by which a piece is known while others are cut: its area and place, rounded."""
    middle = mesh.vertices[mesh.faces].mean(axis=1).mean(axis=0)
    return hash((len(mesh.faces), tuple(np.round(middle, 4).tolist())))


def _side_of(mesh: PieceMesh, anatomy: Anatomy) -> int:
    return 1 if float((mesh.vertices @ anatomy.normal).mean()) - anatomy.offset > 0.0 else -1


def _twin(piece: _Measured, pieces: Sequence[_Measured], anatomy: Anatomy) -> _Measured | None:
    """Return the piece that mirrors another one; None where there is none, or it mirrors itself."""
    if anatomy.mirror is None:
        return None
    middle = piece.mesh.vertices[piece.mesh.faces].mean(axis=(0, 1))
    across = float(middle @ anatomy.normal) - anatomy.offset
    if abs(across) < 0.04 * anatomy.size:
        return None
    image = middle - 2.0 * across * anatomy.normal
    others = [one for one in pieces if one is not piece]
    if not others:
        return None
    away = [float(np.linalg.norm(one.mesh.vertices[one.mesh.faces].mean(axis=(0, 1)) - image)) for one in others]
    nearest = others[int(np.argmin(away))]
    return nearest if min(away) < 0.06 * anatomy.size and abs(nearest.area / piece.area - 1.0) < 0.25 else None


def _candidates(
    cloth: Cloth, piece: _Measured, anatomy: Anatomy, options: SeamOptions, *, may_part: bool
) -> Iterator[_Candidate]:
    """Yield lines that may relieve a piece: a seam across the garment through the place, and darts from the borders near it."""
    surface, size = piece.surface, anatomy.size
    triangles = surface.vertices[surface.faces[:, :3]]
    facing = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    misfits = piece.result.fit.misfits
    heights = surface.vertices @ anatomy.up
    across = surface.vertices @ anatomy.normal - anatomy.offset
    sleeve = "sleeve" in cloth.labels and int(np.median(cloth.labels["sleeve"][piece.mesh.face_of])) >= 0
    whole = across.min() < -0.08 * size and across.max() > 0.08 * size
    ahead = float((facing @ anatomy.front).sum()) > 0.0
    if may_part and not sleeve and misfits:
        if whole:
            name = "centre front" if ahead else "centre back"
            yield _Candidate(name=name, normal=anatomy.normal, point=anatomy.offset * anatomy.normal, parts=True)
        tall = float(np.ptp(heights))
        level = float(np.average(heights[[m.relieved_at for m in misfits]], weights=[m.area for m in misfits]))
        name, waist = "yoke", None
        if anatomy.kind in ("top", "dress", "jumpsuit") and (tall > 0.8 * size or options.waist is not None):
            # Where the body has it, or the trunk is narrowest.
            waist = level_of(cloth, anatomy, _WAIST, options)
        if waist is not None and 0.2 * tall < waist - heights.min() < 0.8 * tall:
            name, level = _WAIST, waist
        known = [edges for other, edges in cloth.seams.items() if other.startswith(name)]
        if known:
            # Front and back meet at the sides.
            level = float((cloth.vertices[np.unique(known[0])] @ anatomy.up).mean())
        if 0.2 * tall < level - heights.min() < 0.8 * tall and tall > 0.5 * size:
            yield _Candidate(
                name=name,
                normal=anatomy.up,
                point=level * anatomy.up,
                parts=True,
            )
    if may_part and misfits:
        # Further lines of the families to which centre and side belong: through the place that is strained the most, and half way.
        place = max(misfits, key=lambda one: one.area).relieved_at
        at = int(piece.mesh.vertex_of[place])
        for field, name in ((LEFT, "princess"), (FACING, "panel")):
            if field not in cloth.values or (sleeve and field == LEFT):
                continue
            own = cloth.values[field][piece.mesh.vertex_of]
            low, high = np.quantile(own, [0.15, 0.85])
            half = own[own > 0.0] if whole and field == LEFT else own
            for value in (float(cloth.values[field][at]), float(np.median(half))):
                if low < value < high and (field == FACING or not whole or abs(across[place]) > 0.04 * size):
                    yield _Candidate(
                        name=name,
                        normal=anatomy.normal,
                        point=surface.vertices[place],
                        parts=True,
                        level=(field, value),
                    )
    loop = border_loops(surface.faces)[0]
    rim = surface.vertices[loop]
    hem = _at_hem(cloth, piece.mesh.vertex_of[loop], anatomy)
    normals = facing / np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-300)
    heard = sum(misfit.area for misfit in misfits)
    for misfit in sorted(misfits, key=lambda one: -one.area)[:_PLACES]:
        if misfit.area < _HEARD * heard:
            continue
        place = surface.vertices[misfit.relieved_at]
        beside = (surface.faces[:, :3] == misfit.relieved_at).any(axis=1)
        normal = normals[beside].mean(axis=0)
        away = np.where(hem, np.inf, np.linalg.norm(rim - place, axis=1))
        if not np.isfinite(away).any():
            continue
        # The nearest places of the border, each in another direction.
        nearest = list[int]()
        open_to = ~hem
        directions = (rim - place) / np.maximum(np.linalg.norm(rim - place, axis=1), 1e-300)[:, None]
        while open_to.any() and len(nearest) < _STRETCHES:
            k = int(np.where(open_to, away, np.inf).argmin())
            nearest.append(k)
            open_to &= directions @ directions[k] < _OTHER_WAY
        for k in nearest:
            length = float(away[k])
            if not _SHORTEST * size < length < _LONGEST * size:
                # A place at the border is reached from there: inwards by a hand.
                continue
            way = (place - rim[k]) / length
            flat = np.cross(way, normal)
            tip = place + _BEHIND * size * way
            if np.linalg.norm(flat) < 0.3:
                continue
            yield _Candidate(
                name="dart",
                normal=flat / np.linalg.norm(flat),
                point=rim[k],
                start=rim[k],
                end=tip,
                parts=False,
            )
        if away.min() < _SHORTEST * size:
            k = int(away.argmin())
            middle = triangles.mean(axis=1)
            near = np.linalg.norm(middle - rim[k], axis=1) < 0.08 * size
            if not near.any():
                continue
            inwards = middle[near].mean(axis=0) - rim[k]
            far = float(np.linalg.norm(inwards))
            if far < 1e-6 * size:
                continue
            way = inwards / far
            flat = np.cross(way, normal)
            if np.linalg.norm(flat) < 0.3:
                continue
            for reach in (0.06, 0.11):
                yield _Candidate(
                    name="dart",
                    normal=flat / np.linalg.norm(flat),
                    point=rim[k],
                    start=rim[k],
                    end=rim[k] + reach * size * way,
                    parts=False,
                )


def _across(cloth: Cloth, candidate: _Candidate, anatomy: Anatomy) -> list[PieceMesh]:
    """Return the pieces of the trunk that a plane parts well inside."""
    sleeve = cloth.labels.get("sleeve", np.full(len(cloth.faces), -1))
    beside = _BESIDE_WAIST * anatomy.size
    found = []
    for mesh in cloth.pieces():
        height = (mesh.vertices - candidate.point) @ candidate.normal
        if np.median(sleeve[mesh.face_of]) < 0 and height.min() < -beside and height.max() > beside:
            found.append(mesh)
    return found


def _at_hem(cloth: Cloth, vertices: Ids, anatomy: Anatomy) -> BoolArray:
    """Return which vertices are at a free end below: a hem, the end of a sleeve or a leg, the lower end of an opening in front.

    No dart begins there: what hangs is shaped from above.
    """
    if "role" not in cloth.values:
        return np.zeros(len(vertices), dtype=bool)
    role = np.round(cloth.values["role"][vertices])
    heights = cloth.vertices @ anatomy.up
    low = heights[vertices] < heights.min() + _HEM * np.ptp(heights)
    ends = np.isin(role, [1 + ROLES.index(name) for name in ("hem", "sleeve", "leg")])
    return np.asarray(ends | (low & (role == 1 + ROLES.index("opening"))))


def _is_lopsided(candidate: _Candidate, anatomy: Anatomy) -> bool:
    """Return whether a line has a mirror image that is another one."""
    if anatomy.mirror is None or (candidate.start is None and candidate.level is None):
        return False
    # A line around the front runs on both sides, wherever its place is.
    around = candidate.level is not None and candidate.level[0] == FACING
    return around or abs(_beside(candidate, anatomy)) > 0.03 * anatomy.size


def _beside(candidate: _Candidate, anatomy: Anatomy) -> float:
    return float(candidate.point @ anatomy.normal) - anatomy.offset


def _mirrored(candidate: _Candidate, anatomy: Anatomy) -> _Candidate:
    """Return the mirror image of a line."""
    n, d = anatomy.normal, anatomy.offset
    level = candidate.level
    if level is not None and level[0] == LEFT:
        level = LEFT, -level[1]

    def image(point: FloatArray | None) -> FloatArray | None:
        return None if point is None else point - 2.0 * (float(point @ n) - d) * n

    point = image(candidate.point)
    assert point is not None
    normal = candidate.normal - 2.0 * float(candidate.normal @ n) * n
    start, end = image(candidate.start), image(candidate.end)
    return replace(candidate, normal=normal, point=point, start=start, end=end, level=level)


def _cut(cloth: Cloth, mesh: PieceMesh, candidate: _Candidate, name: str) -> Cloth | None:
    """Return the cloth with a line cut in one piece; None where the line does not run as it should.

    A dart begins at the border of the piece and ends inside; a seam parts the piece in two.
    """
    own = np.zeros(len(cloth.faces), dtype=bool)
    own[mesh.face_of] = True
    if candidate.level is None:
        field = (cloth.vertices - candidate.point) @ candidate.normal
    else:
        field = cloth.values[candidate.level[0]] - candidate.level[1]
    cloth = replace(cloth, values={**cloth.values, "trial": field})
    if candidate.start is not None and candidate.end is not None:
        way = candidate.end - candidate.start
        along = (cloth.vertices - candidate.start) @ way / float(way @ way)
        beside = np.linalg.norm(cloth.vertices - candidate.start - np.clip(along, 0.0, 1.0)[:, None] * way, axis=1)
        # Cloth that lies elsewhere in the same plane, such as the other side of a tube, is not meant.
        near = beside < 0.5 * float(np.linalg.norm(way))
        reached = _reached_within(cloth, own & near[cloth.faces].any(axis=1), candidate.start)
        # The tip lies where it is meant to, not where the next edge is: on both sides of a garment alike.
        corners = field[cloth.faces]
        through = reached & (corners.min(axis=1) < 0.0) & (corners.max(axis=1) > 0.0)
        cloth = replace(
            cloth,
            values={**cloth.values, "tip": along - 1.0},
            labels={**cloth.labels, "own": reached.astype(np.int64)},
        )
        cloth, beyond = cloth.split("tip", through)
        own = (cloth.labels["own"] > 0) & ~beyond
    labels = {**cloth.labels, "own": own.astype(np.int64)}
    made, positive = replace(cloth, labels=labels).split("trial", own)
    within = made.labels["own"] > 0
    lines = made.line_between(positive, within)
    if len(lines) == 0:
        return None
    before = {tuple(edge) for edge in made.seam_edges().tolist()}
    lines = np.array([edge for edge in lines.tolist() if tuple(edge) not in before], dtype=np.int64).reshape(-1, 2)
    if len(lines) == 0:
        return None
    he = made.half_edges
    outside = set(np.unique(he.edges[he.count == 1]).tolist()) | set(np.unique(made.seam_edges()).tolist())
    for part in sorted(edge_components(lines), key=len, reverse=True)[:1]:
        vertices, counts = np.unique(part, return_counts=True)
        ends = vertices[counts == 1]
        if (counts > 2).any() or len(ends) != 2:
            return None
        at_border = [int(v) in outside for v in ends]
        inner = vertices[counts == 2]
        if any(int(v) in outside for v in inner) or sum(at_border) != (2 if candidate.parts else 1):
            return None
        kept = {key: value for key, value in made.values.items() if key not in ("trial", "tip")}
        marks = {key: label for key, label in made.labels.items() if key != "own"}
        return replace(made, values=kept, labels=marks).with_seam(name, part)
    return None


def _reached_within(cloth: Cloth, allowed: BoolArray, start: FloatArray) -> BoolArray:
    """Return #F, the allowed faces that hang together with the one nearest to a place."""
    from warpflat.flat import components

    chosen = np.flatnonzero(allowed)
    found = np.zeros(len(cloth.faces), dtype=bool)
    if len(chosen) == 0:
        return found
    part = components(cloth.faces[chosen].astype(np.int32), barrier=cloth.seam_edges().astype(np.int32))
    middle = cloth.vertices[cloth.faces[chosen]].mean(axis=1)
    first = int(np.linalg.norm(middle - start, axis=1).argmin())
    found[chosen[part == part[first]]] = True
    return found


def _mesh_at(cloth: Cloth, mesh: PieceMesh) -> PieceMesh | None:
    """Return the piece of the cloth that lies where another one did."""
    middle = mesh.vertices[mesh.faces].mean(axis=(0, 1))
    meshes = list(cloth.pieces())
    away = [float(np.linalg.norm(one.vertices[one.faces].mean(axis=(0, 1)) - middle)) for one in meshes]
    return meshes[int(np.argmin(away))] if meshes else None


def _value(gain: float, cloth: Cloth, more: int) -> float:
    """Return what a line on trial is worth: what it brings [m2], less its price, for each piece more; pieces are few."""
    length = sum(cloth.seam_length(name) for name in (_TRIAL, _MATE) if name in cloth.seams)
    return (gain - _PRICE * 100.0 * length) / max(more, 1)


def _renamed(cloth: Cloth, old: str, new: str) -> Cloth:
    return replace(cloth, seams={new if key == old else key: edges for key, edges in cloth.seams.items()})


def _free_name(cloth: Cloth, candidate: _Candidate, side: float) -> str:
    """Return an unused name of a seam or a dart, with its side: positive left, negative right."""
    word = "" if side == 0.0 else f" {side_word(side)}"
    return find_unused_name(f"{candidate.name}{word}", cloth.seams)
