"""Statistics over the bodies of a batch: how patterns grow with girths, and which bodies a graded size does not fit."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from warpflat.app.batch.task import DONE, WITH_FAULTS, Row
from warpflat.core import read_result
from warpflat.pattern import has_seal

__all__ = [
    "BODY_GIRTHS",
    "MEASURES",
    "BodyPattern",
    "Trend",
    "bodies_table",
    "compare_with_sizes",
    "fit_trend",
    "read_body_patterns",
]

BODY_GIRTHS = ("bust", "waist", "hip")
# Of a pattern, with its unit in tables and pictures and what one of it is in SI units.
MEASURES = {
    "dart_intake": ("cm", 0.01),
    "side_seam": ("cm", 0.01),
    "area": ("cm2", 1e-4),
    "strain_energy": ("mJ", 1e-3),
}
# A graded size whose ease at a level is off by more is not what was asked for: half the step between two sizes of a table [m].
_EASE_TOLERANCE = 0.02


@dataclass(frozen=True, kw_only=True)
class BodyPattern:
    """What a task made for its body.

    Attributes:
        row: of the task.
        is_size: whether the body is a size of a table.
        girths: bust, waist and hip of the body [m].
        measures: by the names of MEASURES [m, m2, J]; a measure that the pattern does not have is missing.
        pattern_girths: of the pattern with darts and seams closed, by level [m].
        strain_limit: of its cloth.
        size: the body of the nearest size in the batch; empty if there is none.
        graded_ease: of that size's pattern around this body, by level [m].
    """

    row: Row
    is_size: bool
    girths: Mapping[str, float]
    measures: Mapping[str, float]
    pattern_girths: Mapping[str, float]
    strain_limit: float
    size: str = ""
    graded_ease: Mapping[str, float] = field(default_factory=dict)

    @property
    def ease(self) -> dict[str, float]:
        """Ease of its own pattern, by level [m]."""
        return {level: girth - self.girths[level] for level, girth in self.pattern_girths.items()}

    @property
    def misfit(self) -> dict[str, float]:
        """Ease of the nearest size's pattern less that of its own, by level [m]; negative where the size is tighter."""
        return {level: ease - self.ease[level] for level, ease in self.graded_ease.items() if level in self.ease}

    @property
    def graded_strain(self) -> float:
        """The most that the nearest size's pattern must stretch around this body; 0 where it is wide enough."""
        strains = (-ease / (self.girths[level] + ease) for level, ease in self.graded_ease.items())
        return max(0.0, *strains) if self.graded_ease else 0.0

    @property
    def pays(self) -> bool:
        """Whether a pattern made to measure is better than the nearest size: by the cloth's limit, or by its ease."""
        off = max(map(abs, self.misfit.values()), default=0.0)
        return self.graded_strain > self.strain_limit or off > _EASE_TOLERANCE


@dataclass(frozen=True, kw_only=True)
class Trend:
    """A straight line through measures over girths.

    Attributes:
        slope: of the measure per metre of girth.
        offset: of the measure at no girth.
        determination: R2, 1 if all lie on the line.
    """

    slope: float
    offset: float
    determination: float


