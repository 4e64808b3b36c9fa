"""The way of the cloth from the designed surface to rest, as frames in `frames.usdc`."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warpflat.flat import corner_means
from warpflat.garment.draping.result import Drape
from warpflat.pattern import (
    ENERGY,
    LEAST_GAP,
    SKIN,
    Scale,
    begin_stage,
    define_group,
    define_mesh,
    export_stage,
    last_values_as_defaults,
    latest_file,
    linear_rgb,
    part_path,
    set_face_map,
    set_points,
    usd_errors,
)

__all__ = ["choose_frames", "gap_scale", "write_drape_frames"]

_COUNT = 30
# Room between the worn garment and the surfaces beside it [m].
_BESIDE = 0.3
# Way from one frame to the next below which nothing is seen to move [m].
_SEEN = 1e-4


def choose_frames(frames: Sequence[NDArray[np.float32]]) -> list[int]:
    """Return the numbers of frames between which the cloth moves about equally far, without those in which it does not move.

    The first and the last are among them.
    """
    moving = [0]
    for number, frame in enumerate(frames):
        if np.abs(frame - frames[moving[-1]]).max() > _SEEN:
            moving.append(number)
    moving = sorted({*moving[: max(len(moving) - 1, 1)], len(frames) - 1})
    if len(moving) <= _COUNT:
        return moving
    moves = [0.0, *(float(np.linalg.norm(frames[b] - frames[a], axis=1).mean()) for a, b in pairwise(moving))]
    # Half by displacement and half by time, for what creeps is worth a look too.
    progress = np.cumsum(moves) / max(sum(moves), 1e-12) + np.linspace(0.0, 1.0, len(moving))
    return sorted({moving[int(np.abs(progress - share).argmin())] for share in np.linspace(0.0, 2.0, _COUNT)})


def gap_scale(drape: Drape) -> Scale:
    """Return the colours of the gap to the body over all frames [m]."""
    return Scale.from_zero(drape.gap, drape.areas, 1e-3 * LEAST_GAP, ENERGY)


def write_drape_frames(path: Path, drape: Drape) -> None:
    """Add `/World/drape` with `body` and `cloth` to a file of frames, after those that it has; or write a new file.

    The cloth's points [m] and colours, by its gap to the body, are sampled over time; before it is draped it lies as designed.
    `warpflat:stage` is "drape" from there on. All of it lies to the left of the surfaces.

    Raises:
        InputError: the file cannot be written.
    """
    from pxr import Gf, Kind, Sdf, Usd, UsdGeom, Vt

    with usd_errors(path):
        layer = Sdf.Layer.CreateAnonymous(".usda")
        written, begin = latest_file(path), 1
        if written.is_file():
            layer.TransferContent(Sdf.Layer.FindOrOpen(str(written)))
            begin = int(layer.endTimeCode) + 1
            if layer.GetPrimAtPath("/World/drape"):
                # An earlier drape, which this one takes the place of.
                begin = int(min(layer.ListTimeSamplesForPath("/World/drape.warpflat:stage")))
                del layer.GetPrimAtPath("/World").nameChildren["drape"]
            if begin == 1:
                layer.Clear()
        # The rest may refer to files that lie beside the finished file, not yet beside this one.
        stage = Usd.Stage.OpenMasked(layer, Usd.StagePopulationMask(["/World/drape"]))
        if begin == 1:
            begin_stage(stage, is_film=True)
        group = define_group(stage, "/World/drape", kind=Kind.Tokens.component)
        chosen = choose_frames(drape.frames)
        stage.SetEndTimeCode(begin + len(chosen) - 1)
        if begin > 1:
            width = float(np.ptp(drape.body.vertices[:, 0]))
            UsdGeom.Xformable(group).AddTranslateOp().Set(Gf.Vec3d(-width - _BESIDE, 0.0, 0.0))
        tag = group.CreateAttribute("warpflat:stage", Sdf.ValueTypeNames.String, custom=True)
        tag.Set("drape", begin)
        define_mesh(stage, "/World/drape/body", drape.body.triangles, drape.body.vertices, linear_rgb(SKIN).tolist())
        cloth = define_mesh(stage, "/World/drape/cloth", drape.cloth.faces)
        colours = cloth.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
        scale = gap_scale(drape)
        colours.GetAttr().SetCustomData({"quantity": "gap", "unit": "m", "rangeMin": 0.0, "rangeMax": scale.high})
        for time, number in enumerate(chosen, start=begin):
            points = drape.frames[number].astype(np.float64)
            set_points(cloth, points, Usd.TimeCode(time))
            found = linear_rgb(scale.rgb(drape.body.gaps(points))).astype(np.float32)
            colours.GetAttr().Set(Vt.Vec3fArray.FromNumpy(found), Usd.TimeCode(time))
        last_values_as_defaults(stage, [cloth.GetPrim()])
        # On the patterns the gap is now that of the worn cloth.
        world = layer.GetPrimAtPath("/World").nameChildren
        shown = {prim.GetInfo("displayName") or prim.name: part_path(str(prim.path), "pattern") for prim in world}
        for name in drape.cloth.piece_vertices:
            faces = drape.cloth.flat_faces[drape.cloth.piece_faces[name]]
            if name in shown and layer.GetPrimAtPath(shown[name]):
                gaps = corner_means(drape.gap[drape.cloth.welded], faces)
                set_face_map(layer, shown[name], "gap", gaps, unit="m", state="draped")
    export_stage(stage, path)
