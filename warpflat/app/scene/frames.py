"""Frames of a run: the development, the relaxation, the line of a cut, and the crack as it opens."""

from __future__ import annotations

import heapq
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from itertools import chain, pairwise, repeat
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any, BinaryIO, cast

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpflat.app.scene.schema import OutputTable
from warpflat.core import CannotWriteError, FloatArray, IntArray, report_activity, system_reason
from warpflat.flat import Surface, corner_means, half_edges
from warpflat.pattern import Polylines, optional_file

if TYPE_CHECKING:
    from warpflat.flat import CutPlan, Flattening, Progress
    from warpflat.garment import Mannequin

__all__ = ["MANNEQUIN", "Film", "FilmStage", "FrameRecorder", "FrameSchedule", "KeyFile", "path_in_pattern"]


# Largest displacement below which a stage stands still [m].
_STILL = 1e-7


@dataclass(frozen=True, kw_only=True)
class Key:
    """A computed layout in a :class:`KeyFile`.

    Attributes:
        file, place: where its arrays are, and from which byte on.
        vertices, faces: its size.
        measures: numbers of this layout.
    """

    file: BinaryIO
    place: int
    vertices: int
    faces: int
    measures: Mapping[str, float]

    @property
    def positions(self) -> NDArray[np.float32]:
        """The layout, #P by 2 [m]."""
        return self._read(self.place, 2 * self.vertices).reshape(-1, 2)

    @property
    def face_energy_density(self) -> NDArray[np.float32]:
        """Strain energy per area, #F [J/m2]."""
        return self._read(self.place + 8 * self.vertices, self.faces)

    def _read(self, place: int, count: int) -> NDArray[np.float32]:
        self.file.seek(place)
        return np.frombuffer(self.file.read(4 * count), dtype=np.float32)


@dataclass(frozen=True, kw_only=True)
class Between:
    """A frame evenly between the computed layouts before and after.

    Attributes:
        measures: numbers of this layout.
        positions: #P by 2, the layout [m]; None if it is not asked for.
    """

    measures: Mapping[str, float]
    positions: NDArray[np.float32] | None


class KeyFile:
    """A file without a name, in which computed layouts are kept until the end of the run; used in a ``with`` block.

    A film of a large mesh would fill memory; and until its end neither the scale of its colours nor the time of a layout is known.

    Attributes:
        film: the file that is made of them.
        failed: whether a layout could not be kept.
    """

    def __init__(self, folder: Path) -> None:
        self._file = cast(BinaryIO, TemporaryFile(dir=folder))  # noqa: SIM115 (open as long as the film)
        self.film = folder / "frames.usdc"
        self.failed = False

    def __enter__(self) -> KeyFile:
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(OSError):  # what a full disk has not taken
            self._file.close()

    def append(self, positions: FloatArray, density: FloatArray, measures: Mapping[str, float]) -> Key:
        """Write a layout (#P by 2 [m]) and its energies per face (#F [J/m2]).

        Raises:
            InputError: there is no room for it.
        """
        try:
            place = self._file.seek(0, os.SEEK_END)
            for values in (positions, density):
                self._file.write(np.ascontiguousarray(values, dtype=np.float32).data)
            self._file.flush()
        except OSError as error:
            raise CannotWriteError(f"cannot write {self.film}: {system_reason(error)}") from error
        return Key(file=self._file, place=place, vertices=len(positions), faces=len(density), measures=dict(measures))