def read_body_patterns(rows: Sequence[Row], out: Path) -> list[BodyPattern]:
    """Return the patterns of all tasks that are done and have a body, with the ease of the nearest size of the batch.

    Args:
        rows: of a batch.
        out: its folder.
    """
    patterns = list[BodyPattern]()
    for row in (row for row in rows if row.status in (DONE, WITH_FAULTS)):
        try:
            metrics = read_result(out / row.task.key / "metrics.json")
            if not has_seal(metrics):
                continue  # nobody knows what it holds
            levels = metrics["mannequin"]["levels"]
            girths = {level: float(levels[level]["girth_m"]) for level in BODY_GIRTHS}
        except (ValueError, KeyError, TypeError):
            continue
        body = row.task.data.get("mannequin") or {}
        pieces = list(metrics["pieces"].values())
        measures = {
            "area": sum(piece["area_m2"] for piece in pieces),
            "strain_energy": sum(piece["strain_energy_j"] for piece in pieces),
        }
        if darts := [dart["intake_m"] for piece in pieces for dart in piece.get("darts", ())]:
            measures["dart_intake"] = sum(darts)
        sides = [seam for seam in metrics.get("seams", ()) if "side" in seam["name"] and "left" in seam["name"]]
        if sides:
            measures["side_seam"] = 1e-3 * sum(seam["length_mm"][0] for seam in sides)
        patterns.append(
            BodyPattern(
                row=row,
                is_size=not {"scan", "measurements"} & {key for key, value in body.items() if value},
                girths=girths,
                measures=measures,
                pattern_girths={level: value for level, value in row.girths_m.items() if level in girths},
                strain_limit=min((piece["wear"]["strain_limit"] for piece in pieces if piece.get("wear")), default=0.0),
            )
        )
    return compare_with_sizes(patterns)


def compare_with_sizes(patterns: Sequence[BodyPattern]) -> list[BodyPattern]:
    """Return the patterns with the ease that the nearest size of the same scene, fabric and override leaves each body.

    The nearest size has the least sum of squared differences of bust, waist and hip.
    """

    def kind(pattern: BodyPattern) -> tuple[str, str, str]:
        task = pattern.row.task
        return task.scene, task.fabric, task.override

    compared = []
    for pattern in patterns:
        sizes = [each for each in patterns if each.is_size and kind(each) == kind(pattern)]
        if pattern.is_size or not sizes:
            compared.append(pattern)
            continue
        size = min(sizes, key=lambda each: sum((each.girths[k] - pattern.girths[k]) ** 2 for k in BODY_GIRTHS))
        ease = {level: girth - pattern.girths[level] for level, girth in size.pattern_girths.items()}
        compared.append(replace(pattern, size=size.row.task.body, graded_ease=ease))
    return compared


def fit_trend(girths: ArrayLike, measures: ArrayLike) -> Trend | None:
    """Return the least-squares line through measures over girths; None if fewer than three girths differ."""
    x, y = np.asarray(girths, dtype=float), np.asarray(measures, dtype=float)
    if len(np.unique(x.round(4))) < 3:
        return None
    slope, offset = np.polyfit(x, y, 1)
    spread = float(((y - y.mean()) ** 2).sum())
    rest = float(((y - slope * x - offset) ** 2).sum())
    return Trend(slope=float(slope), offset=float(offset), determination=1.0 - rest / spread if spread > 0.0 else 1.0)


def bodies_table(patterns: Sequence[BodyPattern]) -> str:
    """Return the text of `bodies.csv`: a row for each pattern."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(
        [
            *("key", "scene", "fabric", "body", *(f"{level}_m" for level in BODY_GIRTHS)),
            *("dart_intake_m", "side_seam_m", "area_m2", "strain_energy_j"),
            *(f"{level}_ease_m" for level in BODY_GIRTHS),
            *(
                "nearest_size",
                *(f"{level}_ease_in_size_m" for level in BODY_GIRTHS),
                "strain_in_size",
                "made_to_measure_pays",
            ),
        ]
    )
    for pattern in patterns:
        task, graded = pattern.row.task, bool(pattern.size)
        writer.writerow(
            [
                *(task.key, task.scene, task.fabric, task.body, *(pattern.girths[level] for level in BODY_GIRTHS)),
                *(pattern.measures.get(name) for name in MEASURES),
                *(pattern.ease.get(level) for level in BODY_GIRTHS),
                *(pattern.size, *(pattern.graded_ease.get(level) for level in BODY_GIRTHS)),
                *((pattern.graded_strain, "yes" if pattern.pays else "no") if graded else (None, None)),
            ]
        )
    return text.getvalue()
