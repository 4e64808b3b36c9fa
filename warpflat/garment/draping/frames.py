"""The way of the cloth from the designed surface to rest: frames in `frames.usdc`, and a small film for the review page."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core import FloatArray, IntArray, latest_file, weighted_percentile
from warpflat.flat import area_vectors, mean_normals, triangulate
from warpflat.garment.draping.body import SKIN
from warpflat.garment.draping.result import Drape
from warpflat.pattern import (
    Lighting,
    begin_stage,
    corner_mean,
    define_group,
    define_mesh,
    energy_colours,
    export_stage,
    last_values_as_defaults,
    linear_rgb,
    part_path,
    rasterise,
    set_face_map,
    set_points,
    shade,
    usd_errors,
    write_moving_picture,
)

__all__ = ["choose_frames", "write_drape_film", "write_drape_frames"]

_COUNT = 30
_RATE, _HEIGHT, _PAPER, _MARGIN = 12, 420, 249, 8
# Room between the worn garment and the surfaces beside it [m].
_BESIDE = 0.3


# Way from one frame to the next below which nothing is seen to move [m].
_SEEN = 1e-4


def choose_frames(frames: Sequence[NDArray[np.float32]], count: int = _COUNT) -> list[int]:
    """Return the numbers of frames between which the cloth moves about equally far, without those in which it does not move.

    The first and the last are among them.
    """
    moving = [0]
    for number, frame in enumerate(frames):
        if np.abs(frame - frames[moving[-1]]).max() > _SEEN:
            moving.append(number)
    moving = sorted({*moving[: max(len(moving) - 1, 1)], len(frames) - 1})
    if len(moving) <= count:
        return moving
    moves = [0.0, *(float(np.linalg.norm(frames[b] - frames[a], axis=1).mean()) for a, b in pairwise(moving))]
    # Half by displacement and half by time, for what creeps is worth a look too.
    progress = np.cumsum(moves) / max(sum(moves), 1e-12) + np.linspace(0.0, 1.0, len(moving))
    return sorted({moving[int(np.abs(progress - share).argmin())] for share in np.linspace(0.0, 2.0, count)})


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
        body = define_mesh(stage, "/World/drape/body", drape.body.triangles)
        set_points(body, drape.body.vertices)
        body.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set([Gf.Vec3f(*linear_rgb(SKIN).tolist())])
        cloth = define_mesh(stage, "/World/drape/cloth", drape.cloth.faces)
        colours = cloth.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
        widest = _widest(drape)
        colours.GetAttr().SetCustomData({"quantity": "gap", "unit": "m", "rangeMin": 0.0, "rangeMax": widest})
        for time, number in enumerate(chosen, start=begin):
            points = drape.frames[number].astype(np.float64)
            set_points(cloth, points, Usd.TimeCode(time))
            found = linear_rgb(energy_colours(drape.body.gaps(points), widest)).astype(np.float32)
            colours.GetAttr().Set(Vt.Vec3fArray.FromNumpy(found), Usd.TimeCode(time))
        last_values_as_defaults(stage, [cloth.GetPrim()])
        # On the patterns the gap is now that of the worn cloth.
        world = layer.GetPrimAtPath("/World").nameChildren
        shown = {prim.GetInfo("displayName") or prim.name: part_path(str(prim.path), "pattern") for prim in world}
        for name in drape.cloth.piece_vertices:
            faces = drape.cloth.flat_faces[drape.cloth.piece_faces[name]]
            if name in shown and layer.GetPrimAtPath(shown[name]):
                gaps = corner_mean(drape.gap[drape.cloth.welded], faces)
                set_face_map(layer, shown[name], "gap", gaps, unit="m", state="draped")
    export_stage(stage, path)


def _widest(drape: Drape) -> float:
    """Return the upper end of the scale of gaps [m]."""
    return max(0.005, weighted_percentile(drape.gap, drape.areas, 0.98))


def write_drape_film(path: Path, drape: Drape) -> None:
    """Draw the frames from the front, the left and the back as a moving picture, coloured by the gap to the body.

    Raises:
        InputError: the file cannot be written.
    """
    from PIL import Image

    body, widest = drape.body, _widest(drape)
    inner = body.shrunk
    cloth, _ = triangulate(drape.cloth.faces)
    everything = np.concatenate(drape.frames)
    low, high = everything.min(axis=0) - 0.1, everything.max(axis=0) + 0.1
    near = ((inner > low) & (inner < high)).all(axis=1)
    skin = body.triangles[near[body.triangles].all(axis=1)]
    pictures = []
    for number in choose_frames(drape.frames):
        points = drape.frames[number].astype(np.float64)
        gap = drape.body.gaps(points)[cloth].mean(axis=1)
        colours = np.concatenate([energy_colours(gap, widest), np.tile(SKIN, (len(skin), 1))])
        joined = np.concatenate([points, inner]), np.concatenate([cloth, skin + len(points)]).astype(np.int32)
        views = [_view(*joined, colours, (low, high), degrees) for degrees in (0.0, 90.0, 180.0)]
        pictures.append(Image.fromarray(np.concatenate(views, axis=1)))
    durations = [1000 // _RATE] * (len(pictures) - 1) + [2000]
    write_moving_picture(path, pictures, durations)


def _view(
    points: FloatArray, triangles: IntArray, colours: FloatArray, box: tuple[FloatArray, FloatArray], degrees: float
) -> Any:
    """Return a picture of a mesh as seen by somebody who walked `degrees` around it to its left, RGB."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    corners = np.array(
        [[x, y, z] for x in (box[0][0], box[1][0]) for y in (box[0][1], box[1][1]) for z in (box[0][2], box[1][2])]
    )
    turned, frame = points @ turn.T, corners @ turn.T
    low, size = frame.min(axis=0), np.ptp(frame, axis=0)
    scale = (_HEIGHT - 2 * _MARGIN) / float(size[1])
    wide = int(2 * np.ceil((float(size[0]) * scale + 2 * _MARGIN) / 2))
    grid = np.column_stack([
        2.0 * ((turned[:, 0] - low[0]) * scale + _MARGIN),
        2.0 * (_HEIGHT - (turned[:, 1] - low[1]) * scale - _MARGIN),
        turned[:, 2],
    ])  # fmt: skip
    samples = rasterise(grid, triangles, (2 * _HEIGHT, 2 * wide))
    vectors = area_vectors(turned, triangles)
    lighting = Lighting(
        normals=mean_normals(vectors, triangles, len(points)), direction=(-0.3, 0.5, 1.0), back=(0.6, 0.6, 0.6)
    )
    pixels = shade(
        samples, 2, grid, triangles, colours, face=np.arange(len(triangles), dtype=np.int32), lighting=lighting
    )
    cover = pixels[..., 3:] / 255.0
    return np.round(_PAPER * (1.0 - cover) + pixels[..., :3] * cover).astype(np.uint8)
