"""A kernel's arguments, packed once: on the CPU a launch is then a call of a C function with their address.

Warp looks at every argument of every launch, for whatever it might be (.1 to .2 ms for two dozen of them, and 13 us each time that a
recorded launch runs). The kernels here get Warp's and NumPy's arrays, numbers and structs of one type each, so that what a kernel
takes is found out once, from a launch that Warp records, and later launches are packed by that.
"""

from __future__ import annotations

import ctypes
import struct
import threading
from collections.abc import Callable, Sequence
from copy import copy
from functools import partial
from typing import Any

import numpy as np
import warp as wp

from warpflat.core.compile import compile_common_modules, kernel_cache_errors

__all__ = ["Command", "launch_commands"]

Command = Callable[[], None]

# Releases of Warp whose recorded launches are laid out as they are taken to be here; others pack and run them themselves.
_RELEASES = ("1.19.",)


def launch_commands(
    kernel: wp.Kernel,
    ranges: Sequence[tuple[int, int]],
    given: Sequence[Any],
    outputs: Sequence[Any],
    device: wp.Device,
) -> list[Command]:
    """Return the commands that run a kernel over each range of its threads.

    Args:
        kernel: takes ``first: int`` after `given`, before `outputs`.
        ranges: begin and end of each, in threads.
        given: all inputs but `first`.
        outputs: arrays it writes.
        device: Warp device.

    Raises:
        RuntimeError: Warp's, of an argument that the kernel does not take.
    """
    if not ranges:
        return []
    if wp.config.version.startswith(_RELEASES):
        form = _forms.get((kernel, device.alias))
        if form is None:
            # Of two threads that load a module at once one has its code unloaded by the other.
            with _loading:
                form = _forms.get((kernel, device.alias))
                if form is None:
                    compile_common_modules(kernel.module, device)
                form = form or _Form(_recorded(kernel, ranges[0], given, outputs, device), len(given))
                if form.fits:
                    _forms[kernel, device.alias] = form
        packed = form.commands(ranges, [*given, 0, *outputs])
        if packed is not None:
            return packed
    return [_recorded(kernel, each, given, outputs, device).launch for each in ranges]


def _recorded(
    kernel: wp.Kernel, over: tuple[int, int], given: Sequence[Any], outputs: Sequence[Any], device: wp.Device
) -> wp.Launch:
    begin, end = over
    with kernel_cache_errors():  # nothing runs yet, but a module that is new is compiled
        return wp.launch(
            kernel, dim=end - begin, inputs=[*given, begin], outputs=list(outputs), device=device, record_cmd=True
        )


class _Misfit(Exception):
    """An argument that only Warp knows how to pack, or to refuse."""


class _Form:
    """The layout of a kernel's packed arguments.

    Attributes:
        fits: whether launches can be packed by it.
    """

    def __init__(self, recorded: wp.Launch, first: int) -> None:
        """Take the layout from a launch that Warp has recorded; `first` is the number of the argument that begins a range."""
        self._bounds, values = type(recorded.params[0]), recorded.params[1:]
        args = recorded.kernel.adj.args
        self._device, self._launch = recorded.device, copy(recorded)
        # The first launch's arrays are not to be held.
        self._launch.params = self._launch.params_addr = self._launch.fwd_args = None
        on_host = self._device.is_cpu
        self.fits = len(values) == len(args) and not recorded.kernel.is_generic
        self.fits = self.fits and (recorded.block_dim == 1 or not on_host)
        self._first = first
        if on_host:
            # Code stays loaded as long as this is held.
            self._code = recorded.kernel.module.load(self._device, 1)
            self._run = self._code.get_kernel_hooks(recorded.kernel).forward
        self._kinds = [type(value) for value in values]
        fields = [(f"_{number}", kind) for number, kind in enumerate(self._kinds)]
        self._arguments: type[ctypes.Structure] = type("Arguments", (ctypes.Structure,), {"_fields_": fields})
        begins = [getattr(self._arguments, name).offset for name, _ in fields]
        rooms = np.diff([*begins, ctypes.sizeof(self._arguments)]).tolist()
        self._first_at = begins[first]
        ways = [
            _packer(arg.type, kind, room, self._device)
            for arg, kind, room in zip(args, self._kinds, rooms, strict=True)
        ]
        self._ways = [way for way in ways if way is not None]
        self.fits = self.fits and len(self._ways) == len(ways)

    def commands(self, ranges: Sequence[tuple[int, int]], values: Sequence[Any]) -> list[Command] | None:
        """Return a command for each range; None if an argument is of an unknown type."""
        if not self.fits or len(values) != len(self._ways):
            return None
        try:
            packed = [way(value) for way, value in zip(self._ways, values, strict=True)]
        except _Misfit:
            return None
        return self._on_host(ranges, packed) if self._device.is_cpu else self._on_device(ranges, packed)

    def _on_host(self, ranges: Sequence[tuple[int, int]], packed: Sequence[Any]) -> list[Command]:
        made, whole = list[Command](), bytearray().join(packed)
        for begin, end in ranges:
            block = bytearray(whole) if made else whole
            _INT.pack_into(block, self._first_at, begin)
            bounds, arguments = self._bounds((end - begin,)), self._arguments.from_buffer(block)
            made.append(partial(self._run, ctypes.byref(bounds), ctypes.byref(arguments)))
        return made

    def _on_device(self, ranges: Sequence[tuple[int, int]], packed: Sequence[Any]) -> list[Command]:
        values = [kind.from_buffer_copy(value) for kind, value in zip(self._kinds, packed, strict=True)]
        made = list[Command]()
        for begin, end in ranges:
            values[self._first] = self._kinds[self._first](begin)
            launch = copy(self._launch)
            launch.bounds = self._bounds((end - begin,))
            launch.params = [launch.bounds, *values]
            launch.params_addr = (ctypes.c_void_p * len(launch.params))(*map(ctypes.addressof, launch.params))
            made.append(launch.launch)
        return made


