"""A piece whose pattern is known and taken as it is, and how far a layout lies from it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from warpflat.core import FloatArray, laid_upon
from warpflat.flat import (
    Development,
    Fabric,
    Flattening,
    Relaxation,
    RelaxOptions,
    SpringNetwork,
    Surface,
    check_settings,
    laid_stage,
    resolve_datum,
)

__all__ = ["CutPattern", "distances_laid", "laid_as_cut"]


@dataclass(frozen=True, kw_only=True)
class CutPattern:
    """A pattern that was taken as it is.

    Attributes:
        unit: of the texture that it is.
        area_ratio: its area over that of the worn cloth.
        distances: by piece how far the vertices of what flattening gives lie from it, #V [m]; empty if that was not asked for.
    """

    unit: str
    area_ratio: float
    distances: Mapping[str, FloatArray]

    def as_dict(self) -> dict[str, Any]:
        """Return the entry `pattern_of_file` of `metrics.json`."""

        def measured(off: FloatArray) -> dict[str, float]:
            return {"mean_mm": 1e3 * float(off.mean()), "p95_mm": 1e3 * float(np.percentile(off, 95))}

        return {
            "unit": self.unit,
            "area_ratio": self.area_ratio,
            **(measured(np.concatenate(list(self.distances.values()))) if self.distances else {}),
            "pieces": {name: measured(off) for name, off in self.distances.items()},
        }


def laid_as_cut(surface: Surface, cut: FloatArray, *, fabric: Fabric, device: str | None = None) -> Flattening:
    """Return a piece that lies as it was cut, with the energy that its cloth then has as it is worn; nothing is relaxed.

    Args:
        surface: as worn, #V vertices.
        cut: #V by 2, its pattern [m], no face mirrored; the warp runs along +y.
        fabric: its cloth.
        device: Warp device.
    """
    begun = time.perf_counter()
    line, title, _ = resolve_datum(surface, None)
    settings = check_settings(fabric, grain_angle=0.0, model="auto", wear=None, relax=None, device=device)
    network = SpringNetwork.build(surface, settings.fabric, cut, device=settings.device)
    energies = Relaxation(network, RelaxOptions(), start=cut).energies()
    stage = laid_stage("as cut", network, cut, energies, seconds=time.perf_counter() - begun)
    return Flattening(
        surface=surface,
        fabric=settings.fabric,
        datum=line,
        datum_name=title,
        grain_angle=0.0,
        network=network,
        development=Development(positions=cut, method="given", mended=True),
        positions=cut,
        stages=(stage,),
        history=np.empty((0, 4)),
        notes=surface.notes,
        options=settings.options,
    )


def distances_laid(layout: FloatArray, cut: FloatArray) -> FloatArray:
    """Return how far each place lies from its own in the cut panel, #V, when laid on it, turned, moved, and mirrored if that is nearer.

    Args:
        layout, cut: #V by 2 [m].
    """
    off = (np.linalg.norm(laid_upon(cut, layout * [mirror, 1.0]) - cut, axis=1) for mirror in (1.0, -1.0))
    return min(off, key=lambda row: float(row.mean()))
