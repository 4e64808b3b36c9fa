"""What a page may say: it moves its camera, clicks into the scene, drags a handle, and changes a part of the panel."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta, Struct
from viser import (
    GuiButtonGroupHandle,
    GuiButtonHandle,
    GuiDropdownHandle,
    GuiMultiSliderHandle,
    GuiNumberHandle,
    GuiSliderHandle,
    GuiTextHandle,
)

from warpflat.core import InputError, quote_value

__all__ = ["read_message"]

# No number that a page says is larger, and none is nan.
_MOST = 1e6
_Number = Annotated[float, Meta(ge=-_MOST, le=_MOST)]
_Vector = tuple[_Number, _Number, _Number]
_Pixels = Annotated[int, Meta(ge=1, le=100_000)]
_Word = Annotated[str, Meta(max_length=100)]


class _Camera(Struct, tag="ViewerCameraMessage", tag_field="type", forbid_unknown_fields=True):
    wxyz: tuple[_Number, _Number, _Number, _Number]
    position: _Vector
    fov: Annotated[float, Meta(gt=0.0, lt=3.15)]
    near: _Number
    far: _Number
    image_height: _Pixels
    image_width: _Pixels
    look_at: _Vector
    up_direction: _Vector


class _Click(Struct, tag="ScenePointerMessage", tag_field="type", forbid_unknown_fields=True):
    event_type: Literal["click"]
    ray_origin: _Vector
    ray_direction: _Vector
    screen_pos: tuple[tuple[_Number, _Number]]
    modifier: _Word | None


class _Drag(Struct, tag="SceneNodeDragMessage", tag_field="type", forbid_unknown_fields=True):
    phase: Literal["start", "update", "end"]
    name: Annotated[str, Meta(pattern=r"^/pattern/handle\d{1,4}$", max_length=100)]
    instance_index: None
    start_position: _Vector
    start_screen_pos: tuple[_Number, _Number]
    end_position: _Vector
    end_screen_pos: tuple[_Number, _Number]
    button: Literal["left"]
    modifier: None
    owner: Literal[""] = ""


class _Update(Struct, forbid_unknown_fields=True):
    # No tuple of a fixed length beside bounds: with both in one union the garbage collector crashes (msgspec 0.22).
    value: bool | int | float | str | list[_Number]


class _Change(Struct, tag="GuiUpdateMessage", tag_field="type", forbid_unknown_fields=True):
    uuid: _Word
    updates: _Update


_DECODER = msgspec.msgpack.Decoder(_Camera | _Click | _Drag | _Change)


def read_message(message: str | bytes, parts: Mapping[str, Any]) -> bytes:
    """Return a message of a page, written anew so that it says what has been checked and nothing else.

    Args:
        message: as it came.
        parts: of the panel, viser's handles by their uuid.

    Raises:
        InputError: the page says no such thing, or a part of the panel cannot have that value.
    """
    try:
        said = _DECODER.decode(message.encode() if isinstance(message, str) else message)
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise InputError(str(error)) from None
    if isinstance(said, _Camera) and min(math.hypot(*said.wxyz), math.dist(said.position, said.look_at)) < 1e-6:
        raise InputError("the camera looks nowhere")
    if isinstance(said, _Change):
        part = parts.get(said.uuid)
        if part is None:
            raise InputError("there is no such part of the panel, or it is gone")
        value = said.updates.value
        if isinstance(part, GuiDropdownHandle | GuiButtonGroupHandle):
            is_possible = isinstance(value, str) and value in part.options
        elif isinstance(part, GuiSliderHandle | GuiNumberHandle):
            is_possible = _is_between(value, part.min, part.max)
        elif isinstance(part, GuiMultiSliderHandle):
            is_possible = (
                isinstance(value, list)
                and len(value) == len(part.value)
                and all(_is_between(each, part.min, part.max) for each in value)
                and value[-1] - value[0] >= (part.min_range or 0)
            )
        elif isinstance(part, GuiButtonHandle):
            is_possible = value is True
        else:
            is_possible = isinstance(part, GuiTextHandle) and isinstance(value, str)
        if not is_possible:
            name = getattr(part, "label", "this part of the panel")
            low, high = getattr(part, "min", None), getattr(part, "max", None)
            bounds = "" if low is None or high is None else f": {low:g} to {high:g} is possible"
            raise InputError(f"{name} cannot be {quote_value(value)}{bounds}")
    return msgspec.msgpack.encode(said)


def _is_between(value: object, low: float | None, high: float | None) -> bool:
    return (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and (-_MOST if low is None else low) <= value <= (_MOST if high is None else high)
    )
