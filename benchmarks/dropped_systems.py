"""Memory that dropped systems leave behind: made, used, dropped, collected; with compiled code on disk and without.

The peer is Numba alone, which keeps what it has made for a function that nobody uses.

    python benchmarks/dropped_systems.py
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import tempfile
import weakref

from measure import machine

COUNT, FIRST = 20, 10


def resident() -> float:
    """Resident memory of this process, in MiB (Linux)."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def used(k: float) -> weakref.ref:
    """Make a system, follow its cycles, its equilibria and a locus, and drop all of them."""
    import saltus

    field = {"x": "v", "v": f"-{k}*x + (1 - x**2)*v*mu - g*x**3"}
    system = saltus.HybridSystem.smooth(field, {"mu": 1.0, "g": 0.1})
    saltus.continue_orbit(saltus.find_orbit(system, x0=[2.0, 0.0]), "mu", (0.5, 1.5))
    rest = saltus.find_equilibrium(system, x0=[0.0, 0.0])
    (hopf,) = saltus.continue_equilibrium(rest, "mu", (-1.0, 1.5)).special_points
    saltus.continue_locus(hopf, ("mu", "g"), {"mu": (-1.0, 1.0), "g": (0.05, 1.0)})
    return weakref.ref(system)


def compiled(k: float) -> weakref.ref:
    """Compile one function of a line by Numba, and drop it."""
    import numba

    space: dict = {}
    exec(f"def f(x):\n    return {k}*x", space)
    function = numba.cfunc("float64(float64)")(space["f"])
    assert function.address
    return weakref.ref(function)


def main() -> None:
    """Print the table; each row is a process of its own."""
    if len(sys.argv) > 1:
        work = globals()[sys.argv[1]]
        for i in range(FIRST):
            work(1.0 + i / 128)
        gc.collect()
        before = resident()
        kept = [work(2.0 + i / 128) for i in range(COUNT)]
        gc.collect()
        alive = sum(ref() is not None for ref in kept)
        print(f"{(resident() - before) / COUNT:.2f} MiB each, {alive} of {COUNT} alive", flush=True)
        return
    print(machine())
    with tempfile.TemporaryDirectory() as folder:
        for name, work in (
            ("systems, compiled now", "used"),
            ("systems, code read from the disk", "used"),
            ("functions of a line, Numba alone", "compiled"),
        ):
            print(f"{name}: ", end="", flush=True)
            chosen = os.environ | {"SALTUS_CACHE_DIR": folder, "NUMBA_CACHE_DIR": folder}
            subprocess.run([sys.executable, __file__, work], env=chosen, check=True)


if __name__ == "__main__":
    main()
