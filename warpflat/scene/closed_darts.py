"""Darts of a scene's shape that a body does not want."""

from __future__ import annotations

from collections.abc import Iterable

from warpflat.garment.darts import closed_darts
from warpflat.garment.garment import Garment
from warpflat.mannequin.elbow_darts import ELBOW
from warpflat.scene.form_cuts import place_of, scene_with
from warpflat.scene.load import Scene

__all__ = ["ClosedDarts", "require_open_darts", "without_closed_darts"]


class ClosedDarts(Exception):
    """Darts of a scene's shape do not open.

    Attributes:
        without: the scene without them.
        notes: one sentence for each.
    """

    def __init__(self, without: Scene, notes: tuple[str, ...]) -> None:
        super().__init__(*notes)
        self.without, self.notes = without, notes


def without_closed_darts(scene: Scene, garments: Iterable[Garment]) -> tuple[Scene, tuple[str, ...]]:
    """Return a scene without the darts of its shape that do not open in some size, and one sentence for each that is left out.

    A body may want no dart where a pattern book has one, such as in the skirt of one whose belly stands out.

    Args:
        scene: the one that has been flattened.
        garments: its garment, in every size.
    """
    own = {place_of(table.model_dump()) for table in scene.settings.cuts}
    closed = []
    for garment in garments:
        found = [] if garment.form is None else closed_darts(garment.form, garment.positions)
        closed += [d for d in found if d.place not in own and d not in closed]
    if scene.settings.shape != "darts":
        # A woven sleeve around a bent elbow has its dart in every shape.
        closed = [dart for dart in closed if ELBOW in dart.place]
    if not closed:
        return scene, ()
    cuts = [table.model_dump(exclude_unset=True, by_alias=True) for table in scene.settings.cuts]
    for dart in closed:
        place = zip(("piece", "line", "towards", "at"), dart.place, strict=True)
        cuts.append({key: value for key, value in place if value} | {"omit": True})
    notes = tuple(
        f"{dart.piece}: the {dart.name} is left out, since the cloth would not open it; [[cuts]] with mouth_mm keeps it"
        for dart in closed
    )
    return scene_with(scene, cuts=cuts), notes


def require_open_darts(scene: Scene, garments: Iterable[Garment]) -> None:
    """Check that the darts of a scene's shape open in the garment of every size.

    Raises:
        ClosedDarts: some darts of the scene's shape do not open.
    """
    without, notes = without_closed_darts(scene, garments)
    if notes:
        raise ClosedDarts(without, notes)
