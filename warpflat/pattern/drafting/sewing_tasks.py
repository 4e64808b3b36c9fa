"""What has to be sewn of a garment: its seams, and what finishes each free edge, each as a task with its technique and its notions."""

from __future__ import annotations

import functools
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import resources
from typing import Any

from warpflat.core import other_side, polyline_length, read_toml, without_side
from warpflat.pattern.drafting.drafted import DraftedGarment, DraftedPiece
from warpflat.pattern.drafting.measures import length_words
from warpflat.pattern.drafting.names import line_name
from warpflat.pattern.drafting.pieces import Elastic, Piece, Place, Seam, SeamSide
from warpflat.pattern.drafting.words import listed, translate, translate_name

__all__ = ["GATHERED", "SewingTasks", "Task", "is_flounce", "piece_titles", "pieces_of", "techniques"]

#: How the edges of a facing that is grown on begin, which lie beyond the line on which it is folded.
_GROWN_ON = "facing "
# What is longer by more than this share is gathered; less is eased in.
GATHERED = 0.15


@functools.cache
def techniques() -> Mapping[str, Mapping[str, Any]]:
    """Return what things are sewn by, each technique as `data/techniques.toml` describes it."""
    with resources.as_file(resources.files("warpflat.pattern.drafting") / "data/techniques.toml") as path:
        return read_toml(path)


@dataclass(kw_only=True, eq=False)
class Task:
    """What is sewn at once: a seam with its mirror image, or edges and pieces that are finished.

    Attributes:
        technique: "" of a seam of the shell, whose technique follows from what is sewn before.
        seams: mirror images of each other.
        places: where it is sewn.
        uses: free and folded edges that it uses up.
        pieces: that are at work besides.
        values: what is filled into its text.
        notions: what it takes.
        needs: tasks that come before it.
        like: the task of the other side of the body, if that has an opening and this one has none.
    """

    technique: str
    seams: list[Seam] = field(default_factory=list)
    places: list[Place] = field(default_factory=list)
    uses: list[Place] = field(default_factory=list)
    pieces: list[str] = field(default_factory=list)
    values: dict[str, Any] = field(default_factory=dict)
    notions: list[str] = field(default_factory=list)
    needs: set[Task] = field(default_factory=set)
    like: Task | None = None

    @property
    def sewn(self) -> list[Place]:
        """Pieces and edges of its seams."""
        return [side.place for seam in self.seams for side in seam.stretches]

    @property
    def how(self) -> Mapping[str, Any]:
        """Its technique, as :func:`techniques` describes it."""
        return techniques()[self.technique or "flat"]


def piece_titles(pieces: Sequence[Piece]) -> dict[str, str]:
    """Return what each piece is called: as it is printed, with its side where two would be called alike."""
    plain = [piece.printed_name for piece in pieces]
    return {
        piece.name: title if plain.count(title) == 1 or piece.title else translate_name(piece.name.replace("_", " "))
        for piece, title in zip(pieces, plain, strict=True)
    }


