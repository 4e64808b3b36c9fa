"""The mannequin and the form of a scene. No solver is loaded for them: a run builds them while it loads one."""

from __future__ import annotations

from dataclasses import replace

from warpflat.app.scene.cuts import cut_form
from warpflat.app.scene.load import Scene, errors_named, scene_fabric
from warpflat.garment import (
    Form,
    FormResult,
    Mannequin,
    ease_from,
    form_from_mapping,
    mannequin_from_table,
    part_at_centres,
    shaped_form,
    shipped_form,
    wide_enough,
)

__all__ = ["scene_form", "scene_mannequin", "scene_recipe"]


def scene_form(
    scene: Scene,
    mannequin: Mannequin | None = None,
    *,
    before: FormResult | None = None,
    strain_limit: float | None = None,
) -> tuple[Mannequin, FormResult]:
    """Build the pieces of the scene's form on its mannequin, or on another one; return both.

    Args:
        scene: with a form.
        mannequin: another one than the scene's.
        before: a form on this mannequin that may have much in common, to save time.
        strain_limit: of another cloth than the scene's, for which a form that is pulled on grows.

    Raises:
        InputError: the body, the form or a brick is wrong.
    """
    mannequin, form = scene_recipe(scene, mannequin)
    with errors_named(f"{scene.where}: {'cuts' if scene.settings.cuts else 'form'}"):
        built = mannequin.form(form, half=scene.settings.half, before=before)
    if scene.settings.pulled_on:
        with errors_named(f"{scene.where}: pulled_on"):
            built = wide_enough(
                mannequin,
                built,
                strain_limit=scene_fabric(scene).strain_limit if strain_limit is None else strain_limit,
                openings=scene.settings.openings,
                finishing=scene.settings.finishing,
            )
    return mannequin, built


def scene_mannequin(scene: Scene, *, size: str | None = None) -> Mannequin:
    """Build the scene's mannequin, or the same in another size.

    Raises:
        InputError: there is no such body.
    """
    table = scene.settings.mannequin
    assert table is not None  # the schema sees to it
    table = table if size is None else table.model_copy(update={"size": size})
    with errors_named(f"{scene.where}: {'mannequin' if size is None else 'pattern.sizes'}"):
        return mannequin_from_table(table, path_of=scene.path)


def scene_recipe(scene: Scene, mannequin: Mannequin | None = None) -> tuple[Mannequin, Form]:
    """Return the scene's mannequin, or the one that is given, and its form with its cuts, not yet built on it.

    Raises:
        InputError: the body, the form or a brick is wrong.
    """
    settings, mannequin = scene.settings, mannequin or scene_mannequin(scene)
    with errors_named(f"{scene.where}: form"):
        if isinstance(settings.form, str):
            form = shipped_form(settings.form)
        else:
            form = form_from_mapping(scene.name, settings.form or {})
    if settings.ease is not None:
        form = replace(form, ease=ease_from(settings.ease, scene.where, base=form.ease))
    with errors_named(f"{scene.where}: form"):
        if not settings.half:
            form = part_at_centres(mannequin.layout, form, settings.openings)
        shape = "darts" if settings.shape == "auto" else settings.shape
        woven = not scene_fabric(scene).is_knit
        form = shaped_form(mannequin.layout, form, shape, mannequin.vertices, woven=woven)
    # Its bricks are known to be right: with cuts, what is wrong now is most likely one of them.
    with errors_named(f"{scene.where}: {'cuts' if settings.cuts else 'form'}"):
        return mannequin, cut_form(mannequin, form, settings.cuts)
