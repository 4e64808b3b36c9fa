"""A form shaped by itself: the best cut of all candidates is made, again and again, until it is enough."""

from __future__ import annotations

from collections.abc import Callable

from warpflat.cutting.ledger import AutoCut, RankedBy
from warpflat.flattening.result import Flattening
from warpflat.scene.form import scene_recipe
from warpflat.scene.form_cuts import place_of, scene_with
from warpflat.scene.form_ledger import FormEntry, candidate_cuts, trial_of_scene, try_cuts, with_cut
from warpflat.scene.load import Scene

__all__ = ["settle_shape"]


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
        auto = AutoCut(**settings.auto_cut.model_dump())
        cut, made = _cut(
            scene_with(scene, auto_cut=None), auto.is_enough, most=auto.max_cuts, by=auto.by, device=device
        )
        return cut, (_note(made),)
    own = [table.model_dump(exclude_unset=True, by_alias=True) for table in settings.cuts]
    bare = scene_with(scene, shape="darts")
    places = {place_of(table) for table in own}
    omitted = [
        {key: value for key, value in zip(("piece", "line", "towards", "at"), dart.place, strict=True) if value}
        | {"omit": True}
        for dart in scene_recipe(scene_with(bare, cuts=[]))[1].darts
        if dart.place not in places
    ]
    cut, made = _cut(
        scene_with(bare, cuts=[*own, *omitted]), _is_unstrained, by="released", usual_only=True, device=device
    )
    return cut, (_note(made),)


def _is_unstrained(piece: Flattening) -> bool:
    """Return whether no cloth of a piece is strained beyond its limit."""
    return piece.fit.outside == 0.0


def _cut(
    scene: Scene,
    is_enough: Callable[[Flattening], bool],
    *,
    by: RankedBy,
    most: int | None = None,
    usual_only: bool = False,
    device: str | None = None,
) -> tuple[Scene, list[FormEntry]]:
    """Cut greedily; return the scene with its cuts, and the entry of each.

    Args:
        scene: before.
        is_enough: whether a piece needs no further cut.
        by: what makes a cut the best.
        most: so many cuts at most; a pair that mirrors each other counts as one.
        usual_only: a book's darts only, of which those are made that leave less cloth strained beyond its limit.
        device: Warp device.
    """
    made: list[FormEntry] = []
    known: dict[str, tuple[FormEntry, ...]] = {}
    while most is None or len(made) < most:
        base = trial_of_scene(scene, device=device)
        wanting = [name for name, piece in base.garment.pieces.items() if not is_enough(piece)]
        for name in wanting:
            if name not in known:
                cuts = [cut for cut in candidate_cuts(base, usual_only=usual_only) if cut["piece"] == name]
                known[name] = try_cuts(base, cuts, by=by).entries
        helpful = [
            entry
            for name in wanting
            for entry in known[name]
            if entry.can_be_sewn
            and entry.released > 0.0
            and (not usual_only or entry.outside_after < entry.outside_before)
        ]
        if not helpful:
            break
        best = max(helpful, key=lambda entry: float(getattr(entry, by)))
        scene = with_cut(scene, best.cut)
        made.append(best)
        # Other pieces are as they were.
        known = {name: entries for name, entries in known.items() if name not in best.pieces}
    return scene, made


def _note(made: list[FormEntry]) -> str:
    """Return a sentence about the cuts that were made."""
    words = [
        f"{entry.cut['piece']}.{entry.cut['name']} along {entry.cut['line']} releases {1e3 * entry.released:.3g} mJ"
        for entry in made
    ]
    return f"cuts found: {'; '.join(words)}" if made else "no cut was found that would help"
