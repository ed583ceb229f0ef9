"""Smoke test of an installed saltus, in an environment that knows nothing of the checkout; see `tools/dist.py`.

python -I tools/smoke.py core        what the wheel alone can do, and what it says of extras that are missing
python -I tools/smoke.py standard    figure, basins, command and the page of the explorer
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import sysconfig
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import saltus
from saltus import afm

COMMAND = str(Path(sysconfig.get_path("scripts")) / ("saltus.exe" if os.name == "nt" else "saltus"))
PATIENCE = 300.0
"""Seconds that a page may take to answer."""


def main() -> None:
    """Run the part that is named."""
    if not Path(saltus.__file__).is_relative_to(Path(sys.prefix).resolve()):
        raise SystemExit(f"saltus comes from {saltus.__file__}, not from {sys.prefix}")
    {"core": core, "standard": standard}[sys.argv[1]]()


def core() -> None:
    """Find an orbit and its branch; what needs an extra must name it."""
    orbit, branch = _branch()
    for extra, call in {
        "data": lambda: orbit.save("orbit.nc"),
        "plot": lambda: branch.plot("Omega", "min_z"),
    }.items():
        _refused(call, extra)
    grid = {"q1": (-5.0, 5.0, 50), "v1": (-5.0, 5.0, 50)}
    model = orbit.system
    _refused(lambda: saltus.continue_orbit(orbit, "Omega", (1.0, 1.1), progress=True), "cli")
    _check_basins(saltus.map_basins(model, {"Omega": 1.15}, grid))
    _refused(lambda: saltus.map_basins(model, {"Omega": 1.15}, grid, path="plane.zarr"), "store")
    _refused(lambda: saltus.explore(model, browser=False), "app")
    done = subprocess.run([COMMAND, "--version"], capture_output=True, text=True, check=False)
    _expect(done.returncode == 2 and "pip install 'saltus[cli]'" in done.stderr, f"the command says {done.stderr!r}")
    _expect("Traceback" not in done.stderr, done.stderr)
    print("  core: an orbit, its branch, basins of 50 x 50; every missing extra is named")


def standard() -> None:
    """Draw Fig. 3, map basins into a store, run commands, and ask the explorer for its page."""
    orbit, _ = _branch()
    _expect(saltus.load(orbit.save("orbit.nc")) == orbit, "an orbit is not read back as it was saved")
    grid = {"q1": (-5.0, 5.0, 50), "v1": (-5.0, 5.0, 50)}
    basins = saltus.map_basins(orbit.system, {"Omega": 1.15}, grid, path="plane.zarr")
    _check_basins(basins)
    basins.plot().figure.savefig("plane.png")
    _expect(_said("--version").split() == ["saltus", saltus.__version__], "the command tells another version")
    _said("reproduce", "fig3", "-o", "results")
    points = json.loads(Path("results/fig3.json").read_text(encoding="utf-8"))["special_points"]
    kinds = [point["type"] for point in points]
    _expect((kinds.count("SN"), kinds.count("PD"), kinds.count("GR")) == (6, 2, 2), f"Fig. 3 has {kinds}")
    _expect(Path("results/fig3.png").stat().st_size > 10_000, "Fig. 3 is no picture")
    _expect("repulsive" in _said("basins", "info", "plane.zarr"), "the command does not know the store")
    _page()
    print("  standard: Fig. 3, basins of 50 x 50 in a store, the command, the explorer's page")


def _branch() -> tuple[Any, Any]:
    """Return an orbit of tapping mode and its branch, looked at."""
    model = afm.tapping_mode(afm.table1(), modes=1)
    orbit = saltus.find_orbit(model, {"Omega": 1.05}, x0=[-0.67, 0.75])
    _expect(orbit.stable and abs(orbit.multipliers).max() < 0.5, f"another orbit: {orbit}")
    branch = saltus.continue_orbit(orbit, "Omega", bounds=(0.8, 1.4))
    _expect(abs(branch["SN4"].parameters["Omega"] - 1.24185833) < 1e-7, f"another branch: {branch}")
    return orbit, branch


def _check_basins(basins: Any) -> None:
    fractions = basins.fractions()
    _expect(0.8 < fractions["repulsive"] < 0.95, f"other basins: {fractions}")


def _refused(call: Callable[[], Any], extra: str) -> None:
    """Check that a call says which extra it needs."""
    try:
        call()
    except saltus.SaltusError as error:
        _expect(f"pip install 'saltus[{extra}]'" in str(error), f"another extra than {extra}: {error}")
    else:
        raise SystemExit(f"nothing was said of the extra {extra}")


def _said(*arguments: str) -> str:
    done = subprocess.run([COMMAND, *arguments], capture_output=True, text=True, encoding="utf-8", check=False)
    _expect(done.returncode == 0, f"saltus {' '.join(arguments)}: {done.stderr}")
    return done.stdout


def _page() -> None:
    """Start the explorer and read its page."""
    _expect(importlib.util.find_spec("panel") is not None, "panel is not installed")
    server = subprocess.Popen([COMMAND, "explore", "--no-browser"], stdout=subprocess.PIPE, text=True)
    try:
        assert server.stdout is not None
        first = server.stdout.readline()
        _expect("saltus explorer at http" in first, f"the explorer says {first!r}")
        url, begun = first.split()[-1], time.monotonic()
        while True:
            try:
                with urllib.request.urlopen(url, timeout=PATIENCE) as answer:
                    page = answer.read().decode()
                break
            except urllib.error.HTTPError as error:
                raise SystemExit(f"smoke test: the page answers {error}") from error
            except OSError as error:
                _expect(time.monotonic() - begun < PATIENCE, f"no page at {url}: {error}")
                time.sleep(0.2)
        _expect(answer.status == 200 and "<title>" in page and "saltus" in page, "the page is another")
    finally:
        server.terminate()
        server.wait(60)


def _expect(right: bool, wrong: str) -> None:
    if not right:
        raise SystemExit(f"smoke test: {wrong}")


if __name__ == "__main__":
    main()
