"""Many motions of one system at once on CUDA devices: the same generated steps as on the processor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from queue import SimpleQueue
from types import FunctionType
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.ensemble.ensemble import Ensemble, part_of
from saltus.ensemble.labels import ADDRESSED, NL, Boxes, Found, Lanes, Motions, Regions, Settings
from saltus.errors import InputError

if TYPE_CHECKING:
    from types import ModuleType

    from saltus.system.hybrid import HybridSystem

__all__ = ["CudaEnsemble", "cuda_devices"]

_BLOCKS = 16  # blocks for each multiprocessor: more than run at once, and late ones find nothing left to do
_WARP = 32  # threads that run together
_SHARED_BYTES = 48 * 1024  # shared memory that a block can have on any device
_FEWEST = 1 << 16  # fewest motions that a device is given at once
_MOST = 1 << 20  # most motions that a device is given at once
_STREAMS = 2  # pieces on a device at a time: the last motions of one run beside the first ones of the next


class CudaEnsemble(Ensemble):
    """Many motions of one system at once, all from phase 0, looked at once a period, on CUDA devices.

    Parameters
    ----------
    system : HybridSystem
        The system.
    parameters : mapping of str to float, optional
        Parameters that differ from the system's defaults.
    devices : sequence of int, optional
        Devices that share the motions, as CUDA numbers them; all by default.
    **options
        Further options of `Ensemble`: `tolerance`, `interval` and `scale`.

    Raises
    ------
    InputError
        There is no CUDA device, or none with such a number; the packages for CUDA are not installed.

    Notes
    -----
    A block of threads keeps 320 motions, in shared memory where they fit, with a queue for each kind of step. All its
    threads work on the longest queue. A motion that is done gives its place to the next at once. The steps come from
    the same text as those of `saltus.ensemble.ensemble.Ensemble`; sums of products may round otherwise.

    Examples
    --------
    >>> from saltus.ensemble.cuda import CudaEnsemble, cuda_devices
    >>> from saltus import HybridSystem, Mode
    >>> duffing = HybridSystem(
    ...     ("x", "v"), {"w": 1.0}, {"free": Mode({"x": "v", "v": "x - x**3 - v/5 + cos(s)/5"})}, phase=("s", "w")
    ... )
    >>> if cuda_devices():
    ...     ends, modes = CudaEnsemble(duffing).strobe([[1.0, 0.0], [-1.0, 0.0]], count=3)
    """

    def __init__(
        self,
        system: HybridSystem,
        parameters: Mapping[str, float] | None = None,
        *,
        devices: Sequence[int] | None = None,
        **options: Any,
    ) -> None:
        super().__init__(system, parameters, **options)
        self.devices = _chosen(devices)

    def _run(self, motions: Motions, regions: Regions, boxes: Boxes, settings: Settings, found: Found) -> None:
        assert self._lanes is not None
        module, count = self._lanes.module, len(motions.points)
        lanes = self._lanes.with_numbers(self._constants, self._quantities)
        slots = self.devices if _is_simulated() else self.devices * _STREAMS  # the simulator runs one kernel at a time
        free: SimpleQueue[int] = SimpleQueue()
        for device in slots:
            free.put(device)

        def follow(start: int) -> None:
            piece, into = (part_of(record, start, start + size) for record in (motions, found))
            device = free.get()
            try:
                _follow(device, module, lanes, piece, regions, boxes, settings, into)
            finally:
                free.put(device)

        size = min(max(-(-count // len(slots)), _FEWEST), _MOST)
        with ThreadPoolExecutor(len(slots)) as pool:
            list(pool.map(follow, range(0, count, size)))


def cuda_devices() -> tuple[int, ...]:
    """Return the numbers of the CUDA devices that can be used; none where there is no device, driver or package."""
    try:
        from numba import cuda
    except ImportError:
        return ()
    return tuple(range(len(cuda.gpus))) if cuda.is_available() else ()


def _chosen(devices: Sequence[int] | None) -> tuple[int, ...]:
    if not (present := cuda_devices()):
        hint = f'{_obstacle()}; engine="cpu" needs no CUDA device'
        raise InputError("engine", "cuda", "one that this machine can run", hint)
    chosen = present if devices is None else tuple(devices)
    if not chosen or not set(chosen) <= set(present):
        raise InputError("devices", devices, f"some of the CUDA devices, {', '.join(map(str, present))}")
    return chosen


def _obstacle() -> str:
    """Why no CUDA device can be used."""
    try:
        from numba import cuda
    except ImportError:
        return 'pip install "saltus[cuda]" installs what CUDA devices need'
    error = cuda.cuda_error()
    return error.strip().splitlines()[0].rstrip(".") if error else "the CUDA toolkit was not found"


def _is_simulated() -> bool:
    from numba import config

    return bool(config.ENABLE_CUDASIM)


def _follow(
    device: int,
    module: ModuleType,
    lanes: Lanes,
    motions: Motions,
    regions: Regions,
    boxes: Boxes,
    settings: Settings,
    found: Found,
) -> None:
    """Follow motions on one device; `found` is written."""
    from numba import cuda

    kernel, arena_size = _kernel(module)
    threads = max(_WARP, NL // module.POOLS // _WARP * _WARP)
    with cuda.gpus[device]:
        stream = cuda.stream()
        # the simulator's device says nothing of itself
        blocks = _BLOCKS * getattr(cuda.get_current_device(), "MULTIPROCESSOR_COUNT", 1)
        next_motion = cuda.to_device(np.zeros(1, np.int64), stream=stream)
        if _is_simulated():  # items of tuples reach its kernels as they are
            arenas: Any = (np.empty((blocks, arena_size)),)
            kernel[blocks, threads, stream](lanes, arenas, motions, regions, boxes, settings, found, next_motion)
            return

        def lent(record: Any) -> list[Any]:
            return [cuda.to_device(array, stream=stream) for array in record]

        arenas = (cuda.device_array((blocks, arena_size), np.float64, stream=stream),)
        results: Any = Found(*lent(found))
        kernel[blocks, threads, stream](
            Lanes(*lent(lanes)), arenas, Motions(*lent(motions)), Regions(*lent(regions)), Boxes(*lent(boxes)),
            settings, results, next_motion,
        )  # fmt: skip
        for result, array in zip(results, found, strict=True):
            result.copy_to_host(array, stream=stream)
        stream.synchronize()


@cache
def _kernel(module: ModuleType) -> tuple[Any, int]:
    """The kernel for a generated module, and how many numbers each block keeps in the device's memory."""
    from numba import cuda

    from saltus.ensemble.kernels import cuda as cuda_kernels, life as life_kernels
    from saltus.system.numba_tools.machine_code import keep_checked

    numbers, queued = module.NF * NL, module.POOLS * NL
    fits = 8 * numbers + 4 * queued + 16 * (NL + module.POOLS) <= _SHARED_BYTES
    sizes = {"STATES": module.N, "LANES": NL, "POOLS": module.POOLS, "QUEUED": queued, "SHARED": numbers if fits else 0}
    functions = {f"system_{name}": getattr(module, name) for name in (*ADDRESSED, "step")}
    names = {**vars(cuda_kernels), **sizes, **functions}

    def bound(source: ModuleType, name: str, names: dict[str, Any]) -> FunctionType:
        function = getattr(source, name)
        function = FunctionType(getattr(function, "py_func", function).__code__, names, name)
        function.__qualname__ = f"{name}_{module.__name__}"  # a file of its own in Numba's cache
        return function

    life = dict(vars(life_kernels))
    for name in ("begin", "read", "turned"):
        life[name] = life_kernels.part(bound(cuda_kernels, name, names))
    for name in life_kernels.LIFE:
        names[name] = life[name] = life_kernels.part(bound(life_kernels, name, life))
    names["step_made"] = life_kernels.part(bound(cuda_kernels, "make_step", names))
    names["next_begun"] = cuda.jit(device=True)(bound(cuda_kernels, "next_begun", names))
    follow = bound(cuda_kernels, "follow", names)
    return keep_checked(cuda.jit(follow), follow), 1 if fits else numbers
