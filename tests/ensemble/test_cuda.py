"""Motions on a CUDA device: Numba's simulator, in a process of its own, stands for one; the processor is the oracle."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from threading import Barrier
from types import SimpleNamespace

import numpy as np
import pytest

from saltus import HybridSystem, Mode, Transition
from saltus.ensemble import cuda
from saltus.ensemble.cuda import CudaEnsemble, cuda_devices
from saltus.ensemble.ensemble import Ensemble
from saltus.ensemble.labels import Boxes, Found, Lanes, Motions, Regions, Settings
from saltus.ensemble.traps import DIVERGED, UNDECIDED, Traps
from saltus.errors import InputError

SIMULATED = """
import json
import sys
import time

import numpy as np
from numba.cuda.simulator.kernel import BlockThread

from saltus import HybridSystem
from saltus.errors import InputError
from saltus.ensemble import cuda
from saltus.ensemble.cuda import CudaEnsemble
from saltus.ensemble.ensemble import Ensemble
from saltus.ensemble.traps import Cells, Ellipsoids, Traps

is_alive = BlockThread.is_alive


def is_alive_later(thread):
    if thread.thread_id == 0:
        time.sleep(1e-3)  # once for all threads of a block: those that work are not held up by the one that polls them
    return is_alive(thread)


BlockThread.is_alive = is_alive_later
cuda._BLOCKS = 2  # the first takes as many motions as it has lanes, the second the others
system = HybridSystem.from_definition(json.loads(sys.argv[2]))
generator = np.random.default_rng(7)
points = generator.uniform((-0.5, -1.0), (1.2, 1.0), (330, 2))  # more than a block has lanes
engines = {"cpu": Ensemble(system, threads=1), "cuda": CudaEnsemble(system)}
centre = engines["cpu"].strobe([[0.0, 0.0]], count=200)[0]
planes = np.array([[[1.0, 0.0], [0.0, -1.0]]]), np.array([[0.04, 0.05]])
discs = Traps(2, Ellipsoids(centre, np.eye(2)[None] / 0.1, np.array([3], np.uint8), *planes), limit=50.0)
corner = centre[0] - 0.075
boxes = np.array([[i, j] for i in range(3) for j in range(3)])
cells = Cells(corner, np.array([0.05, 0.05]), boxes, np.full(9, 4, np.uint8), 3)
found = {}
for name, engine in engines.items():
    found[f"{name}_ends"], found[f"{name}_modes"] = engine.strobe(points[:60], count=2)
    found[f"{name}_labels"], found[f"{name}_strobes"] = engine.settle(points, discs, longest=1)
    found[f"{name}_cell_labels"], found[f"{name}_cell_strobes"] = engine.settle(
        points[:16], Traps(2, cells=cells, limit=50.0), longest=20
    )
cuda._SHARED_BYTES = 0
cuda._kernel.cache_clear()
found["distant_ends"], found["distant_modes"] = CudaEnsemble(system).strobe(points[:60], count=2)
try:
    CudaEnsemble(system, devices=[3])
except InputError as error:
    found["message"] = str(error)
