"""Scene files are read and checked here."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpflat.core import InputError, check_file_name, check_table, make_file_name, nearest, read_toml
from warpflat.flat import Fabric, FabricTable, RelaxOptions, fabric_from_table, find_fabric, load_library

if TYPE_CHECKING:
    from warpflat.flat import Wear
from warpflat.app.scene.schema import SceneTable

__all__ = [
    "Scene",
    "errors_named",
    "expand_variables",
    "fabric_of_correction",
    "load_scene",
    "make_scene",
    "scene_fabric",
    "scene_library",
    "scene_relax_options",
    "scene_wear",
]

_VARIABLE = re.compile(r"\$\{([A-Za-z_][A-Za-z0-9_]*)\}|\$([A-Za-z_][A-Za-z0-9_]*)")


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A checked scene, ready to be run.

    Attributes:
        name: of its piece and of its files.
        settings: what the file says.
        folder: from where relative paths are taken.
        where: what messages begin with: the file.
        sources: the files from which it was read.
    """

    name: str
    settings: SceneTable
    folder: Path
    where: str
    sources: tuple[Path, ...] = ()

    def path(self, file: str) -> Path:
        """Return where a file lies that the scene names; it may name environment variables.

        Raises:
            InputError: one of them is not set.
        """
        return self.folder / expand_variables(file)

    def allowing(self, shear_limit: float | None) -> Scene:
        """Return the scene with a limit of shear in place of its own [degrees]; itself for None."""
        if shear_limit is None:
            return self
        return replace(self, settings=self.settings.model_copy(update={"shear_limit": shear_limit}))


def load_scene(path: str | Path) -> Scene:
    """Load the scene of a TOML file.

    Raises:
        InputError: unreadable, not TOML, an unknown key (names the nearest), a value of the wrong kind
            or out of bounds; one line with file and key.
    """
    path = Path(path)
    data = read_toml(path)
    if not data:
        raise InputError(
            f'{path}: is empty; a scene needs at least a [surface] table with file = ... or shape = "dome"'
        )
    if not {"scenes", "forms", "tasks"}.isdisjoint(data):
        raise InputError(f"{path}: is a batch of scenes: warpflat batch {shlex.quote(str(path))} runs it")
    scene = make_scene(data, name=path.stem, folder=path.parent, where=str(path))
    return replace(scene, sources=(path.absolute(),))


def make_scene(data: Mapping[str, Any], *, name: str, folder: Path, where: str) -> Scene:
    """Make a scene from data laid out like a scene file.

    Args:
        data: nested tables.
        name: of the scene, unless the data have one; with "_" where no file can bear it.
        folder: from where relative paths are taken.
        where: what messages begin with.

    Raises:
        InputError: as `load_scene`; it names no fabric, and its fabric files have several.
    """
    settings = check_table(SceneTable, data, where)
    scene = Scene(name=settings.name or make_file_name(name), settings=settings, folder=folder, where=where)
    if settings.fabric_files and "fabric" not in settings.model_fields_set:
        # The only fabric of the user's files is meant.
        library, shipped = scene_library(scene), load_library()
        own = [name for name, fabric in library.items() if fabric is not shipped.get(name)]
        if len(own) > 1:
            raise InputError(f"{where}: fabric is not given, and the fabric files have several; {nearest('', own)}")
        scene = replace(scene, settings=settings.model_copy(update={"fabric": own[0]}))
    if settings.name is not None:
        with errors_named(f"{where}: name"):
            check_file_name(settings.name)
    return scene


def scene_library(scene: Scene) -> dict[str, Fabric]:
    """Return the fabrics that a scene can name: those that come with the library, and those of its files.

    Raises:
        InputError: a file cannot be read, or has a wrong value.
    """
    with errors_named(f"{scene.where}: fabric_files"):
        return load_library([scene.path(file) for file in scene.settings.fabric_files])


def scene_fabric(scene: Scene) -> Fabric:
    """Return the scene's fabric, with the limit of shear that the scene allows.

    Raises:
        InputError: an unknown name (names the nearest), or impossible values.
    """
    settings, library = scene.settings, scene_library(scene)
    if isinstance(settings.fabric, FabricTable):
        fabric = fabric_from_table(scene.name, settings.fabric, where=scene.where, library=library)
    else:
        with errors_named(f"{scene.where}: fabric"):
            fabric = find_fabric(settings.fabric, library)
    return _as_allowed(scene, fabric)


def _as_allowed(scene: Scene, fabric: Fabric) -> Fabric:
    with errors_named(f"{scene.where}: shear_limit"):
        return fabric.allowing(scene.settings.shear_limit)


def fabric_of_correction(scene: Scene) -> Fabric | None:
    """Return the other cloth of the scene's corrected pattern, with the limit of shear that the scene allows; None if it names none.

    Raises:
        InputError: an unknown name (names the nearest), or a limit of shear for an isotropic sheet.
    """
    table = scene.settings.drape
    if table is None or table.correct_fabric is None:
        return None
    with errors_named(f"{scene.where}: drape.correct_fabric"):
        fabric = find_fabric(table.correct_fabric, scene_library(scene))
    return _as_allowed(scene, fabric)


def scene_wear(scene: Scene) -> Wear | None:
    """Return how the scene's garment is to be worn, if the scene says so.

    Raises:
        InputError: a value out of its bounds.
    """
    from warpflat.flat import Wear

    if scene.settings.wear is None:
        return None
    with errors_named(scene.where):
        return Wear(**scene.settings.wear.model_dump())


def scene_relax_options(scene: Scene) -> RelaxOptions:
    """Return the scene's options of the relaxation, with defaults for those that it does not set.

    Raises:
        InputError: a value out of its bounds.
    """
    given = {key: value for key, value in scene.settings.relax.model_dump().items() if value is not None}
    options = RelaxOptions(**given)
    with errors_named(scene.where):
        options.validate()
    return options


def expand_variables(text: str) -> str:
    """Replace ${NAME} and $NAME in a text from the environment.

    Raises:
        InputError: a variable that is not set.
    """

    def value(match: re.Match[str]) -> str:
        name = match.group(1) or match.group(2)
        if not os.environ.get(name):
            rest = text[match.end() :].lstrip("/") or "the file"
            raise InputError(f"environment variable {name} is not set; set it to the folder that holds {rest}")
        return os.environ[name]

    return _VARIABLE.sub(value, text)


@contextmanager
def errors_named(where: str) -> Iterator[None]:
    """Begin the messages of InputErrors in the block with `where`, unless they do so already."""
    try:
        yield
    except InputError as error:
        message = str(error)
        raise type(error)(message if message.startswith(f"{where}: ") else f"{where}: {message}") from None
