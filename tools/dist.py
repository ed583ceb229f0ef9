"""Build the source archive and the wheel into dist/, check them, and try the wheel in fresh environments.

    python tools/dist.py                          with the Python that runs this
    python tools/dist.py --python PATH [PATH ...] with other interpreters
    python tools/dist.py --lowest                 with the lowest versions that pyproject.toml allows
    python tools/dist.py --no-try                 build and check alone
    python tools/dist.py --tag v0.2.0             refuse unless this is the tag of the version

A fresh environment knows nothing of this checkout. First it gets the wheel alone, then the wheel with its extra `app`;
`tools/smoke.py` runs in both. Environments are deleted at the end.
"""

from __future__ import annotations

import argparse
import ast
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import tomllib
import zipfile
from collections.abc import Iterator
from email.parser import BytesParser
from pathlib import Path

from packaging.metadata import Metadata
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[1]
DIST = ROOT / "dist"
LARGEST_WHEEL = 1.76e6
"""Bytes of the wheel, at most."""

NAMES = {"bokeh": "bokeh", "imageio-ffmpeg": "imageio_ffmpeg", "lazy-loader": "lazy_loader", "pillow": "PIL",
         "numba-cuda": "numba_cuda"}  # fmt: skip
"""Name of a package where it is imported, if it is another than that by which it is installed."""

BROUGHT = {
    "distributed": {"dask"},
    "h5netcdf": {"h5py"},
    "matplotlib": {"contourpy", "mpl_toolkits"},
    "numba": {"llvmlite"},
    "panel": {"param", "tornado"},
    "pydantic": {"typing_extensions"},
    "pyvista": {"vtk"},
    "sympy": {"mpmath"},
    "typer": {"click"},
}
"""Packages that another one brings, and that saltus imports too."""

OFFERED = {"IPython"}
"""Packages that are used only where they run already."""


def main() -> None:
    """Build, check and try."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", nargs="+", default=[sys.executable], metavar="PATH")
    parser.add_argument("--lowest", action="store_true")
    parser.add_argument("--no-try", action="store_true")
    parser.add_argument("--tag", default="")
    chosen = parser.parse_args()
    _expect(chosen.tag in ("", f"v{version()}"), f"the tag is {chosen.tag}, the version {version()}")
    wheel = build()
    check(wheel)
    for python in [] if chosen.no_try else chosen.python:
        attempt(python, wheel, lowest_versions() if chosen.lowest else [])


def build() -> Path:
    """Return the wheel; it is built from the source archive, which so is known to be whole."""
    shutil.rmtree(DIST, ignore_errors=True)
    _run([sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", str(DIST)], ROOT)
    (archive,) = DIST.glob("*.tar.gz")
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(archive) as opened:
            opened.extractall(folder, filter="data")
        (source,) = Path(folder).iterdir()
        _run([sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(DIST)], source)
    (wheel,) = DIST.glob("*.whl")
    return wheel


def check(wheel: Path) -> None:
    """Stop with a sentence where the metadata or the content of the wheel is not as it must be."""
    with zipfile.ZipFile(wheel) as opened:
        names = opened.namelist()
        (described,) = (name for name in names if name.endswith(".dist-info/METADATA"))
        metadata = Metadata.from_email(opened.read(described), validate=True)
        texts = {name: opened.read(name) for name in names if name.endswith(".py")}
        raw = BytesParser().parsebytes(opened.read(described))
    _expect(str(metadata.version) == version(), f"the wheel is of version {metadata.version}, not {version()}")
    _expect(metadata.license_expression == "MIT", "no licence is told")
    _expect(raw["Description-Content-Type"] == "text/markdown", "README.md is not the description")
    _expect(any(name.endswith("licenses/LICENSE") for name in names), "LICENSE is missing")
    package = {str(path.relative_to(ROOT / "src").as_posix()) for path in sources()}
    _expect(package <= {*names}, f"files are missing: {sorted(package - {*names})[:5]}")
    others = sorted(name for name in names if name not in package and ".dist-info/" not in name)
    _expect(not others, f"files that are not of the package: {others[:5]}")
    _expect(not (foreign := foreign_imports(texts)), f"packages that no extra of users brings: {sorted(foreign)}")
    _expect((size := wheel.stat().st_size) <= LARGEST_WHEEL, f"the wheel has {size} bytes, above {LARGEST_WHEEL:.0f}")
    (archive,) = DIST.glob("*.tar.gz")
    print(f"{wheel.name}: {size / 1e6:.2f} MB, {len(names)} files")
    print(f"{archive.name}: {archive.stat().st_size / 1e6:.2f} MB", flush=True)


def version() -> str:
    """Return the version, from the one place where it stands."""
    text = (ROOT / "src/saltus/version.py").read_text(encoding="utf-8")
    return re.search(r'^__version__ = "(.+)"$', text, re.MULTILINE)[1]  # type: ignore[index]


def sources() -> list[Path]:
    """Return the files of the package, without what Python and Numba leave there."""
    found = (ROOT / "src/saltus").rglob("*")
    return [path for path in found if path.is_file() and "__pycache__" not in path.parts]


def foreign_imports(texts: dict[str, bytes]) -> set[str]:
    """Return what modules import that is neither of Python, nor required, nor of an extra for users."""
    project = _project()
    extras = [text for name, of in project["optional-dependencies"].items() if name != "test" for text in of]
    packages = {Requirement(text).name for text in [*project["dependencies"], *extras]}
    known = {NAMES.get(name, name) for name in packages} | OFFERED
    known |= {other for name in packages for other in BROUGHT.get(name, ())}
    imported = {name for text in texts.values() for name in _imported(ast.parse(text))}
    return imported - known - {*sys.stdlib_module_names}


def lowest_versions() -> list[str]:
    """Return what pins each package to the lowest version that pyproject.toml allows."""
    project = _project()
    extras = (project["optional-dependencies"][name] for name in ("cli", "data", "plot", "store", "app"))
    needed = [*project["dependencies"], *(text for extra in extras for text in extra)]
    lowest = (Requirement(text) for text in needed if not text.startswith("saltus["))
    return [f"{one.name}=={next(iter(one.specifier)).version}" for one in lowest]


def attempt(python: str, wheel: Path, pins: list[str]) -> None:
    """Install the wheel in a fresh environment of an interpreter, alone and with extras; run the smoke test in both."""
    with tempfile.TemporaryDirectory(prefix="saltus-dist-") as folder:
        home = Path(folder)
        _run([python, "-m", "venv", "--without-pip", str(home / "env")], home)
        inside = home / "env" / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
        environment = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "PIP_TARGET"))}
        environment |= {
            "SALTUS_CACHE_DIR": str(home / "cache"),
            "XDG_DATA_HOME": str(home / "data"),
            "MPLBACKEND": "agg",
        }
        for extra in ("", "[app]"):
            pinned = pins if extra else [pin for pin in pins if _required(pin)]
            _run([*_pip(inside), "install", "--quiet", f"{wheel}{extra}", *pinned], home)
            sizes = sizes_of(inside, home)
            told = ", ".join(f"{name} {size:.0f}" for name, size in sorted(sizes.items(), key=lambda of: -of[1])[:6])
            name = f"saltus{extra}, Python {_version(inside, home)}{', lowest versions' if pins else ''}"
            bytecode = sum(path.stat().st_size for path in (home / "env").rglob("*.pyc")) / 1e6
            whole = f"{sum(sizes.values()):.0f} MB, of which {bytecode:.0f} bytecode"
            print(f"{name}: {len(sizes)} packages, {whole}: {told}", flush=True)
            part = "standard" if extra else "core"
            # isolated: neither the folder of the script nor that of the caller is looked at
            _run(
                [str(inside), "-I", "-W", "error::FutureWarning", str(ROOT / "tools/smoke.py"), part], home, environment
            )


def sizes_of(python: Path, folder: Path) -> dict[str, float]:
    """Return the megabytes (10^6 bytes) of each package of an environment, bytecode included."""
    code = """
