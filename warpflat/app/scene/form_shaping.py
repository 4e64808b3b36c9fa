"""Which darts and seams the shape of a form gets: a book's or the best of all candidates, without darts that the body does not want."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

import numpy as np

from warpflat.app.scene.cuts import asked_cuts, omitted, place_of, scene_with
from warpflat.app.scene.form import scene_recipe
from warpflat.app.scene.ledger import candidate_cuts, trial_of_scene, try_cuts, with_cut
from warpflat.app.scene.load import Scene
from warpflat.app.scene.plan import plan_form_scene
from warpflat.flat import Flattening, LedgerEntry, RankedBy
from warpflat.garment import (
    ELBOW,
    NEAR_ARMHOLE,
    FormDart,
    FormGarment,
    Garment,
    closed_darts,
    crowded_darts,
)

__all__ = [
    "ClosedDarts",
    "require_open_darts",
    "settle_shape",
    "sewn_form",
    "with_open_darts",
    "without_closed_darts",
]

Made = TypeVar("Made")


def settle_shape(scene: Scene, *, device: str | None = None) -> tuple[Scene, tuple[str, ...]]:
    """Return a scene whose form has the cuts that `[auto_cut]` or `shape = "auto"` ask for, and notes about them.

    With `shape = "auto"` a piece gets a book's darts, the one that releases most first, until no cloth of it is strained
    beyond its limit, or none of the darts that are left brings it nearer.

    Raises:
        InputError: the scene is wrong.
    """
    settings = scene.settings
    if settings.mannequin is None or (settings.auto_cut is None and settings.shape != "auto"):
        return scene, ()
    if settings.auto_cut is not None:
        auto = settings.auto_cut
        cut, made = _cut(
            scene_with(scene, auto_cut=None), auto.is_enough, most=auto.max_cuts, by=auto.by, device=device
        )
        return cut, (_note(made),)
    own = asked_cuts(scene)
    bare = scene_with(scene, shape="darts")
    places = {place_of(table) for table in own}
    book = scene_recipe(scene_with(bare, cuts=[]))[1].darts
    bare = scene_with(bare, cuts=[*own, *(omitted(dart) for dart in book if dart.place not in places)])
    cut, made = _cut(bare, lambda piece: piece.fit.outside == 0.0, by="released", usual_only=True, device=device)
    return cut, (_note(made),)


def _cut(
    scene: Scene,
    is_enough: Callable[[Flattening], bool],
    *,
    by: RankedBy,
    most: int | None = None,
    usual_only: bool = False,
    device: str | None = None,
) -> tuple[Scene, list[LedgerEntry]]:
    """Cut greedily; return the scene with its cuts, and the entry of each.

    Args:
        scene: before.
        is_enough: whether a piece needs no further cut.
        by: what makes a cut the best.
        most: so many cuts at most; a pair that mirrors each other counts as one.
        usual_only: a book's darts only, of which those are made that leave less cloth strained beyond its limit.
        device: Warp device.
    """
    made: list[LedgerEntry] = []
    known: dict[str, tuple[LedgerEntry, ...]] = {}
    while most is None or len(made) < most:
        plan, garment = trial_of_scene(scene, device=device)
        wanting = [name for name, piece in garment.pieces.items() if not is_enough(piece)]
        asked = [name for name in wanting if name not in known]
        cuts = list(candidate_cuts(plan, garment, among=asked, usual_only=usual_only))
        for name in asked:
            known[name] = try_cuts(
                plan, garment, [one for one in cuts if one[0]["piece"] == name], by=by, listed=False
            )[0]
        helpful = [
            entry
            for name in wanting
            for entry in known[name]
            if entry.helps and (not usual_only or entry.outside_after < entry.outside_before)
        ]
        if not helpful:
            break
        best = max(helpful, key=lambda entry: float(getattr(entry, by)))
        scene = with_cut(scene, best.cut)
        made.append(best)
        # Other pieces are as they were.
        known = {name: entries for name, entries in known.items() if name not in best.pieces}
    return scene, made


def _note(made: list[LedgerEntry]) -> str:
    """Return a sentence about the cuts that were made."""
    words = [
        f"{entry.cut['piece']}.{entry.cut['name']} along {entry.cut['line']} releases {1e3 * entry.released:.3g} mJ"
        for entry in made
    ]
    return f"cuts found: {'; '.join(words)}" if made else "no cut was found that would help"


#: The cut that takes over from a bust dart.
_SHOULDER = {"name": "shoulder dart", "line": "princess front left", "at": "shoulder left"}
# As it opens, the cloth beside it swings towards the armhole by so much [m].
_SWING = 0.01


class ClosedDarts(Exception):
    """Darts of a scene's shape cannot be sewn: they do not open, or lie too near the armhole.

    Attributes:
        without: the scene without them.
        notes: one sentence for each.
    """

    def __init__(self, without: Scene, notes: tuple[str, ...]) -> None:
        super().__init__(*notes)
        self.without, self.notes = without, notes


def without_closed_darts(scene: Scene, garments: Iterable[FormGarment]) -> tuple[Scene, tuple[str, ...]]:
    """Return a scene without the darts of its shape that cannot be sewn in some size, and one sentence for each.

    A body may want no dart where a pattern book has one, such as in the skirt of one whose belly stands out: a dart that does
    not open is left out. One that comes too near the armhole moves to the shoulder, where the piece has one.

    Args:
        scene: the one that has been flattened.
        garments: its garment, in every size.
    """
    from scipy.spatial import cKDTree

    own = {place_of(table.model_dump()) for table in scene.settings.cuts}
    closed: list[FormDart] = []
    crowded: list[FormDart] = []
    movable: set[str] = set()
    for garment in garments:
        closed += [d for d in closed_darts(garment.form, garment.positions) if d.place not in own and d not in closed]
        crowded += [
            d for d in crowded_darts(garment.form, garment.positions) if d.place not in own and d not in crowded
        ]
        form, lines = garment.form, garment.form.layout.lines
        armholes = cKDTree(form.vertices[np.concatenate([lines[f"armhole {side}"] for side in ("left", "right")])])
        # Where a shoulder is narrow, a dart there would be as near to the armhole.
        movable |= {
            piece
            for dart in form.usual_darts()
            if dart.name == _SHOULDER["name"]
            for piece, row in form.dart_rows(dart)
            if armholes.query(form.vertices[row])[0].min() > NEAR_ARMHOLE + _SWING
        }
    if scene.settings.shape != "darts":
        # A woven sleeve around a bent elbow has its dart in every shape.
        closed, crowded = [dart for dart in closed if ELBOW in dart.place], []
    if not closed and not crowded:
        return scene, ()
    cuts, notes = asked_cuts(scene), []
    for dart in (*closed, *(dart for dart in crowded if dart not in closed)):
        cuts.append(omitted(dart))
        if dart in closed:
            why = "is left out, since the cloth would not open it; [[cuts]] with mouth_mm keeps it"
        elif dart.piece in movable:
            cuts.append({"piece": dart.piece} | _SHOULDER)
            why = "lies along the shoulder's princess line instead: from the side it would come within 30 mm of the armhole"
        else:
            why = "is left out, since it would come within 30 mm of the armhole; [[cuts]] keeps it or gives another one"
        notes.append(f"{dart.piece}: the {dart.name} {why}")
    return scene_with(scene, cuts=cuts), tuple(notes)


def with_open_darts(scene: Scene, make: Callable[[Scene], Made]) -> tuple[Scene, Made, tuple[str, ...]]:
    """Return a scene without the darts that cannot be sewn, what is made of it, and one sentence for each of these darts.

    Args:
        scene: with its shape settled.
        make: makes it of a scene; raises `ClosedDarts` if it is to be made without some.
    """
    notes: tuple[str, ...] = ()
    while True:
        try:
            return scene, make(scene), notes
        except ClosedDarts as closed:
            scene, notes = closed.without, (*notes, *closed.notes)


def sewn_form(scene: Scene, *, device: str | None = None) -> tuple[Scene, FormGarment, tuple[str, ...]]:
    """Return a scene without the darts that cannot be sewn, its garment, flattened and sewn, and one sentence for each of these darts.

    Raises:
        InputError: as :func:`warpflat.app.scene.plan.plan_form_scene`.
    """

    def sewn(one: Scene) -> FormGarment:
        garment = plan_form_scene(one, device=device).flatten()
        require_open_darts(one, [garment])
        return garment

    return with_open_darts(scene, sewn)


def require_open_darts(scene: Scene, garments: Iterable[Garment]) -> None:
    """Check that the darts of a scene's shape can be sewn in the garment of every size.

    Raises:
        ClosedDarts: some of them cannot.
    """
    on_form = (garment for garment in garments if isinstance(garment, FormGarment))
    without, notes = without_closed_darts(scene, on_form)
    if notes:
        raise ClosedDarts(without, notes)
