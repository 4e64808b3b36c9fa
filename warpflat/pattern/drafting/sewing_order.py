"""The order in which a garment is sewn: tasks that join and use up its edges, sorted by which of them need which.

A task is sewn by a technique of `data/techniques.toml`. A seam needs the seams that end on its line: an armhole's those of shoulder, side
and underarm. Of what could be sewn next, the lower turn of its technique comes first; among seams of the shell what lies flat before what
closes a ring, panels of one side of the body before its halves, and these before front and back.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from typing import Any

import numpy as np

from warpflat.core import other_side, turn_between, without_side
from warpflat.pattern.drafting.drafted import DraftedGarment
from warpflat.pattern.drafting.measures import length_words
from warpflat.pattern.drafting.names import unnumbered
from warpflat.pattern.drafting.pieces import Place, Seam, SeamOpening, SeamSide
from warpflat.pattern.drafting.polygons import signed_area
from warpflat.pattern.drafting.seam_words import joint_words
from warpflat.pattern.drafting.sewing_tasks import GATHERED, SewingTasks, Task, pieces_of, techniques
from warpflat.pattern.drafting.words import letters_of, translate, translate_name

__all__ = [
    "SewingStep",
    "SewnSeam",
    "notions",
    "seam_letters",
    "sewing_steps",
    "sewn_seams",
    "tools",
]

# A ring that is cut straight, so many times as long as wide, is stretched by up to this share as it is sewn on.
_SLENDER, _STRETCHED = 15.0, 0.25
# Seams are as long as each other up to this difference [mm].
_ONE_LENGTH = 0.1
#: A corner of a piece of cloth: its name, whether it is turned over, its copy, and the number of the edge that begins there.
Corner = tuple[str, bool, int, int]


@dataclass(frozen=True, kw_only=True)
class SewingStep:
    """A step of making a garment.

    Attributes:
        words: one sentence or more.
        technique: how it is sewn, one of :func:`techniques`.
        seams: that are sewn, in their order.
        sewn: of each piece that is at work, by its name, the edges that are sewn; fisheye darts among them.
        finished: free and folded edges that it uses up: hemmed, faced, bound, turned in.
        notions: what it takes beside the cloth.
    """

    words: str
    technique: str
    seams: tuple[SewnSeam, ...]
    sewn: Mapping[str, frozenset[str]]
    finished: frozenset[Place] = frozenset()
    notions: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class SewnSeam:
    """A seam as the maker meets it; its mirror image, which is sewn alike, is the same one.

    Attributes:
        letter: written beside its notches.
        name: without left and right, if both are sewn.
        sides: the pieces of both sides, in words.
        length_mm: of both sides.
        ease: by how much the second side is longer than the first, as a share.
        held: how the longer side is held to the shorter: "gather", "ease in", "stretch", or "" where they are alike or in pleats.
        by_pieces: whether it is called by the pieces that it joins.
        lined: whether it is one of a lining, which stays open beside a zip.
        count: how often it is sewn.
        openings: where it can be opened, or is not closed.
        places: piece and edge of all that it joins, of both sides of the body.
    """

    letter: str
    name: str
    sides: tuple[str, str]
    length_mm: tuple[float, float]
    ease: float
    held: str
    by_pieces: bool
    lined: bool
    count: int
    openings: tuple[SeamOpening, ...]
    places: tuple[Place, ...]

    def words(self) -> str:
        """Return its letter, its name, its pieces, and how its longer or shorter side is held."""
        first, second = self.sides
        words = self.name
        if not self.by_pieces:
            if first != second:
                words = translate("{seam}: {first} to {second}", seam=self.name, first=first, second=second)
            elif first not in self.name and not self.lined:
                words = translate("{seam} of the {first}", seam=self.name, first=first)
        if self.held:
            # The second side is the longer one where there is ease.
            held = second if (self.ease > 0) != (self.held == "stretch") else first
            words += translate(f", {self.held} the {{piece}}", piece=held)
        if self.lined and any(opening.kind == "zip" for opening in self.openings):
            words += translate(", open beside the zip")
        below = next((opening.kind for opening in self.openings if opening.kind in ("slit", "vent")), "")
        if below and not any(opening.kind == "zip" for opening in self.openings):
            words += translate(f", down to the {below}")
        return f"{self.letter} ({words})"


def seam_letters(garment: DraftedGarment) -> dict[str, str]:
    """Return the letter of each seam by its name, in the order of the sample size."""
    workshop = _Workshop(garment, garment.sample)
    return {
        seam.name: sewn[0].letter for batch in workshop.batches for task, sewn in batch for seam in task.seams if sewn
    }


def sewing_steps(garment: DraftedGarment, size: str) -> tuple[SewingStep, ...]:
    """Return the steps of making the garment."""
    workshop, steps = _Workshop(garment, size), list[SewingStep]()
    for technique, batch in zip(workshop.techniques, workshop.batches, strict=True):
        tasks = [task for task, _ in batch]
        sewn: dict[str, set[str]] = {piece: set() for task in tasks for piece in task.pieces}
        seams = tuple(seam for _, row in batch for seam in row)
        places = [place for seam in seams for place in seam.places]
        for piece, edge in (*places, *(place for task in tasks for place in (*task.places, *task.uses))):
            sewn.setdefault(piece, set()).add(edge)
        # A lining covers the edges of facings that are sewn to it.
        free = {piece for task in tasks if task.technique == "facing" for piece, _ in task.sewn} - workshop.lined
        faced = any(workshop.pieces[piece].role == "facing" for piece in free)
        neaten = translate("Neaten the inner edges of the facings.") if faced else ""
        # Lengths of the techniques themselves, by their millimetres.
        lengths = {f"mm{mm}": length_words(1e-3 * mm, workshop.units) for mm in (5, 10, 30, 35)}
        values: dict[str, Any] = {"below": "", "where": "", "neaten": neaten, **lengths}
        for task in tasks:
            values |= task.values
        values |= {
            "seams": ", ".join(seam.words() for seam in seams) or values.get("seams", ""),
            "pieces": workshop.called(
                [piece for task in tasks for piece in (task.pieces or pieces_of([*task.uses, *task.places]))]
            ),
            "edges": workshop.edges_called([place for task in tasks for place in task.uses], technique),
        }
        if technique in ("dart", "pleat"):
            values["darts"] = values["pleats"] = "; ".join(task.values["darts"] for task in tasks)
        if technique in ("vent", "slit"):
            values["seams"] = next(workshop.letters[seam.name] for task in tasks for seam in task.values["of"])
        steps.append(
            SewingStep(
                words=" ".join(translate(techniques()[technique]["text"], **values).split()),
                technique=technique,
                seams=seams,
                sewn={piece: frozenset(edges) for piece, edges in sewn.items()},
                finished=frozenset(place for task in tasks for place in task.uses),
                notions=tuple(each for task in tasks for each in task.notions),
            )
        )
    return tuple(steps)


def sewn_seams(steps: Sequence[SewingStep]) -> tuple[SewnSeam, ...]:
    """Return the seams of a garment in their order, each with its letter."""
    return tuple(seam for step in steps for seam in step.seams)


def notions(steps: Sequence[SewingStep]) -> tuple[str, ...]:
    """Return what is needed beside the cloth: thread, and what the steps take: zips, elastics, buttons and hooks."""
    return translate("sewing thread"), *(each for step in steps for each in step.notions)


def tools(garment: DraftedGarment, steps: Sequence[SewingStep]) -> str:
    """Return what the garment is made with in its steps, in words."""
    used = {techniques()[step.technique].get("tool") for step in steps}
    needed = ["paper scissors and glue or tape", "cloth scissors", "tape measure", "chalk", "pins", "iron"]
    needed += ["sewing machine", "hand needle", *(tool for tool in ("zip foot", "buttonhole foot") if tool in used)]
    if garment.pattern.worn is not None and garment.pattern.worn.knits:
        needed.append("needle and stitch for knits")
    return ", ".join(translate(word) for word in needed)


class _Workshop(SewingTasks):
    """The tasks of a garment in one size, in the order in which they are sewn.

    Attributes:
        batches: what is sewn in one step: tasks, each with its seams as the maker meets them.
        techniques: of each batch.
        letters: by name of a seam.
        lined: pieces that are sewn to a lining.
    """

    def __init__(self, garment: DraftedGarment, size: str) -> None:
        super().__init__(garment, size)
        # Each task needs the seams that end on its line.
        ends: dict[frozenset[Corner], list[Task]] = {}
        beside: dict[Corner, list[tuple[Task, Corner]]] = {}
        for task in self.tasks:
            for seam in task.seams:
                for pair in self._ends(seam):
                    ends.setdefault(frozenset(pair), []).append(task)
                    for corner, opposite in (pair, pair[::-1]):
                        beside.setdefault(corner, []).append((task, opposite))
        for task in self.tasks:
            for chain in (chain for seam in task.seams for chain in seam.sides):
                # The ends of a ring meet, too.
                for before, after in (*pairwise(chain), (chain[-1], chain[0])):
                    joint = frozenset((self._corner(before, end=True), self._corner(after, end=False)))
                    task.needs.update(ends.get(joint, ()))
        for met, crossing in ends.items():
            corners = list(met)
            for one, there in beside[corners[0]]:
                for other, here in beside[corners[-1]]:
                    if one is other or {one, other} & set(crossing):
                        continue
                    # Of three pieces that meet in a point those are sewn first whose corners are most alike: the sides of a hat before
                    # its crown, what a godet is set into before the godet. And a zip that runs through two seams needs those between.
                    set_in = there == here and self._alike(corners[0], corners[-1], there)
                    if set_in or all(each.technique.endswith(("_zip", "fly")) for each in (one, other)):
                        one.needs.update(crossing)
                        other.needs.update(crossing)
        # A zip that is longer than its seam ends in a band there, which is sewn on before.
        for task in self.tasks:
            for seam in task.seams:
                longest = max((each.length for each in seam.openings if each.kind == "zip"), default=0.0)
                if longest > 1e-3 * self.lengths.get(seam.name, (1e6, 0.0))[0] + 1e-3:
                    at_zip = [corner for pair in self._ends(seam) for corner in pair]
                    bands = {each for corner in at_zip for each, _ in beside[corner] if each.how.get("lengthens")}
                    task.needs |= bands
                    for band in bands:
                        band.needs.discard(task)
                    task.pieces = pieces_of(place for band in bands for place in band.uses)
        # What is hemmed, bound or faced along edges is sewn when the seams are that end between these.
        for task in self.tasks:
            if task.how["turn"] < 40 or task.seams:
                continue
            reached = {(p, (self.order[p].index(e) + k) % len(self.order[p])) for p, e in task.uses for k in (0, 1)}
            for met, crossing in ends.items():
                if all((corner[0], corner[3]) in reached for corner in met):
                    task.needs.update(crossing)
        for task in self.tasks:
            task.needs.discard(task)
        ordered = self._sorted()
        self.techniques = [technique for technique, _ in ordered]
        self.lined = {piece for task in self.tasks if task.technique == "lined_edge" for piece, _ in task.sewn}
        self.letters: dict[str, str] = {}
        self.batches = [[(task, self._sewn(task)) for task in batch] for _, batch in ordered]

    def _corner(self, side: SeamSide, *, end: bool) -> Corner:
        order = self.order[side.piece]
        at = order.index(side.edge) + (end != side.reversed)
        return *side.cloth, at % len(order)

    def _ends(self, seam: Seam) -> list[tuple[Corner, Corner]]:
        """Return the corners that a seam joins at its start and at its end."""
        first, second = seam.sides
        return [
            (self._corner(first[0], end=False), self._corner(second[0], end=False)),
            (self._corner(first[-1], end=True), self._corner(second[-1], end=True)),
        ]

    def _alike(self, first: Corner, second: Corner, third: Corner) -> bool:
        """Return whether two corners that meet are more alike in their angles than either is to a third, by 10 degrees at least."""
        angles = []
        for piece, _, _, at in (first, second, third):
            edges = self.pieces[piece].edges
            before, after = edges[at - 1].points, edges[at].points
            angles.append(180.0 - np.degrees(turn_between(before[-1] - before[-2], after[1] - after[0])))
        apart = abs(angles[0] - angles[1])
        return bool(apart + 10.0 < min(abs(angles[2] - angles[0]), abs(angles[2] - angles[1])))

    def _sorted(self) -> list[tuple[str, list[Task]]]:
        """Return what is sewn in each step with its technique, sorted by needs and turns."""
        graph = {task: set(task.needs) for task in self.tasks}
        while True:
            sorter = TopologicalSorter(graph)
            try:
                sorter.prepare()
                break
            except CycleError as error:
                # A seam that cannot wait for all others, as in patterns of closed things: it is sewn before the last of them.
                needed, needing = error.args[1][:2]
                graph[needing].discard(needed)
        number = {task: k for k, task in enumerate(self.tasks)}
        # Pieces of cloth that are sewn together have one of them in common; corners that seams have brought together.
        cloth: dict[tuple[str, bool, int], object] = {}
        whole: set[frozenset[Corner]] = set()
        found, ready = list[tuple[str, list[Task]]](), list(sorter.get_ready())

        def joined(seam: Seam) -> frozenset[object]:
            """Return the pieces of cloth that a seam joins, one where they are sewn together already."""
            return frozenset(cloth.get(row[0].cloth, row[0].cloth) for row in seam.sides)

        def shape(task: Task) -> tuple[int, bool, bool, bool, bool]:
            """Return the turn of a task; of a seam whether it is eased, closes a ring, joins left and right, and front and back."""
            if task.technique not in ("", "lining_join"):
                return task.how["turn"], False, False, False, False
            seam = task.seams[0]
            first, second = (row[0].piece for row in seam.sides)
            here = joined(seam)
            closes = len(here) == 1
            if len(task.seams) > 1 and all(joined(image) == here for image in task.seams):
                # The second of both side seams closes a skirt, where nothing else is left that joins its front and back.
                closes = closes or not any(joined(s) == here for t in self.tasks if t is not task for s in t.seams)
            centre = first == second or other_side(first) == second
            one, other = (self.pieces[piece].worn_at for piece in (first, second))
            differ = bool(one and other) and one != other
            return task.how["turn"], 5e-4 < abs(seam.ease) < GATHERED, closes, centre, differ

        def meet(one: Corner, other: Corner) -> bool:
            return one == other or frozenset((one, other)) in whole

        def goes_on(end: tuple[Corner, Corner], other: tuple[Corner, Corner]) -> bool:
            """Return whether the end of one seam is that of another one, beyond a seam that is sewn."""
            return any(meet(end[0], pair[0]) and meet(end[1], pair[1]) for pair in (other, other[::-1]))

        seams = [(each, seam, self._ends(seam)) for each in self.tasks if each.technique == "" for seam in each.seams]

        def line_of(task: Task) -> tuple[list[Task], bool]:
            """Return the seams that go on into a seam, itself first, and whether they are a ring."""
            found, ring = [(task, task.seams[0])], True
            for _, seam in found:
                for k, end in enumerate(self._ends(seam)):
                    beyond = [
                        (each, other)
                        for each, other, ends in seams
                        for n, pair in enumerate(ends)
                        if (other is not seam or n != k) and goes_on(end, pair)
                    ]
                    ring = ring and bool(beyond)
                    found += [one for one in beyond if one not in found]
            return list(dict.fromkeys(each for each, _ in found)), ring

        def technique(task: Task) -> str:
            if task.technique:
                return task.technique
            _, eased, closes, centre, faces = shape(task)
            if line_of(task)[1]:
                return "set_in" if eased else "around"
            return "close" if closes else "flat" if centre or faces else "join"

        waits = {task: sum(task in other.needs for other in self.tasks if other.seams) for task in self.tasks}

        # Seams that differ by less than a tenth of a millimetre are sewn in the pattern's order, whatever the rounding.
        lengths = sorted({0.0, *(first for first, _ in self.lengths.values())})
        rank = dict(zip(lengths, np.cumsum(np.diff(lengths, prepend=0.0) > _ONE_LENGTH).tolist(), strict=True))

        def key(task: Task) -> tuple[object, ...]:
            length = self.lengths.get(task.seams[0].name, (0.0, 0.0))[0] if task.seams else 0.0
            return (*shape(task), -waits[task], rank[length], number[task])

        while ready:
            first = min(ready, key=key)
            how, alike, batch = technique(first), shape(first), [first]
            line, alone = set[Task](), techniques()[how].get("alone", False)
            while True:
                task = batch[-1]
                line.update(() if task.technique else line_of(task)[0])
                ready.remove(task)
                for seam in task.seams:
                    whole.update(frozenset(pair) for pair in self._ends(seam))
                    parts = [side.cloth for side in seam.stretches]
                    names = {cloth.get(part, part) for part in parts}
                    cloth |= dict.fromkeys(parts, parts[0])
                    cloth = {part: parts[0] if name in names else name for part, name in cloth.items()}
                more = [t for t in ready if t in line or (not alone and technique(t) == how and shape(t) == alike)]
                if not more:
                    break
                batch.append(min(more, key=key))
            if found and found[-1][0] == how and not alone:
                found[-1][1].extend(batch)
            else:
                found.append((how, batch))
            sorter.done(*batch)
            ready += sorter.get_ready()
        return found

    def _sewn(self, task: Task) -> list[SewnSeam]:
        """Return the seams of a task as the maker meets them, with the next letter."""
        if not task.seams:
            return []
        seam, group, pieces = task.seams[0], task.seams, self.pieces
        joined = [pieces[side.piece] for side in seam.stretches]
        sideless = len(group) > 1 or (not seam.openings and task.like is None and self.stands_for_both(group))
        places = [side.place for each in group for side in each.stretches]
        if any(pieces[piece].quantity % 2 == 0 for piece, _ in places):
            # What is cut twice is drawn for one side, and sewn to both.
            places += [(piece, other_side(edge)) for piece, edge in places if pieces[piece].quantity == 1]
        held = ""
        if abs(seam.ease) >= 5e-4 and not any(piece.pleats for piece in joined):
            share = seam.ease if seam.ease > 0 else 1.0 / (1.0 + seam.ease) - 1.0
            band = pieces[seam.sides[0 if seam.ease > 0 else 1][0].piece]
            # A ring is a slender strip whose ends are sewn to each other.
            slender = (sum(edge.length for edge in band.edges) / 2.0) ** 2 > _SLENDER * signed_area(band.outline)
            ring = slender and any({side.piece for side in each.stretches} == {band.name} for each in self.seams)
            stretched = band.role == "strip" or (share < _STRETCHED and ring)
            held = "stretch" if stretched else "gather" if share > GATHERED else "ease in"
        new = letters_of(len(set(self.letters.values())))
        letter = new if task.like is None else self.letters[task.like.seams[0].name]
        self.letters |= {each.name: letter for each in group}
        # Seams called by their pieces have numbers from the second on; those of facings, and of equal pieces between others, are said
        # by theirs, too.
        by_pieces = unnumbered(seam.name) == joint_words(seam) or task.technique == "facing_join"
        copied = any(part.copy for each in group for part in each.stretches)
        equal = copied and len({part.piece for each in group for part in each.stretches}) > 2
        by_pieces = by_pieces or equal
        titles = list[str]()
        for k in (0, 1):
            # The pieces of each row once: those in a row are sewn to each other before.
            found: dict[frozenset[str], str] = {}
            for each in group if equal else group[:1]:
                row = dict.fromkeys(self.titles[part.piece] for part in each.sides[k])
                found.setdefault(frozenset(row), " + ".join(row))
            titles.append(", ".join(found.values()))
        first, second = titles
        if not by_pieces:
            name = translate_name(without_side(seam.name) if sideless else seam.name)
        else:
            words = "{first} to {second}" if first != second else "seam of the {first}"
            name = translate(words, first=first, second=second)
        return [
            SewnSeam(
                letter=letter,
                name=name,
                sides=(first, second),
                length_mm=self.lengths.get(seam.name, (0.0, 0.0)),
                ease=seam.ease,
                held=held,
                by_pieces=by_pieces,
                lined=task.technique == "lining_join",
                count=max(len(group), 2 if sideless else 1),
                openings=seam.openings,
                places=tuple(places),
            )
        ]