import importlib.metadata as m
for d in m.distributions():
    print(d.name, sum(p.stat().st_size for p in {f.locate() for f in d.files or ()} if p.exists()) / 1e6)
"""
    done = subprocess.run([str(python), "-I", "-c", code], cwd=folder, check=True, capture_output=True, text=True)
    return {name: float(size) for name, size in map(str.split, done.stdout.splitlines())}


def _required(pin: str) -> bool:
    return pin.split("==")[0] in {Requirement(text).name for text in _project()["dependencies"]}


def _project() -> dict:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def _imported(tree: ast.AST) -> Iterator[str]:
    """Give the first part of each module's name that a text imports, saltus's own left out."""
    for node in ast.walk(tree):
        found = []
        if isinstance(node, ast.Import):
            found = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            found = [node.module or ""]
        elif isinstance(node, ast.Call) and getattr(node.func, "id", getattr(node.func, "attr", "")) == "import_module":
            found = [one.value for one in node.args[:1] if isinstance(one, ast.Constant)]
        yield from (name.split(".")[0] for name in found if name.split(".")[0] not in ("", "saltus"))


def _pip(python: Path) -> list[str]:
    """Return the command of a pip outside of an environment that installs into it."""
    for command in ([sys.executable, "-m", "pip"], ["pip3"], ["pip"]):
        if shutil.which(command[0]) and not subprocess.run([*command, "--version"], capture_output=True).returncode:
            return [*command, "--python", str(python), "--disable-pip-version-check"]
    raise SystemExit("tools/dist.py: found no pip; install one for this Python")


def _version(python: Path, folder: Path) -> str:
    code = "import platform; print(platform.python_version())"
    done = subprocess.run([str(python), "-I", "-c", code], cwd=folder, check=True, capture_output=True, text=True)
    return done.stdout.strip()


def _run(command: list[str], folder: Path, environment: dict[str, str] | None = None) -> None:
    if status := subprocess.call(command, cwd=folder, env=environment):
        raise SystemExit(f"tools/dist.py: {' '.join(command)} ended with status {status}")


def _expect(right: bool, wrong: str) -> None:
    if not right:
        raise SystemExit(f"tools/dist.py: {wrong}")


if __name__ == "__main__":
    main()
