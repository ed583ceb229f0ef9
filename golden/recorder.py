"""Plugin of pytest: records what the public functions of saltus return while the tests run.

PYTHONPATH=golden python -m pytest -p recorder --golden FOLDER [tests]

Each process writes one file into the folder. `compare.py` holds two folders against each other.
"""

from __future__ import annotations

import functools
import gzip
import hashlib
import inspect
import json
import os
import platform
import re
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

_ADDRESS = re.compile(r"0x[0-9a-f]+|/tmp/\S+")
_DEEPEST = 6  # levels of containers and data classes that are looked into
_LEFT_OUT = {"load", "explore", "animate"}  # functions whose results are no numbers of their own
_CLOCKS = {"seconds", "elapsed", "created"}  # names of what the clock tells


class Recorder:
    """Calls of public functions, by test: function, and leaves of the result."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.calls = folder, dict[str, list[Any]]()
        self.test, self.depth = "", 0

    def wrap(self, module: Any, name: str, label: str) -> None:
        function = getattr(module, name)

        @functools.wraps(function)
        def recorded(*args: Any, **kwargs: Any) -> Any:
            self.depth += 1
            try:
                try:
                    result = function(*args, **kwargs)
                except Exception as error:
                    self._keep(label, {"error": f"{type(error).__name__}: {error}"})
                    raise
                self._keep(label, result)
                return result
            finally:
                self.depth -= 1

        setattr(module, name, recorded)

    def _keep(self, label: str, result: Any) -> None:
        if self.depth == 1 and self.test:
            self.calls.setdefault(self.test, []).append([label, dict(_leaves("", result, 0))])

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: Any) -> Any:
        self.test = item.nodeid.split("::", 1)[-1]
        yield
        self.test = ""

    def pytest_sessionfinish(self) -> None:
        if not self.calls:
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        made = f"{platform.machine()} {platform.python_version()} numpy {np.__version__}"
        held = {"made": made, "calls": self.calls}
        worker = os.environ.get("PYTEST_XDIST_WORKER", "main")
        with gzip.GzipFile(self.folder / f"{worker}.json.gz", "wb", mtime=0) as file:
            file.write(json.dumps(held, sort_keys=True).encode())


def _hashed(data: str | bytes) -> str:
    return hashlib.sha256(data.encode() if isinstance(data, str) else data).hexdigest()[:12]


def _sorted(held: Any) -> str:
    """Return the text of an attribute; one in JSON with its keys in order."""
    try:
        return json.dumps(json.loads(held), sort_keys=True)
    except (TypeError, ValueError):
        return repr(held)


def _array(values: Any) -> list[Any]:
    """Return the hash of an array's shape and bytes, and of numbers their count, sum and sum of moduli."""
    array = np.asarray(values)
    if array.dtype.kind not in "fciub":
        return [_hashed(_ADDRESS.sub("", "\n".join(map(_sorted, array.ravel().tolist()))))]
    array = np.ascontiguousarray(array) + 0  # -0.0 is 0.0
    known = [_hashed(repr(array.shape).encode() + array.tobytes())]
    if array.dtype.kind == "b" or array.size == 0:
        return known
    finite = array[np.isfinite(array)]
    return [*known, int(finite.size), float(np.abs(finite.sum())), float(np.abs(finite).sum())]


def _leaves(path: str, value: Any, depth: int) -> Any:
    """Yield names and records of all numbers and texts in a result."""
    if hasattr(value, "to_xarray"):
        value = value.to_xarray()
    if type(value).__name__ == "Dataset" and hasattr(value, "data_vars"):
        for name in sorted(map(str, value.variables)):
            if name not in _CLOCKS:
                yield f"{path}{name}", _array(value[name].values)
        for name, held in sorted(value.attrs.items()):
            if name not in _CLOCKS:
                yield f"{path}@{name}", [_hashed(_ADDRESS.sub("", _sorted(held)))]
    elif isinstance(value, np.ndarray | int | float | complex | np.generic):
        yield path or "value", _array(value)
    elif isinstance(value, str) or value is None:
        yield path or "value", [_hashed(_ADDRESS.sub("", str(value)))]
    elif depth < _DEEPEST and isinstance(value, Mapping):
        for name, held in value.items():
            yield from _leaves(f"{path}{name}/", held, depth + 1)
    elif depth < _DEEPEST and isinstance(value, list | tuple):
        for i, held in enumerate(value):
            yield from _leaves(f"{path}{i}/", held, depth + 1)
    elif depth < _DEEPEST and is_dataclass(value) and not isinstance(value, type):
        for field in fields(value):
            if not field.name.startswith("_"):
                yield from _leaves(f"{path}{field.name}/", getattr(value, field.name), depth + 1)
    else:
        yield path or "value", [type(value).__name__]


def pytest_addoption(parser: Any) -> None:
    parser.addoption("--golden", type=Path, required=True, help="folder for the records")


def pytest_configure(config: Any) -> None:
    import saltus
    from saltus import afm

    recorder = Recorder(Path(config.getoption("--golden")).absolute())
    for module, prefix in ((saltus, ""), (afm, "afm.")):
        for name in module.__all__:
            if inspect.isfunction(getattr(module, name)) and name not in _LEFT_OUT:
                recorder.wrap(module, name, prefix + name)
    config.pluginmanager.register(recorder, "golden")
