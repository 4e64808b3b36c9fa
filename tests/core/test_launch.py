"""Launches over ranges: the same bits for any number of threads, and errors that come out where they were caused."""

from __future__ import annotations

import os
import threading
import time

import numpy as np
import pytest
import warp as wp
from warpflat.kernels.guard import compute_guard_energy
from warpflat.kernels.stiffness import measure_edges

from warpflat.core import launch as launching
from warpflat.core.errors import InputError
from warpflat.core.launch import Launch, Sequence, launch_each, record, split_range
from warpflat.core.threads import thread_count
from warpflat.flat.fabric.library import find_fabric
from warpflat.flat.flattening.develop import develop
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.surface.shapes import bodice


@pytest.mark.parametrize("size", [0, 1, 63, 512, 1000, 1024, 5000, 100_003])
@pytest.mark.parametrize("parts", [1, 2, 3, 16])
def test_ranges_cover_everything_once(size: int, parts: int) -> None:
    ranges = split_range(size, parts, least=512)
    assert [i for begin, end in ranges for i in range(begin, end)] == list(range(size))
    assert len(ranges) <= parts
    assert all(begin % 64 == 0 for begin, _ in ranges)
    assert all(end - begin >= 512 for begin, end in ranges[:-1])


def test_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("WARPFLAT_THREADS", raising=False)
    assert 1 <= thread_count() <= (os.cpu_count() or 1)
    monkeypatch.setenv("WARPFLAT_THREADS", "3")
    assert thread_count() == 3
    for wrong in ("0", "two", "-1", "1.5"):
        monkeypatch.setenv("WARPFLAT_THREADS", wrong)
        with pytest.raises(InputError, match="WARPFLAT_THREADS"):
            thread_count()


def steps_of(threads: int, *, triangles: bool) -> dict[str, np.ndarray]:
    """Twenty steps of a bodice, on so many threads, and the ranges that a launch has."""
    os.environ["WARPFLAT_THREADS"] = str(threads)
    surface = bodice(resolution=24, triangles=triangles)
    start = develop(surface, surface.lines["centre"]).positions
    network = SpringNetwork.build(surface, find_fabric("denim"), start, device="cpu")
    state = Relaxation(network, RelaxOptions(kinetic_damping=False), start=start)
    for _ in range(20):
        state.step()
    return {
        "ranges": np.array(len(state._advance.commands)),
        "position": state.position.numpy().copy(),
        "velocity": state.velocity.numpy().copy(),
        "force": state.force.numpy().copy(),
        # Of corners of faces that act; nobody reads those of the others.
        "face force": np.where(
            np.repeat(state._cell_forces.acting.numpy(), 4)[:, None] != 0, state._cell_forces.force.numpy(), 0.0
        )[(surface.faces >= 0).ravel()],
        "energies": np.array([state.energies().spring, state.energies().guard]),
    }


