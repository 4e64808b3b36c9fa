"""Where a whole garment is cut further, and where it need not be cut, by what each seam brings in the laid cloth.

Seams that cost nothing are closed again. Then one search, as long as too much cloth is beyond its limits: lines through what stays strained
(`lines`), the price of each without a trial, the best of all pieces on trial, both sides of the garment alike.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from warpflat.core import InputError, find_unused_name, other_side, report_activity
from warpflat.flat import LEAST_MOUTH, TRIED, Fabric, Flattening, Surface
from warpflat.garment.seams.anatomy import Anatomy
from warpflat.garment.seams.cloth import ALIKE, Cloth, PieceMesh, edge_components
from warpflat.garment.seams.lines import APART, WAIST, WIDE, Line, Offer, first_of_equals, offers
from warpflat.garment.seams.measure import (
    OWNER,
    PRICE_LEFT,
    TRIAL_LEFT,
    Measure,
    Measured,
    least_width,
    measured,
    remembered,
    without_memory,
)
from warpflat.garment.seams.options import SeamOptions
from warpflat.garment.seams.solid import NARROW, OVERLAP, SEWABLE, SOLID, parts_within
from warpflat.garment.seams.tailor import side_word
from warpflat.pattern import two_at_a_time

__all__ = ["Trial", "cut_by_energy"]

Ids = NDArray[np.int64]

# A dart or a seam is made if it brings this share of the whole garment's cloth back within its limits; before seams are looked for, too,
# a dart brings this share of what is beyond in its piece: a small one first would be in the way of a seam.
_WORTH, _WORTH_ALONE = 0.002, 0.15
# A seam costs nothing if closing it brings no more cloth beyond the limit than one that is made must bring back, and no more strain energy
# than this for all of the cloth [J/m2].
_NO_ENERGY = 1e-2
# So many pieces a tailor cuts at most.
_USUAL = {"top": 6, "dress": 6, "skirt": 4, "trousers": 4, "jumpsuit": 12, "sleeve": 2}
# Seams that a garment keeps even so: it is put together at them. A leg can do without a side seam, a trunk cannot.
_STRUCTURAL = ("armhole", "inseam", "shoulder", "underarm", "side")
# Names of a seam on trial, and of its mirror image.
_TRIAL, _MATE = "on trial", "on trial, mirrored"


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


def cut_by_energy(
    cloth: Cloth,
    anatomy: Anatomy,
    fabric: Fabric,
    options: SeamOptions,
    prepare: Callable[[Cloth, PieceMesh], Surface],
) -> tuple[Cloth, list[Trial]]:
    """Return the cloth with further seams and darts, and what each of them does.

    Args:
        cloth: cut by a tailor.
        anatomy: of the garment.
        fabric: the cloth's.
        options: how many pieces there may be, and how much may be beyond the limit.
        prepare: makes the surface of a piece, with its grain.
    """
    measure = partial(measured, anatomy=anatomy, fabric=fabric, prepare=prepare)
    pieces = measure(cloth, [])
    # A tube is not measured until it is opened: there may be nothing else.
    total = sum(piece.area for piece in pieces) or 1.0
    cloth, pieces, trials = _closed_for_nothing(cloth, pieces, anatomy, options, measure)
    # Who asks for less beyond the limit than is usual takes what brings less.
    least = _WORTH * min(options.limit / SeamOptions.limit, 1.0) * total
    # Two more pieces for a hood, and two in the sleeves of what opens in front.
    usual = max(len(pieces), _USUAL.get(anatomy.kind, 8)) + 2 * (("hood" in cloth.seams) + anatomy.open_front)
    most = usual if options.most_pieces is None else options.most_pieces
    # What is laid out stays as it is until it is cut.
    known = dict[Flattening, list[Offer]]()
    parting = False
    while (beyond := sum(piece.outside for piece in pieces)) > options.limit * total:
        cloth = remembered(cloth, pieces)
        twins = {number: _twin(number, pieces, anatomy) for number, piece in enumerate(pieces) if not piece.mirrored}
        floor = dict[int, float]()
        for number, twin in twins.items():
            laid, strained = pieces[number].result, pieces[number].outside * (1 if twin is None else 2)
            floor[number] = least if parting else max(least, _WORTH_ALONE * strained)
            if laid not in known and strained > least:
                report_activity("seams: lines are priced")
                known[laid] = offers(cloth, pieces[number], anatomy, options, twice=twin is not None, may_part=parting)
        best: tuple[float, Line, float, Cloth, list[Measured]] | None = None
        tried = 0
        # Offers are tried in the order of their prices. Most promise more than they hold, so the first that is worth more than the
        # promise of the next is the best. What was tried is known by its worth from then on, and forgotten if it cannot be made.
        while best is None or tried < TRIED:
            waiting = [
                (number, offer)
                for number in twins
                for offer in known.get(pieces[number].result, ())
                if offer.gain >= floor[number] and (best is None or offer.line is not best[1])
            ]
            order = first_of_equals(np.array([offer.value for _, offer in waiting]))
            if not len(order) or (best is not None and best[0] >= waiting[order[0]][1].value):
                break
            number, offer = waiting[order[0]]
            report_activity(f"seams: trying {offer.line.name}")
            left = known[pieces[number].result]
            left.remove(offer)
            trial = _drawn(cloth, pieces, number, twins[number], offer.line, anatomy)
            if trial is None or int(trial[0].parts.max()) >= max(most, int(cloth.parts.max()) + 1):
                continue
            tried += 1
            made, changed = trial
            before = [pieces[one] for one in changed]
            try:
                new = measure(made, pieces, changed=changed)
            except InputError:
                continue
            if not _can_be_sewn(made, offer.line, before, new, anatomy.size):
                continue
            gain = sum(one.outside for one in before) - sum(one.outside for one in new)
            if gain >= floor[number]:
                left.append(replace(offer, gain=gain))
                if best is None or left[-1].value > best[0]:
                    side = offer.line.beside(anatomy)
                    if twins[number] is not None:
                        side = float(anatomy.across(pieces[number].mesh.vertices).mean())
                    best = left[-1].value, offer.line, side, made, new
        if best is None:
            if parting:
                break
            # Darts alone do not do.
            parting, known = True, {}
            continue
        _, line, side, cloth, new = best
        names = list[str]()
        for name, sign in ((_TRIAL, 1.0), (_MATE, -1.0)):
            if name in cloth.seams:
                word = f" {side_word(sign * side)}" if _MATE in best[3].seams else ""
                names.append(find_unused_name(f"{line.name}{word}", cloth.seams))
                cloth = cloth.without_seam(name).with_seam(names[-1], cloth.seams[name])
        old, pieces = pieces, measure(cloth, [*pieces, *new])
        gain = (beyond - sum(one.outside for one in pieces)) / total
        released = sum(one.energy for one in old) - sum(one.energy for one in pieces)
        trials += [Trial(name=name, released=released / len(names), outside=gain / len(names)) for name in names]
    return without_memory(cloth), trials


def _drawn(
    cloth: Cloth, pieces: Sequence[Measured], number: int, twin: int | None, line: Line, anatomy: Anatomy
) -> tuple[Cloth, set[int]] | None:
    """Return the cloth with a line cut on both sides alike, and the numbers of the pieces that it cuts; None where it does not run.

    Args:
        cloth: as the pieces remember it (see `remembered`).
        pieces: all of it.
        number, twin: of the piece that is cut, and of its mirror image, if that is another one.
        line: to cut along.
        anatomy: of the garment.
    """
    made, changed = _cut(cloth, pieces[number].mesh, line, _TRIAL), {number}
    if made is None:
        return None
    if line.name == WAIST:
        # It goes all around, through the pieces of the trunk that its plane parts well inside.
        beside = APART * anatomy.size
        for other in sorted(set(range(len(pieces))) - changed):
            crossed = [
                mesh
                for mesh in made.pieces(made.labels[OWNER] == other)
                if made.sleeve_of(mesh) < 0
                and (height := (mesh.vertices - line.point) @ line.normal).min() < -beside
                and height.max() > beside
            ]
            for mesh in crossed:
                changed.add(other)
                made = _cut(made, mesh, line, _TRIAL) or made
    elif twin is not None or line.is_lopsided(anatomy):
        targets = made.pieces(made.labels[OWNER] == (number if twin is None else twin))
        both = next(filter(None, (_cut(made, mesh, line.mirrored(anatomy), _MATE) for mesh in targets)), None)
        if both is None:
            # A panel on one side alone is no tailor's.
            return None if line.parts else (made, changed)
        made, changed = both, changed | ({twin} if twin is not None else set())
    return made, changed


def _closed_for_nothing(
    cloth: Cloth, pieces: list[Measured], anatomy: Anatomy, options: SeamOptions, measure: Measure
) -> tuple[Cloth, list[Measured], list[Trial]]:
    """Return the cloth without seams whose price is nothing, its pieces, and what each of its seams does.

    The price of a seam is what closing it would bring: strain energy, and cloth beyond the limit. Left and right go together.
    """
    area = sum(one.area for one in pieces)
    outside = sum(one.outside for one in pieces)
    found: dict[str, Trial] = {}

    def group_of(name: str) -> list[str]:
        """Return the seams that are closed together with one."""
        if name.startswith(SOLID):
            # What lies between equal pieces: they stay equal, and are drawn once.
            long = cloth.seam_length(name)
            alike = [one for one in cloth.seams if one.startswith(SOLID) and one != name]
            return [name, *(one for one in alike if abs(cloth.seam_length(one) - long) < ALIKE * long)]
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
        cloth = remembered(cloth, pieces)
        for name in waiting:
            found |= {
                one: Trial(name=one, released=None, outside=0.0, needed="opens a tube") for one in of_equal_price(name)
            }
        waiting = [name for name in waiting if not _opens_a_tube(cloth, [name])]
        price = partial(_without, cloth, pieces=pieces, measure=measure)
        # Until one of them is closed, no price depends on another.
        for name, (trial, new) in zip(tuple(waiting), two_at_a_time(price, [[name] for name in waiting]), strict=False):
            waiting.remove(name)
            both = group_of(name)
            found |= {one: replace(trial, name=one) for one in of_equal_price(name)}
            # What closed things are made of must lie within its limit, no more.
            most = np.inf if name.startswith(SOLID) else _NO_ENERGY * area
            of_leg = name.startswith("side") and anatomy.kind == "trousers"
            kept = (name.startswith(_STRUCTURAL) and not of_leg) or any(options.keeps(one) for one in both)
            if kept or trial.released is None or trial.outside > _WORTH or trial.released > most:
                continue
            # Before it is closed, it is known well: the layout of what is joined is far from rest.
            trial, new = price(both, energy_left=TRIAL_LEFT)
            now = outside + trial.outside * area
            if (
                trial.released is None
                or least_width(new, anatomy.size) < least_width(pieces, anatomy.size)
                or trial.released > len(both) * most
                or now > max(outside + _WORTH * area, options.limit * area)
            ):
                continue
            for one in both:
                cloth = cloth.without_seam(one)
                found.pop(one, None)
            pieces = measure(cloth, [*pieces, *new])
            outside = sum(one.outside for one in pieces)
            waiting, closed = [one for one in waiting if one in cloth.seams], True
            break
    return cloth, pieces, [found[name] for name in cloth.seams if name in found]


def _without(
    cloth: Cloth,
    names: Sequence[str],
    *,
    pieces: Sequence[Measured],
    measure: Measure,
    energy_left: float = PRICE_LEFT,
) -> tuple[Trial, list[Measured]]:
    """Return what seams do, by the pieces that there were without them, and those pieces that are new.

    Args:
        cloth: as the pieces remember it (see `remembered`).
        names: of the seams.
        pieces: all of it.
        measure: lays pieces flat (see `measured`).
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
        after = measure(closed, pieces, changed=joined, energy_left=energy_left)
    except InputError:
        return replace(needed, needed="cannot lie flat without it"), []
    if sum(one.result.overlap for one in after) > sum(one.result.overlap for one in before) + OVERLAP:
        return replace(needed, needed="lies over itself without it"), []
    released = sum(one.energy for one in after) - sum(one.energy for one in before)
    total = sum(one.area for one in pieces)
    gain = (sum(one.outside for one in after) - sum(one.outside for one in before)) / total
    return Trial(name=names[0], released=released, outside=gain), after


