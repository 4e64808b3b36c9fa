"""Layouts that a run has passed through are kept in a file here, and the frames of a film are placed along their path.

A solver's steps make a poor film: most of the way lies in a few of them. So frames are spread evenly along the path that the piece
takes, and layouts between two that were computed are interpolated. The length of a path is measured by the vertex that moves farthest,
so that no vertex moves farther in a frame than the frame's share of the path.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryFile
from types import TracebackType
from typing import Any, BinaryIO, cast

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import CannotWriteError
from warpflat.export.geometry import Polylines

__all__ = ["FilmStage", "Frame", "Key", "KeyFile"]

# Largest displacement below which a stage stands still [m].
_STILL = 1e-7


@dataclass(frozen=True, kw_only=True)
class Key:
    """A computed layout in a :class:`KeyFile`.

    Attributes:
        place: where its arrays begin in the file [bytes].
        measures: numbers of this layout.
    """

    place: int
    measures: Mapping[str, float]


@dataclass(frozen=True, kw_only=True)
class Frame:
    """A frame of one piece.

    Attributes:
        measures: numbers of this layout.
        positions: #P by 2, the layout [m]; None of one in between that is not asked for.
        face_energy_density: #F, strain energy per area [J/m2]; None of a layout evenly between the computed ones before and after.
    """

    measures: Mapping[str, float]
    positions: NDArray[np.float32] | None = None
    face_energy_density: NDArray[np.float32] | None = None


@dataclass(kw_only=True, eq=False)
class FilmStage:
    """A part of a piece's film in which its topology stays.

    Attributes:
        name: of the solver's stage.
        vertex_count, face_count: size of the pattern.
        topology: what the first frame of the stage changes: faces, lines, cuts; nothing if the topology goes on.
        keys: the computed layouts, the first and the last of the stage among them.
        still: whether it only shows its one layout.
    """

    name: str
    vertex_count: int
    face_count: int
    topology: Mapping[str, IntArray | Mapping[str, Any] | Mapping[str, Polylines] | None]
    keys: list[Key] = field(default_factory=list)
    still: bool = False


class KeyFile:
    """A file without a name, in which computed layouts are kept until the end of the run; used in a ``with`` block.

    Attributes:
        film: the file that is made of them.
        failed: whether a layout could not be kept.
    """

    def __init__(self, folder: Path) -> None:
        self._file = cast(BinaryIO, TemporaryFile(dir=folder, buffering=0))  # noqa: SIM115 (open as long as the film)
        self._end = 0
        self.film = folder / "frames.usdc"
        self.failed = False

    def __enter__(self) -> KeyFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def append(self, positions: FloatArray, density: FloatArray, measures: Mapping[str, float]) -> Key:
        """Write a layout (#P by 2 [m]) and its energies per face (#F [J/m2]).

        Raises:
            InputError: there is no room for it.
        """
        key = Key(place=self._end, measures=dict(measures))
        try:
            self._file.seek(self._end)
            for values in (positions, density):
                left = memoryview(np.ascontiguousarray(values, dtype=np.float32).tobytes())
                while left:
                    # Unbuffered, a write may take only a part.
                    written = self._file.write(left)
                    self._end, left = self._end + written, left[written:]
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise CannotWriteError(f"cannot write {self.film}: {reason}") from error
        return key

    def positions(self, stage: FilmStage, key: Key) -> NDArray[np.float32]:
        """Read the layout of a key, #P by 2 [m]."""
        return self._read(key.place, 2 * stage.vertex_count).reshape(-1, 2)

    def density(self, stage: FilmStage, key: Key) -> NDArray[np.float32]:
        """Read the energies of a key, #F [J/m2]."""
        return self._read(key.place + 8 * stage.vertex_count, stage.face_count)

    def _read(self, place: int, count: int) -> NDArray[np.float32]:
        self._file.seek(place)
        content = bytearray()
        while len(content) < 4 * count:
            content += self._file.read(4 * count - len(content))
        return np.frombuffer(content, dtype=np.float32)

    def displacement(self, stage: FilmStage, keys: Sequence[Key]) -> float:
        """Return how far the vertex that moves farthest comes in these layouts from its place at the start of a stage [m]."""
        first = self.positions(stage, stage.keys[0])
        return max(_largest_move(first, self.positions(stage, key)) for key in keys)

    def thin(self, stage: FilmStage, spacing: float) -> tuple[list[Key], list[float]]:
        """Return keys at least `spacing` apart [m], the first and the last among them, and the distances between them [m]."""
        kept, at = [stage.keys[0]], self.positions(stage, stage.keys[0])
        distances = list[float]()
        for key in stage.keys[1:]:
            positions = self.positions(stage, key)
            distance = _largest_move(at, positions)
            if distance >= spacing and key is not stage.keys[-1]:
                kept.append(key)
                distances.append(distance)
                at = positions
        if len(stage.keys) > 1:
            last = self.positions(stage, stage.keys[-1])
            if distances and _largest_move(at, last) < 0.5 * spacing:
                # The end replaces a key that lies close to it.
                kept.pop()
                distances.pop()
                at = self.positions(stage, kept[-1])
            kept.append(stage.keys[-1])
            distances.append(_largest_move(at, last))
        return kept, distances

    def place_frames(self, stage: FilmStage, *, steps: float, at_least: int, most_keys: int) -> tuple[list[Key], int]:
        """Choose the keys that are shown, and the number of frames.

        Args:
            stage: of the film.
            steps: into so many frames the stage's largest displacement is parted, or more.
            at_least: frames.
            most_keys: at least 2.
        """
        way = self.displacement(stage, stage.keys)
        if way <= _STILL:
            return [stage.keys[0], stage.keys[-1]], at_least
        spacing = 2.0 * way / steps
        while True:
            keys, distances = self.thin(stage, spacing)
            shown = max(self.displacement(stage, keys), _STILL)  # the layout farthest out may be left out
            wanted = 1 + sum(math.ceil(steps * distance / shown) for distance in distances)
            if len(keys) <= 2 or (len(keys) <= most_keys and wanted <= 4 * at_least):
                return keys, max(wanted, at_least)
            spacing *= 1.5

    def frames(self, stage: FilmStage, keys: Sequence[Key], number: int, *, between: bool) -> Iterator[Frame]:
        """Yield `number` frames along the path through these keys, each of which is one of the frames.

        Those between two keys have no energies of their own: the way from one to the next is straight and even. Their layouts are there
        if `between` asks for them.
        """
        distances = [_largest_move(self.positions(stage, a), self.positions(stage, b)) for a, b in pairwise(keys)]
        yield self._computed(stage, keys[0])
        counts = spread(distances, number - 1)
        for (begin, end), count in zip(pairwise(keys), counts, strict=True):
            for step in range(1, count):
                share = step / count
                measures = {
                    key: (1.0 - share) * value + share * end.measures[key]
                    for key, value in begin.measures.items()
                    if key in end.measures
                }
                first, last = (self.positions(stage, key) if between else None for key in (begin, end))
                layout = None if first is None or last is None else first + np.float32(share) * (last - first)
                yield Frame(positions=layout, measures=measures)
            yield self._computed(stage, end)
        for _ in range(number - 1 - sum(counts)):
            yield self._computed(stage, keys[-1])

    def _computed(self, stage: FilmStage, key: Key) -> Frame:
        return Frame(
            positions=self.positions(stage, key),
            face_energy_density=self.density(stage, key),
            measures=key.measures,
        )


def spread(distances: Sequence[float], number: int) -> list[int]:
    """Part `number` steps among distances so that the longest step is as short as can be; each distance takes at least one."""
    counts = [1] * len(distances)
    queue = [(-distance, index) for index, distance in enumerate(distances)]
    heapq.heapify(queue)
    for _ in range(number - len(distances)):
        if not queue:
            break
        _, index = queue[0]
        counts[index] += 1
        heapq.heapreplace(queue, (-distances[index] / counts[index], index))
    return counts


def _largest_move(before: NDArray[np.float32], after: NDArray[np.float32]) -> float:
    """Return how far the vertex that moves farthest moves [m]."""
    return float(np.sqrt(((after - before) ** 2).sum(axis=1).max()))
