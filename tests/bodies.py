"""Bodies of a size and bodies fitted to scans, each made once in a run of the tests, whoever asks; nobody changes one."""

from __future__ import annotations

import functools
import hashlib
import os
import pickle
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from warpflat.garment.mannequin.body_model import BodyModel, Person, rotation
from warpflat.garment.mannequin.common_body import CommonBody
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.stand_body import StandingBody, stand_body

__all__ = ["body_of_size", "built_once", "had_by_all", "laid_once", "mean_person", "stood", "with_bent_elbows"]

_Made = TypeVar("_Made")
_from_size, _of_mannequin = Mannequin.from_size, CommonBody.of_mannequin


def had_by_all(key: bytes, make: Callable[[], _Made]) -> _Made:
    """Return what `make` gives; of processes that run the tests beside each other one makes it, and the others read its file."""
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID")
    if run is None:
        return make()
    file = Path(tempfile.gettempdir()) / f"warpflat-tests-{run}" / hashlib.sha256(key).hexdigest()
    if not file.exists():
        file.parent.mkdir(exist_ok=True)
        part = file.with_suffix(f".{os.getpid()}")
        part.write_bytes(pickle.dumps(make()))
        part.replace(file)
    # Whoever made it reads it, too: all have the same.
    return pickle.loads(file.read_bytes())  # type: ignore[no-any-return]


@functools.cache
def _built(size: str, resolution_mm: float, lengths: tuple[tuple[str, float], ...]) -> Mannequin:
    return _from_size(size, resolution_mm=resolution_mm, **dict(lengths))


def built_once(size: str, *, resolution_mm: float = 10.0, **lengths: float) -> Mannequin:
    """In place of `Mannequin.from_size`."""
    return _built(size, resolution_mm, tuple(sorted(lengths.items())))


def body_of_size(resolution_mm: float, size: str = "EU 38") -> Mannequin:
    """The mannequin of a size, with edges about so long."""
    return built_once(size, resolution_mm=resolution_mm)


@functools.cache
def _laid(mannequin: Mannequin) -> CommonBody:
    key = b"laid" + mannequin.vertices.tobytes() + mannequin.layout.faces.tobytes()
    return had_by_all(key, lambda: _of_mannequin(mannequin, name=""))


@functools.cache
def laid_once(mannequin: Mannequin, *, name: str) -> CommonBody:
    """In place of `CommonBody.of_mannequin`."""
    return replace(_laid(mannequin), name=name)


_stood: dict[bytes, StandingBody] = {}


def stood(vertices: np.ndarray, triangles: np.ndarray, **asked: Any) -> StandingBody:
    """The body that is fitted to a scan: one fit for all that asks other things of the same scan; in place of `stand_body`."""
    key = vertices.tobytes() + triangles.tobytes() + repr(sorted(asked.items())).encode()
    if key not in _stood:
        _stood[key] = had_by_all(key, lambda: stand_body(vertices, triangles, **asked))
    return _stood[key]


def with_bent_elbows(body: Mannequin) -> Mannequin:
    """The body with its forearms turned forward by 35 degrees about the elbows, in a bow."""
    layout, vertices = body.layout, body.vertices.copy()
    for grid in layout.arms.values():
        elbow, wrist = layout.arm_row["elbow"], layout.arm_row["wrist"]
        joint = vertices[grid[elbow]].mean(axis=0)
        share = np.clip((np.arange(len(grid)) - elbow + 2) / 4.0, 0.0, 1.0)
        for row in range(elbow - 1, wrist + 1):
            angle = np.radians(35.0) * share[row]
            c, s = np.cos(angle), np.sin(angle)
            turn = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
            vertices[grid[row]] = joint + (vertices[grid[row]] - joint) @ turn.T
    return replace(body, vertices=vertices)


def mean_person(model: BodyModel) -> Person:
    """The body of no shape in particular, 1.7 times as large as the model and in its pose."""
    return Person(
        shape=np.zeros(len(model.shapes)),
        bend=rotation(np.zeros((len(model.joints), 3))),
        turn=np.eye(3),
        scale=1.7,
        place=np.zeros(3),
    )