@dataclass(kw_only=True, eq=False)
class FilmStage:
    """A part of a piece's film in which its topology stays.

    Attributes:
        name: of the solver's stage.
        topology: what the first frame of the stage changes: faces, lines, cuts; nothing if the topology goes on.
        keys: the computed layouts, the first and the last of the stage among them.
        still: whether it only shows its one layout.
        last_first_step: number of the last of the paper's steps with which it begins; 0 without them.
    """

    name: str
    topology: Mapping[str, IntArray | Mapping[str, Any] | Mapping[str, Polylines] | None]
    keys: list[Key] = field(default_factory=list)
    still: bool = False
    last_first_step: int = 0

    def displacement(self, keys: Sequence[Key]) -> float:
        """Return how far the vertex that moves farthest comes in these layouts from its place at the start of the stage [m]."""
        first = self.keys[0].positions
        return max(_largest_move(first, key.positions) for key in keys)

    def thin(self, spacing: float) -> tuple[list[Key], list[float]]:
        """Return keys at least `spacing` apart [m], the first and the last among them, and the distances between them [m]."""
        kept, at = [self.keys[0]], self.keys[0].positions
        distances = list[float]()
        for key in self.keys[1:-1]:
            positions = key.positions
            distance = _largest_move(at, positions)
            if distance >= spacing:
                kept.append(key)
                distances.append(distance)
                at = positions
        if len(self.keys) > 1:
            last = self.keys[-1].positions
            if distances and _largest_move(at, last) < 0.5 * spacing:
                # The end replaces a key that lies close to it.
                kept.pop()
                distances.pop()
                at = kept[-1].positions
            kept.append(self.keys[-1])
            distances.append(_largest_move(at, last))
        return kept, distances

    def place_frames(self, *, steps: float, at_least: int, most_keys: int) -> tuple[list[Key], int]:
        """Choose the keys that are shown, and the number of frames.

        Args:
            steps: into so many frames the stage's largest displacement is parted, or more.
            at_least: frames.
            most_keys: at least 2.
        """
        reach = self.displacement(self.keys)
        if reach <= _STILL:
            return [self.keys[0], self.keys[-1]], at_least
        spacing = 2.0 * reach / steps
        while True:
            keys, distances = self.thin(spacing)
            shown = max(self.displacement(keys), _STILL)  # the layout farthest out may be left out
            wanted = 1 + sum(math.ceil(steps * distance / shown) for distance in distances)
            if len(keys) <= 2 or (len(keys) <= most_keys and wanted <= 4 * at_least):
                return keys, max(wanted, at_least)
            spacing *= 1.5


def frames_along(keys: Sequence[Key], number: int, *, between: bool) -> Iterator[Key | Between]:
    """Yield `number` frames along the path through these keys, each of which is one of the frames.

    The way from one key to the next is straight and even. The layouts of frames there are made if `between` asks for them.
    """
    distances = [_largest_move(a.positions, b.positions) for a, b in pairwise(keys)]
    yield keys[0]
    counts = spread(distances, number - 1)
    for (begin, end), count in zip(pairwise(keys), counts, strict=True):
        for step in range(1, count):
            share = step / count
            measures = {
                key: (1.0 - share) * value + share * end.measures[key]
                for key, value in begin.measures.items()
                if key in end.measures
            }
            layout = None
            if between:
                first = begin.positions
                layout = first + np.float32(share) * (end.positions - first)
            yield Between(positions=layout, measures=measures)
        yield end
    yield from [keys[-1]] * (number - 1 - sum(counts))


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


# The file of the mannequin, to which that of the frames refers.
MANNEQUIN = "mannequin.usdc"

# Frames of a film of 60: so many for a stage after the first one at least, and so many in which the line of a cut is shown.
_LATER, _LINE = 15 / 60, 6 / 60
# Into so many frames of a film of 60 the largest displacement of a stage is parted.
_PARTS = 20 / 60
# So many vertices of computed layouts a stage keeps at most: they fill some 200 MB. Frames between them take no room.
_MOST_VERTICES = 6_000_000
# Points of frames between computed layouts are stored, for readers that look at stored samples only, where a film of one stage has at most
# so many of them, some 10 MB, and the scene does not ask for a compact one. Otherwise USD interpolates them.
_MOST_STORED = 1_000_000
# A layout is kept if it lies at least this share of the stage's way from the one kept before.
_KEPT = 0.05
# Measures that are whole numbers.
_COUNTS = ("step", "flipped_faces")