class SewingTasks:
    """What has to be sewn of a garment in one size.

    Attributes:
        units: of lengths in words.
        drafted, pieces, titles: the pieces by name, and what they are called.
        order: the edges of each piece in their order.
        seams, sewn: of the garment, and the edges that they take.
        above: the half that lies above where it buttons, "right" or "left".
        lengths: of both sides of each seam [mm].
        tasks: each seam with its mirror images, and each finishing; every free edge is used up by one of them.
    """

    def __init__(self, garment: DraftedGarment, size: str) -> None:
        self.size, self.units = size, garment.pattern.units
        self.drafted = {piece.name: piece for piece in garment.pieces[size]}
        # Whole ones, also where halves on the fold are printed.
        self.pieces = {piece.name: piece for piece in garment.pattern.pieces[size]}
        self.titles = piece_titles(list(self.pieces.values()))
        self.seams = garment.pattern.seams
        self.sewn = {side.place for seam in self.seams for side in seam.stretches}
        self.above = "right" if garment.pattern.worn is None else garment.pattern.worn.buttonholes
        self.order = {name: [edge.name for edge in piece.edges] for name, piece in self.pieces.items()}
        self.lengths = {report.name: report.length_mm for report in garment.seams if report.size == size}
        # Seams that are each other's mirror images are sewn alike.
        groups: dict[object, list[Seam]] = {}
        copied = {s.place for seam in self.seams for s in seam.stretches if s.copy}
        alike: dict[Place, object] = {}
        images: dict[object, object] = {}
        for seam in self.seams:
            # Edges of equal pieces, of which one is drawn, have the notches of one seam.
            key: object
            own = [s.place for s in seam.stretches if s.place in copied]
            if own:
                key = next((alike[edge] for edge in own if edge in alike), own[0])
                alike |= dict.fromkeys(own, key)
                groups.setdefault(key, []).append(seam)
                continue
            sides = sorted(
                tuple(sorted((without_side(s.piece), line_name(s.edge)) for s in side)) for side in seam.sides
            )
            # A zip in one side alone makes it another seam than the other side. Parts of an edge are numbered around the piece.
            key = without_side(seam.name), tuple(sides), seam.openings
            if any(self.pieces[side.piece].is_pair for side in seam.stretches):
                # Whatever its name, the seam of the copies that are turned over is the mirror image, at the other sides of other pieces.
                image = [
                    [
                        replace(side, mirrored=not side.mirrored)
                        if self.pieces[side.piece].is_pair
                        else replace(side, edge=other_side(side.edge))
                        for side in row
                    ]
                    for row in seam.sides
                ]
                here, there = (
                    frozenset(frozenset((side.place, side.mirrored) for side in row) for row in rows)
                    for rows in (seam.sides, image)
                )
                key = images.setdefault((here, seam.openings), key)
                images[there, seam.openings] = key
            groups.setdefault(key, []).append(seam)
        self.tasks = [Task(technique=self._technique(group), seams=group) for group in groups.values()]
        # A zip lies in one of two sides. Of halves on the fold the seam of one side stands for both.
        for task in [task for task in self.tasks if task.seams[0].openings]:
            name = other_side(task.seams[0].name)
            for other in self.tasks:
                if other.seams[0].name == name != task.seams[0].name and not other.seams[0].openings:
                    other.like = task
            if self.stands_for_both(task.seams):
                seam = replace(task.seams[0], name=name, openings=())
                self.tasks.append(Task(technique=self._technique([seam]), seams=[seam], like=task))
                self.lengths[name] = self.lengths[task.seams[0].name]
        self._finish(garment.pattern.elastics)

    def stands_for_both(self, group: Sequence[Seam]) -> bool:
        """Return whether a seam of halves on the fold, or of pairs, is sewn on both sides of the body."""
        seam, other = group[0], other_side(group[0].name)
        if len(group) > 1 or (other != seam.name and other in {each.name for each in self.seams}):
            return False
        joined = [self.pieces[side.piece] for side in seam.stretches]
        # A copy that is turned over is of another pair, unless both sides are one piece's: then it is sewn across the centre.
        across = any(side.mirrored for side in seam.stretches) and len({piece.name for piece in joined}) == 1
        # Of four bags two are one pocket, and sewn to each other.
        needed = (4 if joined[0].role == "pocket" else 0) if across else 2
        copied = any(side.copy for side in seam.stretches)
        # What is cut twice, such as an armhole's band, is sewn to both sides of what is cut once.
        twice = [piece.quantity == needed and not piece.on_fold for piece in joined]
        both = [other_side(s.edge) != s.edge and other_side(s.edge) in self.order[s.piece] for s in seam.stretches]
        if not copied and any(twice) and all(map(any, zip(twice, both, strict=True))):
            return True
        return other != seam.name and all(piece.on_fold or piece.is_pair for piece in joined)

    def called(self, names: Iterable[str]) -> str:
        """Return pieces in words."""
        return ", ".join(dict.fromkeys(self.titles[name] for name in names))

    def edges_called(self, places: Sequence[Place], technique: str) -> str:
        """Return edges in words: hems by their width, and by their names where one piece has several; raw ones with their lengths."""
        rows: dict[str, list[Place]] = {}
        widths = {place: length_words(self.pieces[place[0]].edge(place[1]).width, self.units) for place in places}
        several = {piece for piece, _ in places if len({widths[each] for each in places if each[0] == piece}) > 1}
        alike = {width for place, width in widths.items() if place[0] in several}
        for piece, edge in places:
            row, name = widths[piece, edge], translate_name(line_name(edge))
            if technique != "hem":
                row = name
            elif row in alike:
                row += f" {name}"
            rows.setdefault(row, []).append((piece, edge))
        if technique == "bind_raw":
            told = []
            for row, own in rows.items():
                edges = [(self.pieces[piece], edge) for piece, edge in own]
                # On all that is cut by a piece.
                length = sum(p.edge(edge).length * p.quantity * (2 if p.on_fold else 1) for p, edge in edges)
                told.append(f"{row} {length_words(length, self.units)}")
            return ", ".join(told)
        return ", ".join(f"{row} ({self.called(pieces_of(places))})" for row, places in rows.items())

    def _technique(self, group: Sequence[Seam]) -> str:
        """Return how seams are sewn, by the roles of their pieces and by what these are like; "" for seams of the shell."""
        seam = group[0]
        rows = [[self._role(side) for side in row] for row in seam.sides]
        roles = {role for row in rows for role in row}
        if not any(set(row) == {"pocket"} for row in rows):
            # What of a pocket lies in another seam is sewn with that.
            roles -= {"pocket"}
        technique = next((name for name, each in techniques().items() if sorted(roles) in each.get("joins", ())), "")
        joined = [self.pieces[side.piece] for side in seam.stretches]
        strips = [piece for piece in joined if piece.role in ("strip", "waistband")]
        folded = any("fold line" in strip.internal_lines for strip in strips)
        if technique == "strip_join" and (len(group) > 1 or any(side.copy for side in seam.stretches)):
            return "panel_join"
        if technique == "binding":
            hemmed = any(edge.kind == "hem" for strip in strips for edge in strip.edges)
            return "ruffle" if hemmed else "rib" if folded else "binding"
        if technique == "waistband_layers" and folded:
            ring = any({side.piece for side in each.stretches} == {strips[0].name} for each in self.seams)
            return "waistband_ring" if ring else "waistband_ends"
        if technique == "collar":
            # The seams that join the fall of a collar to its stand.
            falls = list[Seam]()
            for each in self.seams:
                sides = [row[0] for row in each.sides]
                if all(self._role(side) == "collar" for side in sides) and sides[0].piece != sides[1].piece:
                    falls.append(each)
            stands = {side.piece for each in falls for side in each.sides[1]}
            return "stand_and_fall" if seam in falls or joined[0].name in stands else "collar"
        if technique == "collar_on":
            faced = {side.piece for side in seam.stretches if self._grown_on(side.piece)}
            if faced and all(self._free_beside_fold(piece) for piece in faced):
                return "collar_between"
            if self._turned_over(seam):
                return "collar_under_facing"
            return "collar_stand_on" if any("stand" in piece.name for piece in joined) else "collar_on"
        if technique == "pocket_rim" and any(
            edge.kind == "cut" and edge.name == "opening" for piece in joined for edge in piece.edges
        ):
            return "inseam_rim"
        if technique in ("", "hood") or roles == {"shell"}:
            zips = [opening for opening in seam.openings if opening.kind == "zip"]
            if zips:
                fly = any(piece.role == "fly" for piece in self.pieces.values()) and zips[0].style == "lapped"
                return "fly" if fly else f"{zips[0].style or 'invisible'}_zip"
            if any(opening.kind == "buttons" for opening in seam.openings):
                return "buttoned"
        return technique

    def _role(self, side: SeamSide) -> str:
        role = self.pieces[side.piece].role
        return "facing" if role == "shell" and side.edge.startswith(_GROWN_ON) else role

    def _grown_on(self, piece: str) -> list[str]:
        """Return the edges of a facing that is grown on to a piece of the shell."""
        known = self.pieces[piece]
        return [edge.name for edge in known.edges if known.role == "shell" and edge.name.startswith(_GROWN_ON)]

    def _free_beside_fold(self, piece: str) -> list[str]:
        """Return the edges beside a grown-on facing that no seam takes: the upper end of a button stand beside a collar."""
        order, grown = self.order[piece], self._grown_on(piece)
        beside = [order[(order.index(edge) + step) % len(order)] for edge in grown for step in (-1, 1)]
        return [
            edge
            for edge in dict.fromkeys(beside)
            if edge not in grown and (piece, edge) not in self.sewn and self.pieces[piece].edge(edge).kind == "seam"
        ]

    def _turned_over(self, seam: Seam) -> list[Place]:
        """Return what no seam takes beside a collar: ends of facings, which are turned over its ends, and of button stands."""
        shell = [side for side in seam.stretches if self.pieces[side.piece].role == "shell"]
        facings = {
            side.piece
            for each in self.seams
            if {other.piece for other in each.stretches} & {other.piece for other in shell}
            for side in each.stretches
            if self.pieces[side.piece].role == "facing"
        }
        along = {line_name(side.edge) for side in shell}
        return [
            (piece, edge)
            for piece in [*sorted(facings), *(pieces_of((side.piece, "") for side in shell) if facings else ())]
            for edge in self.order[piece]
            if (piece, edge) not in self.sewn and line_name(edge) in along
        ]

    def _take(self, places: Iterable[Place]) -> list[Place]:
        """Return those of some places that are free, which they are no more."""
        return [place for place in places if self._free.pop(place, None) is not None]

    def _take_of(self, names: Collection[str], kinds: Collection[str] = ("seam", "hem", "cut")) -> list[Place]:
        """Return the free edges of some pieces and kinds, which they are no more."""
        return self._take([place for place, kind in self._free.items() if place[0] in names and kind in kinds])

    def _add(self, technique: str, pieces: Iterable[str], uses: Sequence[Place] = (), **values: Any) -> None:
        """Add a task, if there is anything to do."""
        names = list(pieces)
        if names or uses:
            self.tasks.append(Task(technique=technique, pieces=names, uses=list(uses), values=values))

    def _with_role(self, *roles: str) -> list[str]:
        return [name for name, piece in self.pieces.items() if piece.role in roles]

    def _has_hem(self, name: str) -> bool:
        return any(edge.kind == "hem" for edge in self.pieces[name].edges)

    def _finish(self, elastics: Sequence[Elastic]) -> None:
        """Add the tasks that finish edges and pieces, until every free edge is used up by one of them."""
        # What is cut twice is drawn for one side.
        sewn = self.sewn | {(of, other_side(edge)) for piece, edge in self.sewn for of in (piece, other_side(piece))}
        # A line of another program's file does not say what is to become of it.
        self._free = {
            (piece.name, edge.name): edge.kind
            for piece in self.pieces.values()
            for edge in piece.edges
            if edge.kind not in ("fold", "dart") and not edge.as_drawn and (piece.name, edge.name) not in sewn
        }
        self._finish_parts({piece for piece, _ in sewn})
        # A facing that is grown on, beside a collar that ends at the centre, is sewn with that.
        between = [task for task in self.tasks if task.technique == "collar_between"]
        for name in [name for name in self.pieces if self._grown_on(name)]:
            own = [(name, edge) for edge in (*self._grown_on(name), *self._free_beside_fold(name))]
            faced = [each for each in self.tasks if each.technique == "facing" and set(own) & set(each.sewn)]
            places = self._take([(p, e) for p, e in own if not faced or self.pieces[p].edge(e).kind != "hem"])
            if faced:
                faced[0].uses += places
            elif between:
                between[0].uses += places
                between[0].pieces.append(name)
            else:
                self._add("grown_facing", [name], places)
        for task in self.tasks:
            if task.technique == "collar_under_facing":
                task.uses += self._take(self._turned_over(task.seams[0]))
        # Where linings and facings end at a zip, or are caught in a band or binding, the shell has an edge of the same name.
        zipped, bound = set[str](), set[str]()
        for task in self.tasks:
            edges = {without_side(edge) for piece, edge in task.sewn if self.pieces[piece].role == "shell"}
            zipped |= edges if any(opening.kind == "zip" for seam in task.seams for opening in seam.openings) else set()
            bound |= edges if task.how.get("takes_edges") and task.technique not in ("facing", "hood") else set()
        inner = self._with_role("lining", "facing")
        for technique, known in (("at_zip", zipped), ("baste_lining", bound)):
            free = [(p, e) for (p, e), kind in self._free.items() if p in inner and kind == "seam"]
            self._add(technique, [], self._take([(p, e) for p, e in free if without_side(e) in known]))
        linings = [task for task in self.tasks if task.technique == "lining_join"]
        zips = [task for task in linings if any(each.kind == "zip" for each in task.seams[0].openings)]
        for task in self.tasks:
            if task.technique == "at_zip":
                task.places = [place for each in zips for place in each.sewn]
        ruffles = [name for name in self._with_role("strip") if self._has_hem(name)]
        self._add("ruffle_hem", ruffles, self._take_of(ruffles, ("hem",)))
        pleated = [name for name in ruffles if self.pieces[name].pleats]
        self._add("ruffle_pleats", pleated)
        longer = {s.piece for seam in self.seams if seam.ease > GATHERED for s in seam.sides[1]}
        self._add("ruffle_gathers", [name for name in ruffles if name in longer and name not in pleated])
        hems = self._take_of(self._with_role("hood"), ("hem",))
        width = max((self.pieces[p].edge(e).width for p, e in hems), default=0.0)
        self._add("hood_hem", [], hems, width=length_words(width, self.units))
        # What their own seam to the garment leaves of strips, collars and facings goes with that.
        for name in self._with_role("facing", "strip", "waistband", "cuff", "collar", "hood"):
            places = [(p, e) for (p, e), kind in self._free.items() if p == name and kind != "hem"]
            on = [t for t in self.tasks if t.how.get("takes_edges") and name in pieces_of(t.sewn)]
            if on and places:
                max(on, key=lambda task: int(task.how["turn"])).uses.extend(self._take(places))
        # Vents and slits, in the shell and in its lining.
        role = {name: piece.role for name, piece in self.pieces.items()}
        for kind in ("vent", "slit"):
            own = [place for place in self._free if self._free[place] == "hem" and kind in place[1].split(" ")]
            for task in [task for task in self.tasks if task.seams]:
                found, sides = [each for each in task.seams[0].openings if each.kind == kind], task.sewn
                if found and role[sides[0][0]] != "lining":
                    places = self._take([(p, e) for p, e in own if (p, e.removesuffix(f" {kind}")) in sides])
                    values = {"length": length_words(found[0].length, self.units), "of": task.seams}
                    self.tasks.append(Task(technique=kind, uses=places, values=values, needs={task}))
            lined = self._take([place for place in own if place in self._free and role[place[0]] == "lining"])
            self._add("lined_opening", [], lined, kind=translate(kind))
        for elastic in elastics:
            self._thread(elastic)
        shell = self._with_role("shell")
        self._add("hang", [name for name in shell if is_flounce(self.pieces[name])])
        for technique, kind in (("hem", "hem"), ("bind_raw", "seam"), ("raw", "cut")):
            self._add(technique, [], self._take_of(self.pieces, (kind,)))
        self._close()

    def _finish_parts(self, joined: Collection[str]) -> None:
        """Add interfacings, ties, darts, pockets, straps and plackets."""
        interfacings = self._with_role("interfacing")
        fused = [name for name, piece in self.pieces.items() if piece.also or name in interfacings]
        self._add("fuse", fused, self._take_of(interfacings))
        ties, tied = self._with_role("tie"), [name for name, piece in self.pieces.items() if "tie" in piece.marks]
        self._add("tie", [*ties, *tied], self._take_of(ties))
        self._add("tie_on", tied)
        for technique in ("dart", "pleat"):
            for piece in self.drafted.values():
                # The edges of its darts, or of its pleats, by the names that are printed; a fisheye dart is its own line.
                legs = dict[str, list[str]]()
                pleats = technique == "pleat"
                for dart in (each.dart for each in piece.darts if (each.dart.pleat is not None) == pleats):
                    legs.setdefault(translate_name(without_side(dart.name)), []).extend([dart.left, dart.right])
                for name in () if pleats else piece.fisheyes:
                    legs.setdefault(translate_name(without_side(name)), []).append(name)
                if legs:
                    self._add(technique, [piece.name], darts=f"{self.titles[piece.name]}: {listed(list(legs))}")
                    self.tasks[-1].places = [(piece.name, leg) for row in legs.values() for leg in row]
        # A pocket of a first project is a panel like others, but nothing is sewn to its edges.
        loose = [name for name in self.pieces if name not in joined]
        pockets = [name for name in loose if self.pieces[name].role == "pocket" or name.endswith("pocket")]
        patches = [name for name in pockets if self._has_hem(name)]
        self._add("patch_pocket", patches, self._take_of(patches))
        welts = [name for name in pockets if name not in patches]
        self._add("welt_pocket", welts, self._take_of(welts))
        bags = [name for name in self._with_role("pocket") if name in joined]
        inseam = [place[0] for place in self._free if place[0] in bags and place[1] == "opening"]
        self._add("inseam_bag", inseam, self._take_of(inseam, ("cut",)))
        rims = [task for task in self.tasks if task.technique in ("pocket_rim", "inseam_rim", "pocket_opening")]
        for task in rims:
            task.uses.extend(self._take_of([name for name in bags if name in pieces_of(task.sewn)]))
        shell = [name for name in self._with_role("shell") if name in loose]
        straps = [name for name in shell if all(edge.kind == "cut" for edge in self.pieces[name].edges)]
        self._add("strap", straps, self._take_of(straps))
        plackets = [name for name in self._with_role("placket") if name in loose]
        buttoned = [name for name in plackets if "button" in self.pieces[name].marks]
        self._add("neck_placket", buttoned, self._take_of(buttoned), strip=translate(f"{self.above} strip"))
        slits = [name for name in plackets if name not in buttoned]
        self._add("bound_slit", slits, self._take_of(slits))
        fly = self._with_role("fly")
        places = self._take_of(fly)
        for task in self.tasks:
            if task.technique == "fly":
                task.pieces, task.uses = fly, places

    def _thread(self, elastic: Elastic) -> None:
        """Add an elastic, in a casing or a folded band, with its notion."""
        along = [
            (piece.name, edge.name)
            for piece in self.pieces.values()
            for edge in piece.edges
            if line_name(edge.name) == elastic.edge
        ]
        cased = self._take([place for place in along if self._free.get(place) == "hem"])
        values = {
            "edge": translate_name(elastic.edge),
            "width": length_words(elastic.width, self.units),
            "length": length_words(elastic.lengths[self.size], self.units),
        }
        if not along:
            return
        self._add("casing" if cased else "elastic_band", pieces_of(along), cased, **values)
        word = "elastic" if elastic.count == 1 else "elastics"
        notion = translate(f"{{count}} {word} of {{length}}, at most {{width}} wide", count=elastic.count, **values)
        self.tasks[-1].notions.append(notion)

    def _close(self) -> None:
        """Add what closes the garment, with its notions: zips, buttons, hooks."""
        drafted, zipped = list(self.drafted.values()), False
        # Zips that run on beyond the lower end of their seam.
        running = {
            (each.style, each.length): each.begin
            for task in self.tasks for seam in task.seams for each in seam.openings if each.kind == "zip" and each.whole
        }  # fmt: skip
        for task in self.tasks:
            found = [opening for seam in task.seams for opening in seam.openings if opening.kind == "zip"]
            if not found or not task.technique.endswith(("_zip", "fly")):
                continue
            zipped, opening = True, found[0]
            length = length_words(opening.length, self.units)
            count = len(task.seams)
            words = f"{{count}} {opening.style} {'zip' if count == 1 else 'zips'} of {{length}}"
            above = running.get((opening.style, opening.length))
            runs_on = above is not None and opening.begin < min(0.0, above)
            if not runs_on:
                task.notions.append(translate(words, count=count, length=length))
            where = "all along" if opening.whole else "from the upper edge down to the end of its line"
            if runs_on:
                where = f"on from the seam above, {'all along' if opening.whole else 'down to the end of its line'}"
            elif opening.begin > 0.0 and not opening.whole:
                where = "from {begin} below the upper edge down to the end of its line"
            below = [each.kind for each in task.seams[0].openings if each.kind in ("slit", "vent")]
            closed = f"Then close the seam below it{', down to the ' + below[0] if below else ''}."
            task.values = {
                "length": length,
                "where": translate(where, begin=length_words(opening.begin, self.units)),
                "below": "" if opening.whole else translate(closed),
                "front": translate(f"{self.above} front"),
            }
        ended = [piece for piece in drafted if _buttons_at_one_end(piece)]
        counts: dict[str, list[DraftedPiece]] = {}
        for piece in drafted:
            if piece not in ended and sum(name.startswith("button") for name in piece.piece.marks) > 1:
                counts.setdefault(self.titles[piece.name], []).append(piece)
        for pieces in counts.values():
            count = sum(name.startswith("button") for name in pieces[-1].piece.marks)
            holes = [piece.internal_lines["buttonhole"] for piece in pieces if "buttonhole" in piece.internal_lines]
            words = translate("{count} buttons", count=count)
            if holes:
                length = length_words(polyline_length(holes[0]), self.units)
                words += translate(", for buttonholes of {length}", length=length)
            values = {"count": count, "half": translate(f"{self.above} half")}
            self.tasks.append(
                Task(technique="buttonholes", pieces=[p.name for p in pieces], values=values, notions=[words])
            )
        if ended:
            # Both layers of a collar have one button.
            count = sum(p.piece.quantity // (2 if p.piece.role == "collar" else 1) for p in ended)
            words = translate("{count} small buttons" if count > 1 else "1 small button", count=count)
            self.tasks.append(Task(technique="end_button", pieces=[p.name for p in ended], notions=[words]))
        bands = [p.name for p in drafted if p.piece.role == "waistband" and not _buttons_at_one_end(p)]
        if zipped and bands:
            self.tasks.append(Task(technique="hook", pieces=bands, notions=[translate("1 hook and bar")]))


def is_flounce(piece: Piece) -> bool:
    """Return whether a piece is a panel of a flounce."""
    return "flounce" in re.split("[ _]", piece.name)


def _buttons_at_one_end(piece: DraftedPiece) -> bool:
    """Return whether a strip buttons upon itself: a cuff, or the stand of a collar."""
    return piece.piece.role in ("cuff", "collar", "waistband") and "button" in piece.piece.marks


def pieces_of(places: Iterable[Place]) -> list[str]:
    return list(dict.fromkeys(piece for piece, _ in places))