np.savez(sys.argv[1], **found)
"""


@pytest.fixture(scope="module")
def between_wall_and_spring():
    """An oscillator between a wall and a spring that gives way: impacts, two modes, motions without bounds."""
    return HybridSystem(
        ("x", "v"),
        {"w": 1.3, "F": 0.1, "d": 0.1, "r": 0.7},
        {
            "soft": Mode({"x": "v", "v": "F*cos(s) - x - d*v"}),
            "steep": Mode({"x": "v", "v": "F*cos(s) - x - d*v + 3*(x - 3/10)**2"}),
        },
        [
            Transition("soft", "steep", "x - 3/10", 1),
            Transition("steep", "soft", "x - 3/10", -1),
            Transition("soft", "soft", "x + 6/10", -1, reset={"v": "-r*v"}),
        ],
        phase=("s", "w"),
    )


@pytest.fixture(scope="module")
def found(tmp_path_factory, between_wall_and_spring):
    pytest.importorskip("numba_cuda")
    file = tmp_path_factory.mktemp("simulated") / "found.npz"
    definition = json.dumps(between_wall_and_spring.definition())
    subprocess.run(
        [sys.executable, "-c", SIMULATED, str(file), definition],
        check=True,
        env={**os.environ, "NUMBA_ENABLE_CUDASIM": "1"},
    )
    with np.load(file) as arrays:
        return dict(arrays)


@pytest.mark.campaign
def test_a_device_finds_the_labels_of_the_processor(found):
    assert set(found["cpu_labels"]) == {3, DIVERGED, UNDECIDED}
    np.testing.assert_array_equal(found["cuda_labels"], found["cpu_labels"])
    np.testing.assert_array_equal(found["cuda_strobes"], found["cpu_strobes"])


@pytest.mark.campaign
@pytest.mark.thorough
def test_a_device_counts_visits_to_cells_as_the_processor_does(found):
    assert set(found["cpu_cell_labels"]) >= {4, DIVERGED}
    np.testing.assert_array_equal(found["cuda_cell_labels"], found["cpu_cell_labels"])
    np.testing.assert_array_equal(found["cuda_cell_strobes"], found["cpu_cell_strobes"])


@pytest.mark.campaign
@pytest.mark.parametrize("memory", ["cuda", "distant"])
def test_a_device_makes_the_steps_of_the_processor(found, memory):
    finite = np.isfinite(found["cpu_ends"]).all(axis=1)
    assert 30 < finite.sum() < 60
    np.testing.assert_array_equal(found[f"{memory}_modes"][finite], found["cpu_modes"][finite])
    # one step's rounding, grown over two periods
    np.testing.assert_allclose(found[f"{memory}_ends"], found["cpu_ends"], atol=1e-9, equal_nan=True)


@pytest.mark.campaign
def test_a_device_that_is_not_there_is_named_with_those_that_are(found):
    assert str(found["message"]) == "devices = [3]: must be some of the CUDA devices, 0"


@pytest.mark.campaign
def test_the_compiler_of_a_device_takes_the_generated_text(between_wall_and_spring, monkeypatch):
    """As far as a machine without one can tell: up to the code that the driver's own compiler would read."""
    pytest.importorskip("numba_cuda")
    from numba import typeof, types
    from numba.cuda import dispatcher
    from numba.cuda.compiler import compile_cuda

    monkeypatch.setattr(dispatcher, "get_current_device", lambda: SimpleNamespace(compute_capability=(8, 0)))
    reals, pairs, whole, indices = np.empty(1), np.empty((1, 2)), np.empty(1, np.int64), np.empty((1, 2), np.int64)
    arguments = (
        Lanes(whole, whole, reals, reals), (pairs,), Motions(pairs, whole), Regions(pairs, pairs, whole, whole),
        Boxes(reals, reals, indices, whole), Settings(1.0, 1.0, 1.0, 1.0, 1, 1),
        Found(np.empty(1, np.uint8), np.empty(1, np.int32), pairs, whole), whole,
    )  # fmt: skip
    kernel, _ = cuda._kernel(Ensemble(between_wall_and_spring)._lanes.module)
    compiled = compile_cuda(kernel.py_func, types.void, tuple(typeof(a) for a in arguments), cc=(8, 0))
    assert "double" in compiled.library.get_llvm_str()


def oscillator():
    return HybridSystem(("x", "v"), {"w": 1.3}, {"soft": Mode({"x": "v", "v": "cos(s) - x - v"})}, phase=("s", "w"))


@pytest.mark.skipif(bool(cuda_devices()), reason="there is a CUDA device")
def test_where_no_device_is_found_the_error_names_the_processor():
    message = "engine = 'cuda': must be one that this machine can run; .*; engine=\"cpu\" needs no CUDA device"
    with pytest.raises(InputError, match=message):
        CudaEnsemble(oscillator())


def test_devices_share_the_motions_and_each_motion_is_followed_once(monkeypatch):
    together = Barrier(2 * 3)  # two pieces at a time on each of three devices
    used = []

    def follow(device, module, lanes, motions, regions, boxes, settings, found):
        together.wait(timeout=60)
        used.append(device)
        labels, strobes, ends, _ = found
        labels[:], ends[:] = 7, motions.points
        strobes += 1

    monkeypatch.setattr(cuda, "cuda_devices", lambda: (0, 1, 2))
    monkeypatch.setattr(cuda, "_follow", follow)
    monkeypatch.setattr(cuda, "_is_simulated", lambda: False)
    monkeypatch.setattr(cuda, "_FEWEST", 1)
    monkeypatch.setattr(cuda, "_MOST", 10)
    points = np.arange(240.0).reshape(120, 2)  # twelve pieces
    ensemble = CudaEnsemble(oscillator())
    labels, strobes = ensemble.settle(points, Traps(2))
    assert sorted(used) == [0] * 4 + [1] * 4 + [2] * 4
    assert (labels == 7).all()
    assert (strobes == 1).all()
    np.testing.assert_array_equal(ensemble.strobe(points[:60])[0], points[:60])
