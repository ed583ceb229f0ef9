"""Grids on a Dask cluster: the same array, whoever computes it and whoever dies."""

import os
import signal
import time

import numpy as np
import pytest

import saltus.basins.map.cluster
from saltus import InputError
from saltus.basins import map_basins
from saltus.ensemble.traps import NOT_DONE
from saltus.options import BasinOptions
from wells import BOX, Interrupt

dask = pytest.importorskip("dask")
distributed = pytest.importorskip("distributed")
LARGER = {"x": (-2.0, 2.0, 60), "v": (-2.0, 2.0, 40)}


@pytest.fixture(scope="module")
def threads():
    cluster = distributed.LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=":0")
    with cluster, distributed.Client(cluster, set_as_default=False) as client:
        yield client


@pytest.mark.campaign
def test_workers_write_the_array_that_this_process_would(threads, well, both, basins, small_units, tmp_path):
    seen = []
    found = map_basins(
        well,
        {},
        BOX,
        both,
        options=BasinOptions(engine="dask", client=threads),
        path=tmp_path / "a.zarr",
        progress=lambda told: seen.append((told.done, told.total)),
    )
    assert np.array_equal(np.asarray(found.labels), basins.labels)
    assert seen[-1] == (600, 600)
    assert len(seen) == len(list(found.grid.units())) > 10
    assert map_basins(well, {}, BOX, both, path=tmp_path / "a.zarr") == found


def test_workers_send_the_labels_of_a_grid_in_memory(threads, well, both, basins, small_units):
    found = map_basins(well, {}, BOX, both, options=BasinOptions(engine="dask", client=threads))
    assert np.array_equal(found.labels, basins.labels)


def test_a_cluster_that_is_interrupted_keeps_what_is_done(threads, well, both, basins, small_units, tmp_path):
    path = tmp_path / "a.zarr"
    part = map_basins(
        well, {}, BOX, both, options=BasinOptions(engine="dask", client=threads), path=path, progress=Interrupt(4)
    )
    assert part.stopped.startswith("interrupted: ")
    whole = map_basins(well, {}, BOX, both, options=BasinOptions(engine="dask", client=threads), path=path)
    assert np.array_equal(np.asarray(whole.labels), basins.labels)


def test_what_a_worker_says_against_a_store_is_told(threads, well, both, small_units, tmp_path, monkeypatch):
    monkeypatch.setattr(saltus.basins.map.cluster, "_digest", lambda text: str(time.monotonic_ns()))
    with pytest.raises(InputError, match=r"^path = .*: must be the client's; all workers and the client must see "):
        map_basins(well, {}, BOX, both, options=BasinOptions(engine="dask", client=threads), path=tmp_path / "a.zarr")
    assert saltus.load(tmp_path / "a.zarr").fractions()["not done"] == 1.0


def test_an_address_without_a_scheduler_is_told(well, both):
    with (
        dask.config.set({"distributed.comm.timeouts.connect": "200ms"}),
        pytest.raises(
            InputError,
            match=r"^BasinOptions.client = 'tcp://127\.0\.0\.1:9': must be the address of a scheduler, as tcp://",
        ),
    ):
        map_basins(well, {}, BOX, both, options=BasinOptions(engine="dask", client="tcp://127.0.0.1:9"))


@pytest.mark.parametrize("address", ["nonsense", "tcp://h", "foo://h:1"])
def test_what_is_no_address_is_told_at_once_and_leaves_no_store(well, tmp_path, monkeypatch, address):
    monkeypatch.setattr(
        "saltus.basins.map.mapping.find_attractors", lambda *_, **__: pytest.fail("attractors were sought")
    )
    with pytest.raises(
        InputError, match=rf"^BasinOptions.client = '{address}': must be the address of a scheduler, as tcp://host:8786"
    ):
        map_basins(well, {}, BOX, options=BasinOptions(engine="dask", client=address), path=tmp_path / "a.zarr")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.campaign
def test_a_worker_that_is_killed_at_work_loses_nothing(well, both, small_units, tmp_path):
    whole = map_basins(well, {}, LARGER, both)
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50
    )
    mark = tmp_path / "killed"

    class DiesAtThirdTask(distributed.WorkerPlugin):
        """Kills the first worker that begins its third task."""

        def setup(self, worker):
            self.begun = 0

        def transition(self, key, start, finish, **told):
            self.begun += finish == "executing"
            if self.begun == 3 and not mark.exists():
                mark.write_text(str(os.getpid()))
                os.kill(os.getpid(), signal.SIGKILL)

    with cluster, distributed.Client(cluster, set_as_default=False) as client:
        address = cluster.scheduler_address
        client.register_plugin(DiesAtThirdTask())
        found = map_basins(
            well, {}, LARGER, both, options=BasinOptions(engine="dask", client=address), path=tmp_path / "a.zarr"
        )
        assert int(mark.read_text()) not in client.run(os.getpid).values()
    assert found.stopped == "all 2400 cells done"
    assert NOT_DONE not in np.asarray(found.labels)
    assert np.array_equal(np.asarray(found.labels), whole.labels)