@pytest.mark.parametrize("triangles", [False, True])
def test_results_are_those_of_one_thread_bit_for_bit(triangles: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WARPFLAT_THREADS", "1")
    monkeypatch.setattr("warpflat.core.launch._LEAST_RANGE", 64)
    expected = steps_of(1, triangles=triangles)
    assert expected.pop("ranges") == 1
    assert np.ptp(expected["position"]) > 0.1
    assert np.abs(expected["face force"]).max() > 0
    for threads in (2, 3, 5):
        found = steps_of(threads, triangles=triangles)
        assert found.pop("ranges") == threads
        for name, values in expected.items():
            np.testing.assert_array_equal(found[name], values, err_msg=f"{name}, {threads} threads")


@wp.kernel
def count_once(first: int, times: wp.array(dtype=wp.int32)):
    i = wp.tid() + first
    times[i] = times[i] + 1


@pytest.mark.parametrize(("size", "turns"), [(100_003, 4), (100_003, 1), (5_000, 4), (2_000, 4), (700, 4)])
@pytest.mark.parametrize("threads", [1, 2, 3])
def test_threads_take_turns(size: int, turns: int, threads: int) -> None:
    times = wp.zeros(size, dtype=wp.int32, device="cpu")
    launch = record(
        count_once, dim=size, inputs=[], outputs=[times], device="cpu", threads=threads, least=512, turns=turns
    )
    assert len(launch.commands) == min(threads, size // 512)
    launch.launch()
    assert (times.numpy() == 1).all()
    if size == 100_003 and threads > 1:
        times.zero_()
        launch.commands[0]()
        # As many for each, and spread over all.
        begun = np.flatnonzero(np.diff(times.numpy(), prepend=0) == 1)
        assert len(begun) == turns
        assert np.ptp(begun) > 0.5 * size or turns == 1


def test_recorded_launches_are_those_of_warp() -> None:
    surface = bodice(resolution=8)
    start = develop(surface, surface.lines["centre"]).positions
    network = SpringNetwork.build(surface, find_fabric("denim"), start, device="cpu")
    at, count = wp.array(start, dtype=wp.vec2d, device="cpu"), network.face_count
    energy, recorded = (wp.zeros(count, dtype=wp.float64, device="cpu") for _ in range(2))
    inputs = [at, network.cells, network.guard]
    wp.launch(compute_guard_energy, dim=count, inputs=[*inputs, 0], outputs=[energy], device="cpu")
    record(
        compute_guard_energy, dim=count, inputs=inputs, outputs=[recorded], device="cpu", threads=3, least=1
    ).launch()
    assert energy.numpy().max() > 0
    np.testing.assert_array_equal(recorded.numpy(), energy.numpy())


VERTICES = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [3.0, 4.0, 12.0]])
EDGES = np.array([[0, 1], [1, 2], [0, 2]], dtype=np.int32)


def test_arrays_of_numpy() -> None:
    for _ in range(2):
        length = np.zeros(3)
        launch_each(measure_edges, 3, [VERTICES, EDGES], [length])
        np.testing.assert_allclose(length, [5.0, 12.0, 13.0])


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
def test_what_does_not_fit_is_refused(wrong: list[object]) -> None:
    with pytest.raises(RuntimeError, match=r"measure_edges|Could not convert"):
        record(measure_edges, dim=3, inputs=wrong, outputs=[np.zeros(3)], device="cpu")


def test_rows_that_do_not_lie_in_a_row() -> None:
    """Every second row of a larger array: its strides are taken as they are."""
    length, wide = np.zeros(3), np.repeat(VERTICES, 2, axis=0)
    record(measure_edges, dim=3, inputs=[wide[::2], EDGES], outputs=[length], device="cpu").launch()
    np.testing.assert_allclose(length, [5.0, 12.0, 13.0])