class Film:
    """Records the layouts of several pieces while they relax, and writes `frames.usdc` at the end of its ``with`` block.

    All pieces have the same frames: a stage takes as many as the piece that needs the most, and a piece without that stage stands still.
    A film that cannot be made is left out; see :func:`warpflat.pattern.files.output.optional_file`.

    Attributes:
        files: after the block: the names of the files that it has written.
        recorders: of the pieces, by name.
        worn: how the pieces lie at the end, by name; set within the block, for the maps of pressure and of the gap to the body.
        drafted: pieces that are not filmed, such as collars, where they are worn; set within the block.
    """

    def __init__(
        self, folder: Path, output: OutputTable, surfaces: Sequence[Surface], *, mannequin: Mannequin | None = None
    ) -> None:
        """
        Args:
            folder: in which `frames.usdc` is written, if the output has frames at all.
            output: how many frames.
            surfaces: the pieces, uncut.
            mannequin: on which they lie; it is written as `mannequin.usdc`, to which the frames refer.
        """
        self.files: list[str] = []
        self.worn: Mapping[str, Flattening] = {}
        self.drafted: Sequence[Surface] = ()
        self._mannequin = mannequin
        self._open = ExitStack()
        self._keys: KeyFile | None = None
        self._folder, self._output = folder, output
        self._surfaces = {surface.name: surface for surface in surfaces}
        vertices = sum(len(surface.vertices) for surface in surfaces)
        self._most = max(_MOST_VERTICES // max(vertices, 1), 3)
        self._all_stored = not output.compact_film and vertices * max(output.frames, 1) <= _MOST_STORED
        schedule = partial(FrameSchedule, output, at_most=self._most)
        self.recorders = {name: FrameRecorder(surface, schedule) for name, surface in self._surfaces.items()}

    def __enter__(self) -> Film:
        """Open the file of layouts. The USD library, which takes a while to load, is not needed before the end.

        Raises:
            InputError: the place cannot be written.
        """
        if self._output.frames > 0:
            with optional_file(self._folder / "frames.usdc", []):
                self._keys = self._open.enter_context(KeyFile(self._folder))
                for recorder in self.recorders.values():
                    recorder.keys = self._keys
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Write the frames if the block ended well, and close the file of layouts."""
        with self._open:
            if kind is None and self._keys is not None and not self._keys.failed:
                self._write()

    def _write(self) -> None:
        with optional_file(self._folder / "frames.usdc", self.files) as path:
            from warpflat.pattern import SMALLEST_SCALE, FrameWriter, film_scale

            report_activity("writing the film")
            # The upper end of the colours: by the last frames, or by the first ones if the pieces end without strain.
            for at in (-1, 0):
                ends = [recorder.stages[at] for recorder in self.recorders.values()]
                densities = [stage.keys[at].face_energy_density for stage in ends]
                scale = film_scale(list(self._surfaces.values()), densities)
                if scale > SMALLEST_SCALE:
                    break
            with FrameWriter(path, scale=scale) as writer:
                if self._mannequin is not None:
                    from warpflat.garment import Body, write_mannequin_usd

                    write_mannequin_usd(self._mannequin, self._folder / MANNEQUIN)
                    self.files.append(MANNEQUIN)
                    layout = self._mannequin.layout
                    body = Body(self._mannequin.vertices, layout.faces[layout.on_body], device=wp.get_device("cpu"))
                    writer.refer_to_body(MANNEQUIN, body.shrunk)
                for name, surface in self._surfaces.items():
                    writer.add_piece(name, surface)
                if self.drafted:
                    writer.show_drafted(self.drafted)
                for name, piece in self.worn.items():
                    # Worn values are of the pattern's faces, which are those of the filmed surface in its order.
                    if len(piece.faces) != len(self._surfaces[name].faces):
                        continue
                    writer.write_map(name, "pressure", piece.fit.pressure, unit="Pa", state="worn")
                    if self._mannequin is not None:
                        gaps = corner_means(body.gaps(piece.surface.vertices), piece.surface.faces)
                        writer.write_map(name, "gap", gaps, unit="m", state="designed")
                pieces = {name: recorder.stages for name, recorder in self.recorders.items()}
                for number in range(max(len(stages) for stages in pieces.values())):
                    shots = {name: self._shot(stages, number) for name, stages in pieces.items()}
                    count = max(wanted for _, _, wanted in shots.values())
                    # Steps are shown as they are; whoever is at rest earlier waits.
                    frames: dict[str, Iterator[Key | Between]] = {
                        name: frames_along(keys, count, between=self._all_stored)
                        if self._output.frame_every is None
                        else chain(keys, repeat(keys[-1], count - len(keys)))
                        for name, (_, keys, _) in shots.items()
                    }
                    for frame in range(count):
                        for name, shot in shots.items():
                            stage = shot[0]
                            begins = frame == 0 and number < len(pieces[name])
                            shown = next(frames[name])
                            in_steps = 0 < shown.measures.get("step", 0) <= stage.last_first_step
                            measures = {
                                "stage": _STEPS if in_steps else stage.name,
                                "stage_number": number,
                                "interpolated": isinstance(shown, Between),
                                **{
                                    key: round(value) if key in _COUNTS else value
                                    for key, value in shown.measures.items()
                                },
                            }
                            if isinstance(shown, Between):
                                writer.write_between(name, shown.positions, measures)
                                continue
                            writer.write(
                                name,
                                positions=shown.positions,
                                face_energy_density=shown.face_energy_density,
                                **(stage.topology if begins else {}),  # type: ignore[arg-type]
                                measures=measures,
                            )

    def _shot(self, stages: Sequence[FilmStage], number: int) -> tuple[FilmStage, list[Key], int]:
        """Return a stage of a piece, the keys that are shown and the number of frames that it needs.

        A piece without that stage stands still at its end.
        """
        if number >= len(stages):
            return stages[-1], stages[-1].keys[-1:], 1
        stage = stages[number]
        if self._output.frame_every is not None:
            return stage, stage.keys, len(stage.keys)
        if stage.still:
            return stage, stage.keys, max(round(_LINE * self._output.frames), 1)
        share = 1.0 if number == 0 else _LATER
        keys, count = stage.place_frames(
            steps=_PARTS * self._output.frames,
            at_least=max(math.ceil(share * self._output.frames), 2),
            most_keys=self._most,
        )
        return stage, keys, count


#: Stage of the paper's steps with which a relaxation begins (`warpflat.flat.flattening.progress`, which loads the solver).
_STEPS = "steps"


class FrameRecorder:
    """Keeps the layouts of one piece; a callback of `flatten` and of `cut`.

    Attributes:
        stages: with the layouts.
        keys: where layouts are kept; None to keep none.
    """

    def __init__(self, surface: Surface, new_schedule: Callable[[], FrameSchedule]) -> None:
        """
        Args:
            surface: the piece, uncut.
            new_schedule: makes the schedule of a stage.
        """
        self.stages = list[FilmStage]()
        self.keys: KeyFile | None = None
        self._surface = surface
        self._new_schedule = new_schedule
        self._schedule = new_schedule()
        self._plans: list[CutPlan] = []
        self._faces = surface.faces
        self._ended = True
        self._first = self._last = np.empty((0, 2))
        self._end_density = np.empty(0)

    def __call__(self, progress: Progress) -> None:
        """Keep the layout if the schedule asks for it, and if the piece has moved."""
        with self._recording() as keeps:
            begins = self._ended or progress.surface.faces is not self._faces
            if keeps and progress.stage == _STEPS and not begins:
                self.stages[-1].last_first_step = progress.step
            if not keeps or (not begins and not self._schedule.is_due(progress.step, progress.max_steps)):
                return
            positions = progress.positions()
            if begins:
                name = "relax" if progress.stage == "develop" else progress.stage
                self._begin_stage(name, progress.surface, positions)
                self._schedule.is_due(progress.step, progress.max_steps)
            elif not self._schedule.is_even:
                # A layout is kept that lies far enough from the one kept last, by the way of the stage until now.
                moved, travelled = (np.abs(positions - before).max() for before in (self._last, self._first))
                if not moved > _KEPT * travelled:
                    return
            measures = {"step": progress.step, "model_energy_j": progress.model_energy_j}
            self._keep(positions, progress.face_energy_density(), measures)

    def record_result(self, result: Flattening) -> None:
        """Keep the layout of a finished result, with its measures, as the end of a stage."""
        with self._recording() as keeps:
            if not keeps:
                return
            if self._ended:
                # What led here was not seen: it is shown as the way from the end of the stage before.
                surface, before = result.network.surface, self._last
                self._begin_stage(result.stages[-1].name, surface, before if len(before) else result.positions)
                if len(before):
                    self._keep(before, self._end_density, {"step": 0})
            self._keep(
                result.positions,
                result.face_energy_density,
                {"step": self.stages[-1].last_first_step + result.stages[-1].steps, **result.layout_measures},
            )
            self._ended, self._end_density = True, result.face_energy_density

    def record_cut_line(self, result: Flattening, plan: CutPlan) -> None:
        """Keep the layout in which the line of the next cut is drawn on the piece."""
        self._plans.append(plan)
        with self._recording() as keeps:
            if not keeps:
                return
            self._begin_stage(f"cut:{plan.name}", result.network.surface, result.positions, still=True)
            measures = {"step": 0, "model_energy_j": result.stages[-1].model_energy_j}
            self._keep(result.positions, result.face_energy_density, measures)
            self._ended = True

    @contextmanager
    def _recording(self) -> Iterator[bool]:
        """Tell whether layouts are kept; after an error in the block the film is left out."""
        if self.keys is None or self.keys.failed:
            yield False
            return
        self.keys.failed = True  # until the block has ended well
        kept = list[str]()
        with optional_file(self.keys.film, kept):
            yield True
        self.keys.failed = not kept

    def _begin_stage(self, name: str, surface: Surface, positions: FloatArray, *, still: bool = False) -> None:
        self._schedule = self._new_schedule()
        topology: dict[str, Any] = {}
        if surface.faces is not self._faces:
            self._faces = surface.faces
            topology |= {"faces": surface.faces, "lines": surface.lines}
        if self._plans:
            topology["cuts"] = {
                plan.name: [
                    run for path in plan.paths for run in path_in_pattern(self._surface.faces, self._faces, path)
                ]
                for plan in self._plans
            }
        self.stages.append(FilmStage(name=name, topology=topology, still=still))
        self._first, self._ended = positions, False

    def _keep(self, positions: FloatArray, density: FloatArray, measures: Mapping[str, float]) -> None:
        assert self.keys is not None
        self.stages[-1].keys.append(self.keys.append(positions, density, measures))
        self._last = positions


def path_in_pattern(faces: IntArray, pattern_faces: IntArray, path: IntArray) -> list[IntArray]:
    """Return a path of the uncut surface in the pattern: both sides where it is cut, one line where it is not.

    Args:
        faces: #F by 4, uncut.
        pattern_faces: the same faces and corners in the pattern's numbering.
        path: vertices along edges of `faces`.
    """
    near = np.isin(faces, path).any(axis=1)
    old, new = half_edges(faces[near]), half_edges(pattern_faces[near])
    number = {edge: k for k, edge in enumerate(zip(old.tail.tolist(), old.head.tolist(), strict=True))}
    runs: list[list[int]] = []
    for forwards in (True, False):
        end = -1
        for a, b in pairwise(path.tolist()):
            k = number.get((a, b) if forwards else (b, a))
            if k is None:
                end = -1
                continue
            tail, head = int(new.tail[k]), int(new.head[k])
            first, second = (tail, head) if forwards else (head, tail)
            if first == end:
                runs[-1].append(second)
            else:
                runs.append([first, second])
            end = second
    return [np.array(run, dtype=np.int32) for run in dict.fromkeys(tuple(run) for run in runs)]


class FrameSchedule:
    """The schedule of a stage's frames: at a fixed interval of steps, or about a given number, closer together at first."""

    def __init__(self, output: OutputTable, *, at_most: int | None = None) -> None:
        self._every = output.frame_every
        self._number = output.frames if at_most is None else min(output.frames, at_most)
        self._next = 0

    @property
    def is_even(self) -> bool:
        """True if steps are shown as they are, at a fixed interval."""
        return self._every is not None

    def is_due(self, step: int, max_steps: int) -> bool:
        """Return whether this step, of at most `max_steps`, becomes a frame; the first one always does.

        Calls may be several steps apart: a frame is due if one was due at this step or before.
        """
        if step < self._next:
            return False
        if self._every is not None:
            self._next = step - step % self._every + self._every
        else:
            # Steps in a geometric row: as many frames between 10 and 20 as between 1,000 and 2,000.
            growth = max(max_steps, 2) ** (1.0 / self._number)
            self._next = max(step + 1, math.ceil(step * growth))
        return True
