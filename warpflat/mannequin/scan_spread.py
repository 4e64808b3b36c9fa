"""Which of a noisy scan's tapes its noise makes a guess, found on copies with as much noise again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from warpflat.core.errors import InputError
from warpflat.mannequin.scan_measures import ScanMeasure
from warpflat.mannequin.scan_noise import smooth_noise
from warpflat.mannequin.slicer import Slicer

__all__ = ["guess_by_noise"]

_COPIES = 5
# The median by which vertices waver off their neighbours is 0.91 of the deviation of their noise along each axis.
_DEVIATION = 1.1
# Twice the deviation of a tape is what ISO 20685 allows a scan's to differ: 4 mm in height, 9 mm in girth [m].
_HEIGHT, _GIRTH = 0.002, 0.0045


def guess_by_noise(
    slicer: Slicer, measures: Mapping[str, ScanMeasure], measure: Callable[[Slicer], Mapping[str, ScanMeasure]]
) -> dict[str, ScanMeasure]:
    """Return a scan's tapes, those a guess that differ by too much on copies with its noise put back and smoothed again.

    Args:
        slicer: the upright scan, its noise smoothed; one without noise is not copied.
        measures: its tapes.
        measure: the measuring of a copy.
    """
    if not slicer.noise:
        return dict(measures)
    random = np.random.default_rng(0)
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in measures}
    for _ in range(_COPIES):
        shaken = slicer.vertices + random.normal(0.0, _DEVIATION * slicer.noise, slicer.vertices.shape)
        points, _ = smooth_noise(shaken, slicer.triangles)
        points[:, 1] -= points[:, 1].min()
        try:
            again = measure(Slicer(points, slicer.triangles, slicer.noise, slicer.scanned))
        except InputError:
            continue
        for name in measures.keys() & again.keys():
            tape, copy = measures[name], again[name]
            found[name].append((copy.height - tape.height, copy.girth - tape.girth))
    reason = f"the scan's noise of {1000.0 * slicer.noise:.1f} mm moves it"
    out = dict(measures)
    for name, moves in found.items():
        height, girth = np.sqrt(np.square(moves).mean(axis=0)) if moves else (np.inf, np.inf)
        if measures[name].guess is None and (height > _HEIGHT or girth > _GIRTH):
            out[name] = replace(measures[name], guess=reason)
    return out
