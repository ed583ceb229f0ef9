"""Units of a grid labelled by the workers of a Dask cluster; each worker writes its own units."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from functools import lru_cache
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.basins.map.grid import Grid
from saltus.basins.map.labelling import Labelling
from saltus.basins.map.store import Store
from saltus.errors import InputError
from saltus.extras import check_installed
from saltus.work import Cluster, handed_out

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["labelled_by", "scheduler"]

_WITHOUT_PORT = ("inproc://", "ucx://")  # addresses of schedulers that name no port

_AHEAD = 3  # units handed out to each thread of the cluster, waiting ones included


@contextmanager
def scheduler(client: Any) -> Iterator[Any]:
    """Yield a client of a cluster: the given one, or a new one for an address, closed at the end.

    Raises
    ------
    InputError
        The argument is neither, or no scheduler has the address.
    SaltusError
        Dask is not installed.
    """
    if not isinstance(client, str):
        if not callable(getattr(client, "submit", None)):
            raise InputError("BasinOptions.client", client, "a dask.distributed.Client, or the address of a scheduler")
        yield client
        return
    check_installed("distributed")
    distributed = import_module("distributed")
    try:
        if not client.startswith(_WITHOUT_PORT):
            distributed.comm.get_address_host_port(client)  # a client of no address takes a minute to close
        opened = distributed.Client(client, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(
            "BasinOptions.client", client, "the address of a scheduler, as tcp://host:8786", str(error)
        ) from error
    with opened:
        yield opened


def labelled_by(
    client: Any, grid: Grid, inputs: Mapping[str, Any], store: Path | None, units: Sequence[tuple[slice, ...]]
) -> Iterator[tuple[tuple[slice, ...], NDArray[np.uint8] | None, int]]:
    """Go through units as the workers finish them: cells, labels, and count of motions followed.

    Parameters
    ----------
    client : dask.distributed.Client
        The cluster. Units of a worker that dies go to another worker.
    inputs : mapping
        All inputs, as plain data.
    store : Path or None
        The store from which the workers read the inputs, and in which they write labels; then no labels come back.
    units : sequence of tuple of slice
        Units to label.
    """
    all_inputs = {"grid": grid.definition(), "inputs": inputs}
    task: tuple[Any, ...] = (
        (None, json.dumps(all_inputs)) if store is None else (str(store.resolve()), _digest(all_inputs))
    )
    jobs = ((cells, _label_unit, *task, [(part.start, part.stop) for part in cells]) for cells in units)
    found = handed_out(Cluster(client), jobs, lambda: _AHEAD * max(sum(client.ncores().values()), 1))
    with closing(found):
        for cells, (labels, followed) in found:
            yield cells, labels, followed


def _digest(inputs: Mapping[str, Any]) -> str:
    return sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()


def _label_unit(
    store: str | None, inputs: str, cells: Sequence[tuple[int, int]]
) -> tuple[NDArray[np.uint8] | None, int]:
    """On a worker: label a unit, and write it where there is a store."""
    unit = tuple(slice(start, stop) for start, stop in cells)
    if store is None:
        grid, labelling = _read(inputs)
        target = None
    else:
        target, grid, labelling = _opened(store, inputs)
    _, labels, followed = next(labelling.units(grid, [unit]))
    if target is None:
        return labels, followed
    target.write(unit, labels)
    return None, followed


@lru_cache(maxsize=2)
def _read(inputs: str) -> tuple[Grid, Labelling]:
    data = json.loads(inputs)
    return Grid.from_definition(data["grid"]), Labelling.from_definition(data["inputs"], threads=1)


@lru_cache(maxsize=2)
def _opened(path: str, wanted: str) -> tuple[Store, Grid, Labelling]:
    hint = "all workers and the client must see the same folder by the same path"
    if not Path(path).is_dir():
        raise InputError("path", path, "on a file system that all workers share", hint)
    store = Store.open(Path(path), writable=True)
    inputs = store.attributes["inputs"]
    if _digest({"grid": store.grid.definition(), "inputs": inputs}) != wanted:
        raise InputError("path", path, "the client's", hint)
    return store, store.grid, Labelling.from_definition(inputs, threads=1)
