"""Darts of a form are rotated, split, or turned into seams, ease, pleats and gathers: edits of a scene's tables.

An edit returns another scene. Both are run, and their energies lie side by side.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from warpflat.app.scene.as_toml import tables_as_toml
from warpflat.app.scene.cuts import asked_cuts, cut_of_dart, cuts_beside, omitted, place_of, scene_with
from warpflat.app.scene.form import scene_form, scene_recipe
from warpflat.app.scene.form_shaping import settle_shape, sewn_form
from warpflat.app.scene.load import Scene
from warpflat.core import InputError, nearest, polyline_length, without_side
from warpflat.garment import FormDart, FormGarment, plan_form

__all__ = ["KINDS", "DartEdit", "edit_dart", "rotate_dart", "split_dart", "turn_dart"]

#: What a dart can be turned into.
KINDS = ("seam", "ease", "pleat", "gathers", "nothing")
#: How far from its mouth a pleat is sewn unless it is told otherwise [mm].
PLEAT_MM = 40.0


@dataclass(frozen=True, kw_only=True, eq=False)
class DartEdit:
    """A garment before and after an edit of its cuts.

    Attributes:
        before, after: flattened and sewn.
        scene: that gives the second one.
        notes: on cuts that were made by themselves and on darts that cannot be sewn, one sentence each.
    """

    before: FormGarment
    after: FormGarment
    scene: Scene
    notes: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return plain data in SI units: energies, share of cloth beyond its limit, and mouths of darts."""
        return {
            "before": _measures(self.before),
            "after": _measures(self.after),
            "toml": self.as_toml(),
            "notes": list(self.notes),
        }

    def as_toml(self) -> str:
        """Return the tables `[[cuts]]` and `[[seams]]` of the scene."""
        settings = self.scene.settings
        return tables_as_toml({
            key: [table.given() for table in getattr(settings, key)]
            for key in ("cuts", "seams")
        })  # fmt: skip


def _measures(garment: FormGarment) -> dict[str, Any]:
    metrics = garment.metrics()
    pieces = metrics["pieces"]
    return {
        "strain_energy_j": sum(piece["strain_energy_j"] for piece in pieces.values()),
        "model_energy_j": sum(piece["model_energy_j"] for piece in pieces.values()),
        "outside": metrics["wear"]["outside"],
        "fits": metrics["verdict"]["fits"],
        "converged": all(piece["stages"][-1]["converged"] for piece in pieces.values()),
        "mouths_m": {
            f"{name}.{dart['name']}": dart["intake_m"]
            for name, piece in pieces.items()
            for dart in piece.get("darts", ())
        },
    }


def edit_dart(
    scene: Scene, dart: str, *, how: str, aim: str, at: str | None = None, device: str | None = None
) -> DartEdit:
    """Edit a dart of a scene's form, and flatten the garment before and after that.

    Args:
        scene: with a form.
        dart: "piece.name".
        how: "rotate", "split" or "turn".
        aim: the line along which the dart, or a second one, lies afterwards, or one of `KINDS`.
        at: where the mouth of the rotated or second dart lies, where its line has two ends on the border.
        device: Warp device.

    Raises:
        InputError: the scene has no such dart, or the edit cannot be made.
    """
    scene, shaped = settle_shape(scene, device=device)
    scene, before, closed = sewn_form(scene, device=device)
    if how == "turn":
        edited = turn_dart(scene, dart, aim, before)
    else:
        edited = (rotate_dart if how == "rotate" else split_dart)(scene, dart, aim, at=at)
    edited, after, closed_after = sewn_form(edited, device=device)
    notes = tuple(dict.fromkeys((*shaped, *closed, *closed_after)))
    return DartEdit(before=before, after=after, scene=edited, notes=notes)


def rotate_dart(scene: Scene, dart: str, line: str, *, at: str | None = None) -> Scene:
    """Return a scene in which a dart lies along another line of its piece.

    Raises:
        InputError: there is no such dart.
    """
    old = _find(scene, dart)
    words = without_side(line)
    cut = {
        "name": f"{words} dart",
        "piece": old.piece,
        "line": line,
        **({} if at is None else {"at": at}),
        **_sides(old),
    }
    return scene_with(scene, cuts=[*_cuts_without(scene, old), cut])


def split_dart(scene: Scene, dart: str, line: str, *, at: str | None = None) -> Scene:
    """Return a scene with a second dart along another line or, where that bounds the piece, between the dart and it.

    A width that the dart was given is shared.

    Raises:
        InputError: there is no such dart.
    """
    old = _find(scene, dart)
    half = None if old.mouth_mm is None else 0.5 * old.mouth_mm
    first = cut_of_dart(replace(old, mouth_mm=half))
    second: dict[str, Any] = {"name": f"second {old.name}", "piece": old.piece, **_sides(old)}
    if at is None:
        own = scene_form(scene)[1].pieces.get(old.piece)
        # Whether the line is an edge of the piece, or a part of one.
        bounds = own is not None and line in {own.whole(edge) for edge in own.edges}
        second |= {"line": old.line, "towards": line} if bounds else {"line": line}
    else:
        second |= {"line": line, "at": at}
    if half is not None:
        second["mouth_mm"] = half
    return scene_with(scene, cuts=[*_cuts_without(scene, old, keep=True), first, second])


