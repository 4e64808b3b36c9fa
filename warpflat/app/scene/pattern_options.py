"""Pattern options of a scene: its tables `pattern`, `marker` and `cloth`."""

from __future__ import annotations

from warpflat.app.scene.schema import ClothTable, MarkerTable, PatternTable
from warpflat.pattern import EdgeRules, PatternOptions, Shrinkage, language_words

__all__ = ["pattern_options"]


def pattern_options(
    table: PatternTable, marker: MarkerTable | None, cut_from: ClothTable | None = None
) -> PatternOptions:
    """Return the pattern options of a scene's tables `pattern`, `marker` and `cloth`.

    Raises:
        InputError: a gap that is wide against the cloth.
    """
    from warpflat.pattern import Cloth, Stripes

    cloth, cut_from = None, cut_from or ClothTable()
    if marker is not None:
        stripes = Stripes(
            warp=cut_from.repeat_warp_mm / 1000, weft=cut_from.repeat_weft_mm / 1000, seams=tuple(cut_from.match)
        )
        cloth = Cloth(**marker.model_dump(exclude={"seconds"}), stripes=stripes)
    return PatternOptions(
        formats=tuple(table.formats),
        dialect=table.dialect,
        paper=table.paper,
        tolerance=None if table.tolerance_mm is None else table.tolerance_mm / 1000,
        rules=EdgeRules(
            seam=table.allowance_mm / 1000,
            hem=table.hem_mm / 1000,
            kinds=table.kinds,
            allowances={edge: width / 1000 for edge, width in table.allowances_mm.items()},
        ),
        cloth=cloth,
        units=table.units,
        names=table.names,
        words={**language_words(table.language), **table.words},
        marker_seconds=5 if marker is None else marker.seconds,
        shrinkage=Shrinkage(warp=cut_from.shrinkage_warp, weft=cut_from.shrinkage_weft),
        lining=cut_from.lining,
        interfacing=cut_from.interfacing,
        pocketing=cut_from.pocketing,
    )
