"""Processes that are killed while they write: what stands on the disk afterwards, and what becomes of it."""

from __future__ import annotations

import itertools
import json
import multiprocessing
import os
import shutil
import signal
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import mutated
from saltus import find_attractors, load, map_basins, run_sweep
from saltus.afm.paper.figures.files import write_figure
from saltus.basins.attractors.found import AttractorOptions
from saltus.basins.map.basins import Basins
from saltus.options import SweepOptions
from saltus.sweeps import record

SIGNALS = ("SIGKILL", "SIGTERM", "SIGINT")

WAITED = 10.0
"""Seconds within which an interrupt has to end a process."""


class Saved:
    """A result saved over another one, again and again."""

    def __init__(self, one: Any, other: Any) -> None:
        self.results = (one, other)

    def prepare(self, folder: Path) -> None:
        self.results[0].save(folder / "a.nc")

    def work(self, folder: Path) -> None:
        for result in itertools.cycle(self.results):
            result.save(folder / "a.nc")

    def check(self, folder: Path) -> None:
        assert load(folder / "a.nc") in self.results


class Stores:
    """Basins saved to one new store after the other."""

    def __init__(self, basins: Any) -> None:
        self.basins = basins

    def prepare(self, folder: Path) -> None:
        self.basins.save(folder / "first.zarr")

    def work(self, folder: Path) -> None:
        for k in itertools.count():
            self.basins.save(folder / f"{k}.zarr")

    def check(self, folder: Path) -> None:
        for store in folder.glob("*.zarr"):
            found = load(store)
            labels = np.asarray(found.labels[...])
            assert ((labels == self.basins.labels) | (labels == 255)).all()
            assert found.attractors.labels == self.basins.attractors.labels


class Swept:
    """A sweep with a file, which goes on from what the killed one left."""

    def __init__(self) -> None:
        self.whole = self.sweep(None)

    def sweep(self, path: Path | None) -> Any:
        return run_sweep(
            mutated.logistic(),
            "r",
            np.linspace(2.9, 3.9, 120),
            x0=[0.3, 0.0],
            options=SweepOptions(section="map", discard=300, keep=50, workers=1),
            path=path,
        )

    def prepare(self, folder: Path) -> None:
        pass

    def work(self, folder: Path) -> None:
        record._SAVED_EVERY = record.Record.pause = 0.0
        self.sweep(folder / "a.nc")

    def check(self, folder: Path) -> None:
        if (folder / "a.nc").exists():
            assert load(folder / "a.nc").labels.shape == self.whole.labels.shape
        assert self.sweep(folder / "a.nc") == self.whole


class Mapped:
    """Basins mapped into a store, which goes on from what the killed map left."""

    def __init__(self) -> None:
        from wells import double_well

        self.system = double_well()
        region = {"x": (-2.0, 2.0), "v": (-2.0, 2.0)}
        self.found = find_attractors(self.system, {}, region, options=AttractorOptions(starts=32, samples=500))
        self.whole = np.asarray(self.map(None).labels)

    def map(self, store: Path | None) -> Basins:
        grid = {"x": (-2.0, 2.0, 400), "v": (-2.0, 2.0, 400)}
        return map_basins(self.system, {}, grid, self.found, path=store)

    def prepare(self, folder: Path) -> None:
        pass

    def work(self, folder: Path) -> None:
        self.map(folder / "a.zarr")

    def check(self, folder: Path) -> None:
        if (folder / "a.zarr").exists():
            labels = np.asarray(load(folder / "a.zarr").labels[...])
            assert ((labels == self.whole) | (labels == 255)).all()
        assert (np.asarray(self.map(folder / "a.zarr").labels[...]) == self.whole).all()


class Figures:
    """The files of a figure, written again and again."""

    def __init__(self, result: Any) -> None:
        self.result = result

    def write(self, folder: Path) -> None:
        content = {"numbers": list(range(5000))}
        write_figure(
            folder,
            "fig",
            lambda progress: [("one", self.result)],
            lambda _: content,
            lambda _: self.result.plot().figure,
            lambda _: None,
        )

    def prepare(self, folder: Path) -> None:
        self.write(folder)

    def work(self, folder: Path) -> None:
        from matplotlib import pyplot

        while not self.write(folder)["interrupted"]:
            pyplot.close("all")

    def check(self, folder: Path) -> None:
        from saltus.afm.paper.figures.files import read_results

        assert read_results(folder / "fig.nc") == {"one": self.result}
        assert len(json.loads((folder / "fig.json").read_text())["numbers"]) == 5000
        with Image.open(folder / "fig.png") as picture:
            picture.load()
        assert (folder / "fig.pdf").read_bytes().rstrip().endswith(b"%%EOF")


def large(label: int) -> Basins:
    """Basins whose file is long enough to be killed in."""
    axes = {"x": np.arange(1500.0), "y": np.arange(1000.0)}
    return Basins.from_array(np.full((1500, 1000), label, np.uint8), axes, {"a": 0, "b": 1})


KINDS: Mapping[str, Callable[[], Any]] = {
    "save": lambda: Saved(large(0), large(1)),
    "save to a store": lambda: Stores(large(0)),
    "family": lambda: Saved(mutated.samples()["family"], large(1)),
    "figure": lambda: Figures(mutated.samples()["branch"]),
    "sweep": Swept,
    "map": Mapped,
}
"""Everything that writes files, by what it is called."""


def killed(kind: Any, folder: Path, name: str, after: float) -> tuple[float, list[str]]:
    """Kill a process that works; return the seconds that it still took, and the files it left beside its own."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    kind.prepare(folder)
    process = multiprocessing.get_context("fork").Process(target=_work, args=(kind.work, folder))
    process.start()
    time.sleep(after)
    begun = time.monotonic()
    os.kill(process.pid, getattr(signal, name))  # type: ignore[arg-type]
    process.join(10.0 * WAITED)
    taken = time.monotonic() - begun
    process.kill()
    left = sorted(file.name for file in folder.iterdir() if file.name.startswith("."))
    kind.check(folder)
    return taken, left


def _work(work: Callable[[Path], None], folder: Path) -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)
    devnull = os.open(os.devnull, os.O_WRONLY)
    os.dup2(devnull, 2)  # the traceback of an interrupt
    work(folder)