def _closed(cloth: Cloth, names: Sequence[str]) -> tuple[Cloth, set[int]]:
    """Return the cloth with seams closed, and the numbers of the pieces beside them (see `remembered`)."""
    beside = np.isin(cloth.faces, np.concatenate([cloth.seams[name] for name in names])).sum(axis=1) >= 2
    for name in names:
        cloth = cloth.without_seam(name)
    return cloth, set(cloth.labels[OWNER][beside].tolist())


def _opens_a_tube(cloth: Cloth, names: Sequence[str]) -> bool:
    """Return whether the cloth without seams has a piece that is no disk."""
    closed, joined = _closed(cloth, names)
    return not all(mesh.is_disk for mesh in closed.pieces(np.isin(cloth.labels[OWNER], list(joined))))


def _can_be_sewn(cloth: Cloth, line: Line, before: Sequence[Measured], after: Sequence[Measured], size: float) -> bool:
    """Return whether nothing lies over itself that did not before, a dart opens wide enough and not too wide, a piece is nowhere narrow.

    Beside a dart's mouth its piece is narrow, and may be: what counts is that it hangs together around the tip.
    """
    if sum(piece.result.overlap for piece in after) > sum(piece.result.overlap for piece in before) + OVERLAP:
        return False
    if line.parts:
        return least_width(after, size) >= least_width(before, size)
    # A flap that hangs by what is hardly sewn counts while it is small, too.
    for necks in ((NARROW * size,), (SEWABLE, 0.005)):
        was, now = (
            max(parts_within(one.surface.faces, one.result.positions, *necks) for one in some)
            for some in (before, after)
        )
        if now > was:
            return False
    beside = np.unique(cloth.seams[_TRIAL])
    widest = 0.0
    for piece in after:
        own = piece.mesh.vertex_of
        order = np.argsort(own, kind="stable")
        twice = np.flatnonzero((own[order][1:] == own[order][:-1]) & np.isin(own[order][1:], beside))
        if len(twice):
            gap = piece.result.positions[order[twice]] - piece.result.positions[order[twice + 1]]
            widest = max(widest, float(np.linalg.norm(gap, axis=1).max()))
    return LEAST_MOUTH <= widest <= WIDE * cloth.seam_length(_TRIAL)