_forms: dict[tuple[wp.Kernel, str], _Form] = {}
_loading = threading.Lock()


# What a kernel gets of an array of one dimension: where it is, nothing of a gradient, shape and strides with room for four, and how many.
_LINE = struct.Struct("=QQiiiiiiiiHH4x")
_INT = struct.Struct("=i")


def _packer(of: Any, kind: type, room: int, device: wp.Device) -> Callable[[Any], Any] | None:
    """Return a function that packs the value of an argument into bytes, or into an object laid out like them.

    Args:
        of: the argument's type.
        kind: the C value into which Warp packed it.
        room: bytes of the argument.
        device: that of the launch.

    Returns:
        the function; None where this release of Warp lays arrays out in another way.
    """
    if isinstance(of, wp.array):
        scalar = getattr(of.dtype, "_wp_scalar_type_", of.dtype)
        inner = tuple(getattr(of.dtype, "_shape_", ()))
        if room != _LINE.size:
            return None
        return _array_way(of.dtype, of.ndim, np.dtype(wp.dtype_to_numpy(scalar)), inner, kind, device)
    fill = bytes(room - ctypes.sizeof(kind))
    if issubclass(kind, ctypes._SimpleCData):
        return partial(_number, kind, fill)
    return partial(_composite, kind, fill)


def _array_way(
    dtype: Any, ndim: int, scalar: np.dtype[Any], inner: tuple[int, ...], kind: type, device: wp.Device
) -> Callable[[Any], Any]:
    on_host, line, in_row = device.is_cpu, ndim == 1, np.empty(inner, scalar).strides

    def way(value: Any) -> Any:
        given = type(value)
        if given is wp.array:
            if value.dtype is not dtype or value.ndim != ndim or value.device is not device:
                raise _Misfit
            return value.__ctype__()
        if (
            given is not np.ndarray
            or not on_host
            or value.dtype != scalar
            or value.ndim != ndim + len(inner)
            or value.shape[ndim:] != inner
        ):
            raise _Misfit
        strides = value.strides
        if strides[ndim:] != in_row:
            raise _Misfit
        at = value.__array_interface__["data"][0]
        if line:
            return _LINE.pack(at, 0, value.shape[0], 0, 0, 0, strides[0], 0, 0, 0, 1, 0)
        return kind(at, 0, ndim, value.shape[:ndim], strides[:ndim])

    return way


def _number(kind: Any, fill: bytes, value: Any) -> bytes:
    if isinstance(value, (np.integer, np.floating, np.bool_)):
        value = value.item()
    try:
        return bytes(kind(value)) + fill
    except TypeError:
        raise _Misfit from None


def _composite(kind: Any, fill: bytes, value: Any) -> Any:
    if type(value) is not kind:
        try:
            value = value.__ctype__()
        except AttributeError:
            raise _Misfit from None
        if type(value) is not kind:
            raise _Misfit
    return bytes(value) + fill if fill else value
