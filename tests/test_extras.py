"""What is said where a package is missing that only an extra of saltus brings."""

import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from packaging.requirements import Requirement

import saltus
from saltus import Map, SaltusError, iterate
from saltus.extras import EXTRAS

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
INSTALLED = {"PIL": "pillow"}
"""Names by which packages are installed, where they are imported by another."""


@pytest.fixture(scope="module")
def motion():
    return iterate(Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"}), x0=[0.3], n=4)


@pytest.mark.parametrize("package", EXTRAS)
def test_the_extra_that_is_named_brings_the_package(package):
    extra = [Requirement(text) for text in PROJECT["optional-dependencies"][EXTRAS[package]]]
    brought = {one.name for one in extra} | {name for one in extra for name in one.extras}
    assert INSTALLED.get(package, package) in brought


@pytest.mark.parametrize(
    ("package", "extra", "use"),
    [
        ("xarray", "data", lambda motion, folder: motion.to_xarray()),
        ("h5netcdf", "data", lambda motion, folder: motion.save(folder / "a.nc")),
        ("h5netcdf", "data", lambda motion, folder: saltus.load(motion.save(folder / "a.nc"))),
        ("matplotlib", "plot", lambda motion, folder: motion.plot()),
        ("rich", "cli", lambda motion, folder: _with_a_bar(motion)),
    ],
)
def test_a_missing_package_is_told_with_its_extra(motion, tmp_path, monkeypatch, package, extra, use):
    monkeypatch.setitem(sys.modules, package, None)  # so Python takes it for absent
    with pytest.raises(SaltusError, match=rf"needs {package}: pip install 'saltus\[{extra}\]'$"):
        use(motion, tmp_path)


def _with_a_bar(motion):
    options = saltus.options.SweepOptions(discard=1, keep=1)
    saltus.run_sweep(motion.system, "r", np.array([3.1, 3.2]), x0=[0.3], options=options, progress=True)


def test_a_notebook_shows_the_text_alone_where_packages_are_missing(motion, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert motion._repr_html_().startswith("<pre>")
    assert "<img" not in motion._repr_html_()


def test_a_package_is_looked_for_and_not_imported():
    code = "import sys; from saltus.extras import check_installed; check_installed('panel', 'zarr')"
    told = f"{code}; print(sorted({{'panel', 'zarr'}} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("[]\n", "")


def test_the_command_without_its_packages_says_how_to_install_them():
    code = "import sys; sys.modules['typer'] = None; from saltus.__main__ import main; main()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    wanted = "saltus: the command saltus, or a bar of progress, needs typer: pip install 'saltus[cli]'\n"
    assert (done.returncode, done.stderr) == (2, wanted)


CORE = """
import sys
for name in {missing}:
    sys.modules[name] = None
import saltus
ball = saltus.HybridSystem.smooth({{"x": "v", "v": "-c*v - x + cos(s)"}}, {{"c": 0.3, "w": 1.2}}, phase=("s", "w"))
orbit = saltus.find_orbit(ball, x0=[0.0, 0.0])
print(len(saltus.continue_orbit(orbit, "w", (1.1, 1.3))) > 2)
"""


def test_an_orbit_and_its_branch_need_what_is_required_alone():
    required = {Requirement(text).name for text in PROJECT["dependencies"]}
    assert required == {"lazy_loader", "numba", "numpy", "platformdirs", "scipy", "sympy"}
    missing = [*EXTRAS, "dask", "IPython", "pygments", "dateutil"]
    done = subprocess.run([sys.executable, "-c", CORE.format(missing=missing)], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("True\n", "")