def _twin(number: int, pieces: Sequence[Measured], anatomy: Anatomy) -> int | None:
    """Return the number of the piece that mirrors another one; None where there is none, or it mirrors itself."""
    if anatomy.mirror is None:
        return None
    middles = np.array([one.mesh.vertices[one.mesh.faces].mean(axis=(0, 1)) for one in pieces])
    across = float(anatomy.across(middles[number]))
    away = np.linalg.norm(middles - anatomy.image(middles[number]), axis=1)
    away[number] = np.inf
    nearest = int(away.argmin())
    if abs(across) < 0.04 * anatomy.size or away[nearest] > 0.06 * anatomy.size:
        return None
    return nearest if abs(pieces[nearest].area / pieces[number].area - 1.0) < 0.25 else None


def _cut(cloth: Cloth, mesh: PieceMesh, line: Line, name: str) -> Cloth | None:
    """Return the cloth with a line cut in one piece; None where the line does not run as it should.

    A dart begins at the border of the piece and ends inside; a seam parts the piece in two.
    """
    own = cloth.marked(mesh.face_of)
    field = line.field(cloth)
    cloth = cloth.with_values(trial=field)
    if line.start is not None and line.end is not None:
        way = line.end - line.start
        along = (cloth.vertices - line.start) @ way / float(way @ way)
        beside = np.linalg.norm(cloth.vertices - line.start - np.clip(along, 0.0, 1.0)[:, None] * way, axis=1)
        # Cloth that lies elsewhere in the same plane, such as the other side of a tube, is not meant.
        near = beside < 0.5 * float(np.linalg.norm(way))
        near = own & near[cloth.faces].any(axis=1)
        if not near.any():
            return None
        part = cloth.only(near).parts
        first = np.linalg.norm(cloth.vertices[cloth.faces[near]].mean(axis=1) - line.start, axis=1).argmin()
        reached = cloth.marked(np.flatnonzero(near)[part == part[first]])
        # The tip lies where it is meant to, not where the next edge is: on both sides of a garment alike.
        corners = field[cloth.faces]
        through = reached & (corners.min(axis=1) < 0.0) & (corners.max(axis=1) > 0.0)
        cloth = cloth.with_values(tip=along - 1.0).with_labels(own=reached.astype(np.int64))
        cloth, beyond, _ = cloth.split("tip", through)
        own = (cloth.labels["own"] > 0) & ~beyond
    made, positive, within = cloth.split("trial", own)
    made = made.with_values(trial=None, tip=None).with_labels(own=None)
    lines = edge_components(made.new_edges(made.line_between(positive, within)))
    if not lines:
        return None
    longest = max(lines, key=len)
    vertices, counts = np.unique(longest, return_counts=True)
    border = np.union1d(made.border_edges, made.seam_edges())
    at_border = np.isin(vertices[counts == 1], border)
    if (counts > 2).any() or len(at_border) != 2 or np.isin(vertices[counts == 2], border).any():
        return None
    return made.with_seam(name, longest) if at_border.sum() == (2 if line.parts else 1) else None