def turn_dart(scene: Scene, dart: str, into: str, garment: FormGarment) -> Scene:
    """Return a scene in which something else takes in what a dart took.

    A seam runs along the whole line of the dart, and takes over other darts that point to it. A pleat has the dart's place
    and mouth; it is sewn for 40 mm, and open below. Ease and gathers make the edge at
    the dart's mouth longer by what the dart took in than the one that it is sewn to.

    Args:
        scene: with a form.
        dart: "piece.name".
        into: one of `KINDS`.
        garment: of the scene, flattened.

    Raises:
        InputError: there is no such dart, it cannot become that, or its mouth lies in no seam.
    """
    if into not in KINDS:
        raise InputError(f"dart {dart!r} cannot be turned into {into!r}; {nearest(into, KINDS)}")
    old = _find(scene, dart)
    cuts = _cuts_without(scene, old)
    if into == "nothing":
        return scene_with(scene, cuts=cuts)
    if into == "seam":
        # The book's dart there goes with the piece.
        kept = [cut for cut in cuts if not (cut.get("omit") and place_of(cut) == old.place)]
        seam = {"name": f"{old.name} seam", "piece": old.piece, "line": old.line, "part": [0.0, 1.0], **_sides(old)}
        return scene_with(scene, cuts=[*cuts_beside(*scene_recipe(scene), kept, seam), seam])
    form = garment.form
    fisheyes = {f"{name}.{own}" for name, piece in form.pieces.items() for own in piece.fisheyes}
    if any(f"{old.piece}.{old.name}{side}" in fisheyes for side in ("", " left", " right")):
        raise InputError(
            f"dart {dart!r} has no mouth on the border, so it cannot become {into}; turn it into seam or nothing"
        )
    if into == "pleat":
        pleat = cut_of_dart(replace(old, pleat_mm=PLEAT_MM))
        return scene_with(scene, cuts=[*_cuts_without(scene, old, keep=True), pleat])
    # The edges at the mouths of the dart and of its mirror image, and how wide these are.
    sewn, taken = plan_form(form).seams, dict[tuple[str, str], float]()
    for placed, _ in form.sewn_darts():
        if placed.asked.place == old.place:
            piece, positions = form.pieces[placed.piece], garment.pieces[placed.piece].positions
            left, right = (piece.edges[leg] for leg in piece.darts[placed.name])
            edge = next(own for own, ids in piece.edges.items() if ids[-1] == left[0])
            edge, width = piece.whole(edge), polyline_length(positions[[left[0], right[-1]]])
            taken[placed.piece, edge] = taken.get((placed.piece, edge), 0.0) + width
    # By seam the piece of the edge, and the share of the edge that they take in.
    shares: dict[str, tuple[str, float]] = {}
    for (longer, edge), width in taken.items():
        piece = form.pieces[longer]
        parts = [part for part in piece.edges if piece.whole(part) == edge]
        length = sum(polyline_length(garment.pieces[longer].positions[piece.edges[part]]) for part in parts)
        sides = ((s.name, side) for s in sewn for side in s.stretches)
        name = next((own for own, side in sides if side.piece == longer and side.edge in parts), None)
        if name is None:
            raise InputError(f"dart {longer}.{old.name}: its mouth lies on {edge!r}, which is sewn to nothing")
        shares[name] = longer, width / length
    seams = [table.given() for table in scene.settings.seams]
    for name, (longer, share) in shares.items():
        how = {"fullness": round(share, 4)} if into == "ease" else {"gather": round(1.0 + share, 4)}
        if into == "ease" and share > 0.3:
            raise InputError(
                f"dart {dart!r} takes in {100 * share:.0f} % of its edge, which no cloth eases in (30 % at most); turn it into gathers"
            )
        if any(seam["name"] == name for seam in seams):
            raise InputError(f"dart {dart!r}: seam {name!r} has fullness or gathers in the scene already")
        seams.append({"name": name, **how, "longer": longer})
    return scene_with(scene, cuts=cuts, seams=seams)


def _sides(dart: FormDart) -> dict[str, Any]:
    """Return the key that keeps what comes of a dart of one side on that side."""
    return {} if dart.mirrored else {"mirrored": False}


def _find(scene: Scene, dart: str) -> FormDart:
    """Return the dart of a scene's form that is meant by "piece.name"."""
    known = {f"{own.piece}.{own.name}": own for own in scene_recipe(scene)[1].darts}
    wanted = dart.removesuffix(" left").removesuffix(" right")
    if dart not in known and wanted not in known:
        raise InputError(f"{scene.where}: there is no dart {dart!r}; {nearest(dart, known)}")
    return known.get(dart) or known[wanted]


def _cuts_without(scene: Scene, dart: FormDart, *, keep: bool = False) -> list[dict[str, Any]]:
    """Return a scene's `[[cuts]]` without those at the place of a dart; one of the form's own is left out, unless to be kept."""
    cuts = [cut for cut in asked_cuts(scene) if place_of(cut) != dart.place]
    shaped = {other.place for other in scene_recipe(scene_with(scene, cuts=[]))[1].darts}
    if dart.place in shaped and not keep:
        cuts.append(omitted(dart, name=dart.name))
    return cuts
