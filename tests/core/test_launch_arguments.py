"""Arguments packed by what one launch of Warp's has shown: the same results, and Warp's own words where an argument does not fit."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
import warp as wp
from warpflat.kernels.springs import Springs, compute_spring_tension
from warpflat.kernels.stiffness import find_directions, measure_edges

from warpflat.core import launch_arguments as packing
from warpflat.core.launch import launch_each, record

VERTICES = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [3.0, 4.0, 12.0]])
EDGES = np.array([[0, 1], [1, 2], [0, 2]], dtype=np.int32)


@pytest.fixture(params=["packed", "as for a GPU", "Warp's own"])
def either_way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr(packing, "_forms", {})
    if request.param == "as for a GPU":
        monkeypatch.setattr(packing._Form, "_on_host", packing._Form._on_device)
    if request.param == "Warp's own":
        monkeypatch.setattr(packing, "_RELEASES", ("0.0.",))
    return str(request.param)


def test_arrays_numbers_and_vectors(either_way: str) -> None:
    for _ in range(2):  # the first from Warp's launch, the second by the form
        length = np.zeros(3)
        launch_each(measure_edges, 3, [VERTICES, EDGES], [length])
        np.testing.assert_allclose(length, [5.0, 12.0, 13.0])
    assert ((measure_edges, "cpu") in packing._forms) == (either_way != "Warp's own")
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    for warp, cosine in (((0.0, 1.0), 1.0), ((np.sqrt(0.5), np.sqrt(0.5)), -1.0)):
        fourfold = np.zeros((1, 2))
        launch_each(find_directions, 1, [square, np.array([[0, 1, 2, 3]], np.int32), wp.vec2d(*warp)], [fourfold])
        np.testing.assert_allclose(fourfold / np.linalg.norm(fourfold), [[cosine, 0.0]], atol=1e-12)


def test_structs_and_ranges(either_way: str) -> None:
    springs = Springs()
    springs.offset = wp.array(np.minimum(np.arange(1001), 999), dtype=wp.int32, device="cpu")
    springs.neighbor = wp.array(np.arange(1, 1000), dtype=wp.int32, device="cpu")
    springs.rest_length = wp.zeros(999, dtype=wp.float64, device="cpu")
    springs.stiffness = wp.array(np.full(999, 2.0), dtype=wp.float64, device="cpu")
    springs.active = 1.0
    values = np.random.default_rng(0).normal(size=(1000, 2))
    given = wp.array(values, dtype=wp.vec2d, device="cpu")
    for threads in (1, 3):
        got = wp.zeros(1000, dtype=wp.float64, device="cpu")
        launch = record(
            compute_spring_tension,
            dim=1000,
            inputs=[given, springs],
            outputs=[got],
            device="cpu",
            threads=threads,
            least=1,
        )
        assert len(launch.commands) == threads
        launch.launch()
        expected = 2.0 * np.linalg.norm(np.diff(values, axis=0), axis=1)
        np.testing.assert_allclose(got.numpy()[:-1], expected, rtol=1e-12)


@pytest.mark.parametrize(
    "wrong",
    [
        [VERTICES.astype(np.float32), EDGES],
        [VERTICES[:, :2].copy(), EDGES],
        [VERTICES, EDGES.astype(np.int64)],
        [wp.zeros(3, dtype=wp.vec2d, device="cpu"), EDGES],
        [VERTICES],
    ],
)
def test_what_does_not_fit_is_refused(wrong: list[object], either_way: str) -> None:
    length = np.zeros(3)
    launch_each(measure_edges, 3, [VERTICES, EDGES], [length])
    with pytest.raises(RuntimeError, match=r"measure_edges|Could not convert"):
        record(measure_edges, dim=3, inputs=wrong, outputs=[length], device="cpu")


def test_rows_that_do_not_lie_in_a_row(either_way: str) -> None:
    """Every second row of a larger array: its strides are taken as they are."""
    length, wide = np.zeros(3), np.repeat(VERTICES, 2, axis=0)
    for _ in range(2):
        record(measure_edges, dim=3, inputs=[wide[::2], EDGES], outputs=[length], device="cpu").launch()
        np.testing.assert_allclose(length, [5.0, 12.0, 13.0])


def test_threads_that_need_a_kernel_at_once_load_it_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Loaded twice, its code is unloaded under the first one's feet: crashes of narrow strips, whose levels are made beside them."""
    monkeypatch.setattr(packing, "_forms", {})
    recorded, loads = packing._recorded, []

    def slow(*given: object) -> wp.Launch:
        loads.append(threading.current_thread().name)
        time.sleep(0.05)
        return recorded(*given)

    monkeypatch.setattr(packing, "_recorded", slow)
    lengths = np.zeros((4, 3))
    threads = [
        threading.Thread(target=launch_each, args=(measure_edges, 3, [VERTICES, EDGES], [length])) for length in lengths
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(loads) == 1
    np.testing.assert_allclose(lengths, np.tile([5.0, 12.0, 13.0], (4, 1)))