def test_threads_that_need_a_kernel_at_once_load_it_one_after_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """Loaded twice, its code is unloaded under the first one's feet: crashes of narrow strips, whose levels are made beside them."""
    inside, at_once = [], []
    launch = wp.launch

    def slow(*given: object, **named: object) -> object:
        inside.append(threading.get_ident())
        at_once.append(len(inside))
        time.sleep(0.02)
        inside.pop()
        return launch(*given, **named)

    monkeypatch.setattr(wp, "launch", slow)
    lengths = np.zeros((4, 3))
    threads = [
        threading.Thread(target=launch_each, args=(measure_edges, 3, [VERTICES, EDGES], [length])) for length in lengths
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert at_once == [1] * 4
    np.testing.assert_allclose(lengths, np.tile([5.0, 12.0, 13.0], (4, 1)))


def test_ranges_run_on_threads_of_their_own() -> None:
    seen: dict[int, int] = {}
    together = threading.Barrier(3, timeout=30)  # passes only if three are inside at once

    def note(k: int) -> None:
        together.wait()
        seen[k] = threading.get_ident()

    Launch([lambda k=k: note(k) for k in range(3)]).launch()
    assert len(set(seen.values())) == 3
    assert seen[0] == threading.get_ident()


def test_a_launch_begins_when_the_one_before_is_done() -> None:
    begun_early: list[int] = []
    done = [0] * 6

    def work(phase: int, k: int) -> None:
        if phase and done[phase - 1] != len(launches[phase - 1].commands):
            begun_early.append(phase)
        time.sleep(0.002 * ((phase + k) % 3))
        with lock:
            done[phase] += 1

    lock = threading.Lock()
    # Of one range and of several, as they occur in one step of a hierarchy.
    launches = [
        Launch([lambda p=phase, k=k: work(p, k) for k in range(size)]) for phase, size in enumerate((3, 2, 1, 4, 1, 3))
    ]
    for _ in range(5):
        done[:] = [0] * 6
        Sequence(launches).launch()
        assert done == [3, 2, 1, 4, 1, 3]
    assert begun_early == []


@pytest.mark.parametrize("where", [0, 1, 2])
@pytest.mark.parametrize("kind", [ValueError, KeyboardInterrupt])
def test_an_error_in_a_thread_is_raised_in_the_caller(where: int, kind: type[BaseException]) -> None:
    after: list[int] = []

    def work(k: int) -> None:
        if k == where:
            raise kind("in thread")

    failing = Launch([lambda k=k: work(k) for k in range(3)])
    following = Launch([lambda: after.append(1)] * 3)
    with pytest.raises(kind, match="in thread"):
        Sequence([failing, following]).launch()
    assert after == []  # what follows is not run on half a result
    following.launch()
    assert after == [1, 1, 1]


def test_an_interrupt_while_waiting_leaves_later_launches_sound() -> None:
    ran: list[int] = []
    interrupted, late = threading.Event(), threading.Event()

    class Interrupted(launching.SimpleQueue):  # type: ignore[type-arg]
        def get(self, *_: object, **__: object) -> None:
            interrupted.set()
            raise KeyboardInterrupt

    def work(k: int) -> None:
        if k:
            interrupted.wait(30)
            late.set()
        ran.append(k)

    before = launching._pool
    before._done = Interrupted()
    with pytest.raises(KeyboardInterrupt):
        Launch([lambda k=k: work(k) for k in range(3)]).launch()
    assert late.wait(30)
    assert launching._pool is not before
    time.sleep(0.01)
    ran.clear()
    for _ in range(10):
        Launch([lambda k=k: ran.append(k) for k in range(3)]).launch()
    assert sorted(ran) == sorted([0, 1, 2] * 10)


def test_a_launch_within_a_launch_and_from_two_threads() -> None:
    count = [0, 0]
    inner = Launch([lambda: count.__setitem__(0, count[0] + 1)] * 2)

    def outer_work() -> None:
        with lock:
            inner.launch()
            count[1] += 1

    lock = threading.Lock()
    outer = Launch([outer_work] * 2)
    threads = [threading.Thread(target=outer.launch) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30)
    assert count == [16, 8]


def test_nothing_to_do() -> None:
    n = wp.zeros(0, dtype=wp.float64, device="cpu")
    x = wp.zeros(0, dtype=wp.vec2d, device="cpu")
    network_free = record(compute_guard_energy, dim=0, inputs=[x, None, None], outputs=[n], device="cpu")
    assert network_free.commands == ()
    Sequence([network_free]).launch()
    network_free.launch()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_process_has_threads_of_its_own() -> None:
    ran: list[int] = []
    launch = Launch([lambda k=k: ran.append(k) for k in range(3)])
    launch.launch()
    child = os.fork()
    if child == 0:
        launch.launch()
        os._exit(0 if sorted(ran) == [0, 0, 1, 1, 2, 2] else 1)
    for _ in range(3000):
        gone, status = os.waitpid(child, os.WNOHANG)
        if gone:
            break
        time.sleep(0.01)
    else:
        os.kill(child, 9)
        pytest.fail("the forked process waits for its parent's threads")
    assert os.waitstatus_to_exitcode(status) == 0
