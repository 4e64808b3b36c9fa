"""A scene is written as TOML and run from scratch."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from warpflat.app.review.faults import is_done
from warpflat.app.scene.as_toml import document_as_toml
from warpflat.app.scene.load import Scene, load_scene
from warpflat.app.scene.plain_names import plain_name, with_plain_letters
from warpflat.app.scene.run import run_scene
from warpflat.core import InputError, check_file_name, make_file_name
from warpflat.flat import Progress
from warpflat.pattern import atomic_path

__all__ = ["Saved", "free_name", "run_saved", "scene_file", "write_scene"]


@dataclass(frozen=True, kw_only=True)
class Saved:
    """What was saved.

    Attributes:
        path: of the scene.
        folder: of its run.
        files: of the run.
        metrics: of the run, as `metrics.json`.
    """

    path: Path
    folder: Path
    files: tuple[str, ...]
    metrics: Mapping[str, Any]

    @property
    def strain_energy(self) -> float:
        """The strain energy of all pieces [J]."""
        return sum(float(piece["strain_energy_j"]) for piece in self.metrics["pieces"].values())

    @property
    def is_done(self) -> bool:
        """Whether the run is without faults."""
        return is_done(self.metrics)


def scene_file(scene: Scene, name: str) -> Path:
    """Return the file in the scene's folder that a name means.

    Raises:
        InputError: no file can bear it.
    """
    try:
        return scene.folder / f"{check_file_name(plain_name(name.strip().removesuffix('.toml')))}.toml"
    except ValueError as error:
        raise InputError(f"name: {error}") from None


def free_name(scene: Scene) -> str:
    """Return a name that a scene can have, and under which there is no file yet in the scene's folder."""
    stem = make_file_name(with_plain_letters(scene.sources[0].stem if scene.sources else scene.name, " _.-"))
    name, number = stem, 2
    while scene_file(scene, name).exists():
        name, number = f"{stem}_{number}", number + 1
    return name


def write_scene(scene: Scene, name: str, *, replace: bool = False) -> Path:
    """Write a scene into its folder, so that its relative paths stay right; return the file.

    Args:
        scene: as it is now.
        name: of the file.
        replace: whether a file of that name may be replaced, its comments included.

    Raises:
        InputError: there is such a file and it may not be replaced, or the folder cannot be written.
    """
    path = scene_file(scene, name)
    if path.exists() and not replace:
        raise InputError(f"{path}: there is such a file; choose to replace it, or give another name")
    text = document_as_toml(scene.settings.given())
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def run_saved(path: Path, out: Path, *, on_progress: Callable[[Progress], bool | None] | None = None) -> Saved:
    """Run a scene that was written, from its file, into a folder of that name.

    Raises:
        InputError: as :func:`warpflat.run_scene`.
    """
    folder = out / path.stem
    result = run_scene(load_scene(path), folder, on_progress=on_progress)
    return Saved(path=path, folder=folder, files=result.files, metrics=result.metrics)
