"""Generated and compiled code heals on disk, is shared by processes, and is kept where nobody else can write."""

import errno
import importlib.util
import math
import os
import random
import re
import shutil
import stat
import subprocess
import sys
from ctypes import CFUNCTYPE, c_double
from pathlib import Path

import numba
import pytest

from saltus import Average, HybridSystem, InputError, Mode, Transition, lyapunov_spectrum, simulate
from saltus.system import cache, generated
from saltus.system.cache import let_numba_cache, read_checked, write_checked
from saltus.system.compiled import FLOW, FUNCTIONS
from saltus.system.numba_tools import machine_code

TINY = """
from saltus import HybridSystem, Mode

print(HybridSystem(("x",), {"a": 1.5}, {"m": Mode({"x": "-a*x"})}).field("m", [2.0])[0])
"""


def tiny():
    return HybridSystem(("x",), {"a": 1.5}, {"m": Mode({"x": "-a*x"})})


@pytest.fixture(autouse=True)
def no_folder_of_numba(monkeypatch):
    """No folder is chosen for Numba, neither for new processes nor in this one, which read it at its start."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")


@pytest.fixture
def folder(monkeypatch, tmp_path):
    """An empty cache folder; modules loaded from it are forgotten, as in a new process."""
    monkeypatch.setenv("SALTUS_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(generated, "_UNWRITTEN", {})
    yield tmp_path / "cache"
    forget()


def forget():
    for name in [name for name in sys.modules if name.startswith("saltus_system_")]:
        del sys.modules[name]


def emptied(file):
    file.write_bytes(b"")


def cut(file):
    file.write_bytes(file.read_bytes()[: -file.stat().st_size // 3])


def flipped(file):
    content = bytearray(file.read_bytes())
    for place in random.Random(5).sample(range(len(content)), 8):
        content[place] ^= 1 << (place % 8)
    file.write_bytes(content)


def longer(file):
    file.write_bytes(file.read_bytes() + b"\n")


def a_directory(file):
    file.unlink()
    file.mkdir()
    (file / "something").write_text("")


def a_pipe(file):
    file.unlink()
    os.mkfifo(file)


def a_link_to_nothing(file):
    file.unlink()
    file.symlink_to(file.parent / "nothing")


def of_another(file):
    file.write_bytes(b"raise SystemExit('another text ran')\n")


def unreadable(file):
    file.chmod(0)


DAMAGES = [emptied, cut, flipped, longer, a_directory, a_link_to_nothing, of_another, unreadable]
DAMAGES += [a_pipe] if hasattr(os, "mkfifo") else []


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_generated_file_is_written_anew(damage, folder):
    file = generated.source_file(FLOW, tiny())
    text = read_checked(file)
    damage(file)
    assert generated.source_file(FLOW, tiny()) == file
    assert read_checked(file) == text
    assert sorted(folder.iterdir()) == [file]


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_compiled_code_is_compiled_anew(damage, tmp_path):
    first = doubling(tmp_path)
    assert first.cache_hits == 0
    (file,) = tmp_path.glob("__pycache__/*.nbc")
    assert doubling(tmp_path).cache_hits == 1
    damage(file)
    again = doubling(tmp_path)
    if os.access(file, os.R_OK) and damage is unreadable:  # nothing is unreadable for root
        return
    assert again.cache_hits == 0
    assert CFUNCTYPE(c_double, c_double)(again.address)(3.0) == 6.0
    assert doubling(tmp_path).cache_hits == 1


def doubling(folder):
    callback = loaded(
        folder / "doubling.py",
        "from numba import float64\n"
        "from saltus.system.numba_tools.machine_code import cfunc\n\n"
        "@cfunc(float64(float64))\n"
        "def double(x):\n"
        "    return 2.0*x\n",
    ).double
    assert callback.address  # for which it is compiled
    return callback


def loaded(file, text):
    """Return a module made of a text, as a new process would have it."""
    if not file.exists():
        file.write_text(text)
    spec = importlib.util.spec_from_file_location(file.stem, file)
    module = importlib.util.module_from_spec(spec)
    sys.modules[file.stem] = module
    try:
        spec.loader.exec_module(module)
    finally:
        del sys.modules[file.stem]
    return module


def compiled(folder):
    return {file.name.split(".")[1].split("-")[0] for file in folder.rglob("*.nbc")}


def test_derivatives_are_compiled_when_they_are_first_needed(folder):
    impact = Transition("flight", "flight", "z", -1, {"v": "-e*v"}, name="impact")
    flight = Mode({"z": "v", "v": "-g - 0.1*v"}, domain="z + 1")
    system = HybridSystem(("z", "v"), {"g": 1.0, "e": 0.9}, {"flight": flight}, [impact], outputs={"rate": "v"})
    simulate(system, x0=[2.0, 0.0], t_end=1.0)
    assert compiled(folder) == {"derive", "field", "event", "event_x", "reset", "guard", "rounding"}
    lyapunov_spectrum(system, x0=[2.0, 0.0], average=Average(t_end=1.0))
    assert compiled(folder) == set(FUNCTIONS) - {"ways"}


def test_what_a_smooth_system_lacks_is_compiled_once_for_all_of_them(folder):
    simulate(tiny(), x0=[2.0], t_end=1.0)
    assert compiled(folder) == {"derive", "field"}
    lyapunov_spectrum(tiny(), x0=[2.0], average=Average(t_end=1.0))
    assert compiled(folder) == {"derive", "field", "vary", "field_p"}


def test_compiled_code_is_of_the_kernels_that_it_calls(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    outer = (
        "from saltus.system.numba_tools.machine_code import njit\n"
        "import inner_of_two\n\n"
        "inner = inner_of_two.inner\n\n"
        "@njit(cache=True)\n"
        "def outer(x):\n"
        "    return inner(x) + 1.0\n"
    )
    inner = "from saltus.system.numba_tools.machine_code import njit\n\n@njit()\ndef inner(x):\n    return {}*x\n"
    found = []
    for number in (2, 2, 3):
        (tmp_path / "inner_of_two.py").unlink(missing_ok=True)
        module = loaded(tmp_path / "inner_of_two.py", inner.format(f"{number}.0"))
        monkeypatch.setitem(sys.modules, "inner_of_two", module)
        cache_of_digests_emptied()
        function = loaded(tmp_path / "outer.py", outer).outer
        found.append((function(5.0), sum(function.stats.cache_hits.values())))
    assert found == [(11.0, 0), (11.0, 1), (16.0, 0)]


@pytest.mark.parametrize("values", ["2.0", "(2.0, 0.0)", "np.array([2.0, 0.0])"])
def test_compiled_code_is_of_the_numbers_that_it_takes_from_other_modules(tmp_path, monkeypatch, values):
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    outer = (
        "from saltus.system.numba_tools.machine_code import njit\n"
        "import numbers_of_two\n\n"
        "FACTOR = numbers_of_two.FACTOR\n\n"
        "@njit(cache=True)\n"
        "def outer(x):\n"
        f"    return {'FACTOR' if values == '2.0' else 'FACTOR[0]'} * x\n"
    )
    found = []
    for number in ("2.0", "2.0", "3.0"):
        (tmp_path / "numbers_of_two.py").unlink(missing_ok=True)
        text = f"import numpy as np\n\nFACTOR = {values.replace('2.0', number)}\n"
        monkeypatch.setitem(sys.modules, "numbers_of_two", loaded(tmp_path / "numbers_of_two.py", text))
        function = loaded(tmp_path / "outer.py", outer).outer
        found.append((function(5.0), sum(function.stats.cache_hits.values())))
    assert found == [(10.0, 0), (10.0, 1), (15.0, 0)]


def cache_of_digests_emptied():
    from saltus.system.numba_tools import machine_code

    machine_code._digest.cache_clear()


def test_a_cache_in_which_everything_is_damaged_gives_right_numbers(folder):
    assert tiny().field("m", [2.0]) == [-3.0]
    for file in (file for file in folder.rglob("*") if file.is_file()):
        flipped(file)
    forget()
    assert tiny().field("m", [2.0]) == [-3.0]
    forget()
    shutil.rmtree(folder / "__pycache__", ignore_errors=True)
    (folder / "__pycache__").write_text("no folder")
    assert tiny().field("m", [2.0]) == [-3.0]


def test_a_full_disk_is_told_and_the_system_works(folder, monkeypatch):
    def full(file, _):
        raise OSError(errno.ENOSPC, "No space left on device", str(file))

    monkeypatch.setattr(cache, "_unkept", [])
    monkeypatch.setattr(generated, "write_checked", full)
    monkeypatch.setattr(machine_code, "write_checked", full)
    cure = "SALTUS_CACHE_DIR and NUMBA_CACHE_DIR can name other folders"
    with pytest.warns(RuntimeWarning) as told:
        trajectory = simulate(tiny(), {}, [2.0], t_end=1.0)
    assert trajectory.x_end[0] == pytest.approx(2.0 * math.exp(-1.5))
    (warning,) = told  # one, however many files there are
    reason = "No space left on device; each process makes it anew"
    assert str(warning.message) == f"saltus: code is not kept in {folder}: {reason}; {cure}"


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    file = tmp_path / "kept"
    write_checked(file, b"old")

    def failing(*_):
        raise OSError(errno.EIO, "error")

    monkeypatch.setattr(os, "replace", failing)
    with pytest.raises(OSError, match="error"):
        write_checked(file, b"new")
    assert list(tmp_path.iterdir()) == [file]
    assert read_checked(file) == b"old"


@pytest.mark.campaign
def test_six_processes_compile_one_system_at_the_same_time(folder):
    running = [
        subprocess.Popen([sys.executable, "-c", TINY], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for _ in range(6)
    ]
    ends = [process.communicate() for process in running]
    assert [(process.returncode, *end) for process, end in zip(running, ends, strict=True)] == [(0, "-3.0\n", "")] * 6
    assert not list(folder.rglob("*.tmp"))


def test_a_chosen_cache_folder_that_cannot_be_made_is_told(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("SALTUS_CACHE_DIR", str(tmp_path / "file" / "below"))
    with pytest.raises(InputError, match="SALTUS_CACHE_DIR = '.*below': must be a folder that can be made and written"):
        cache.cache_folder()


@pytest.mark.parametrize("mode", [0o777, 0o770])
def test_a_chosen_cache_folder_that_others_can_write_is_told(mode, monkeypatch, tmp_path):
    tmp_path.chmod(mode)
    monkeypatch.setenv("SALTUS_CACHE_DIR", str(tmp_path))
    with pytest.raises(InputError, match="and that nobody else can write; others own or can write"):
        cache.cache_folder()


def test_a_new_cache_folder_is_private_whatever_the_mask(monkeypatch, tmp_path):
    monkeypatch.setenv("SALTUS_CACHE_DIR", str(tmp_path / "new" / "cache"))
    mask = os.umask(0)
    try:
        assert stat.S_IMODE(cache.cache_folder().stat().st_mode) == 0o700
    finally:
        os.umask(mask)


@pytest.fixture
def temporary(monkeypatch, tmp_path):
    """No chosen cache folder, and an empty folder for temporary ones, which is returned."""
    (tmp_path / "tmp").mkdir()
    monkeypatch.delenv("SALTUS_CACHE_DIR", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    cache._temporary_folder.cache_clear()
    cache.warn_once.cache_clear()
    yield tmp_path / "tmp"
    cache._temporary_folder.cache_clear()


@pytest.fixture
def no_user_cache(monkeypatch, temporary):
    """No usual cache folder either."""
    (temporary.parent / "file").write_text("")
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda *_, **__: str(temporary.parent / "file" / "below"))
    return temporary


def test_the_temporary_cache_folder_is_private_found_again_and_told_once(no_user_cache):
    with pytest.warns(RuntimeWarning, match="generated code is kept in .*: .*exists.*; SALTUS_CACHE_DIR can"):
        folder = cache.cache_folder()
    assert folder.parent == no_user_cache
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    cache._temporary_folder.cache_clear()
    assert cache.cache_folder() == folder


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="only where users have numbers has the folder a known name")
@pytest.mark.parametrize("kind", ["open to all", "a link", "a file"])
def test_a_temporary_cache_folder_that_others_can_write_is_not_used(kind, no_user_cache):
    known = no_user_cache / f"saltus-{os.getuid()}"
    if kind == "a file":
        known.write_text("")
    elif kind == "a link":
        (no_user_cache / "elsewhere").mkdir(mode=0o700)
        known.symlink_to(no_user_cache / "elsewhere")
    else:
        known.mkdir()
        known.chmod(0o777)
    with pytest.warns(RuntimeWarning, match="generated code is kept in"):
        folder = cache.cache_folder()
    assert folder.name not in (known.name, "elsewhere")
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_a_users_cache_folder_that_others_can_write_is_not_used(temporary, monkeypatch, tmp_path):
    (tmp_path / "usual").mkdir()
    (tmp_path / "usual").chmod(0o775)
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda *_, **__: str(tmp_path / "usual"))
    with pytest.warns(RuntimeWarning, match=r"others own or can write .*usual \(chmod go-w"):
        assert cache.cache_folder().parent == temporary


@pytest.mark.parametrize("path", ["below/here", "~/.cache/saltus"])
def test_a_users_cache_folder_without_an_absolute_path_is_not_used(path, temporary, monkeypatch):
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda *_, **__: path)
    with pytest.warns(RuntimeWarning, match="there is no absolute path to a home folder"):
        assert cache.cache_folder().parent == temporary
    assert not Path(path).exists()


def test_numba_gets_a_folder_where_no_other_can_be_written(monkeypatch, tmp_path):
    monkeypatch.setenv("SALTUS_CACHE_DIR", str(tmp_path))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    let_numba_cache()
    assert "NUMBA_CACHE_DIR" not in os.environ
    allowed = os.access
    monkeypatch.setattr(os, "access", lambda path, how: str(path).startswith(str(tmp_path)) and allowed(path, how))
    let_numba_cache()
    assert os.environ["NUMBA_CACHE_DIR"] == str(tmp_path / "numba")
    monkeypatch.delenv("NUMBA_CACHE_DIR")


def test_a_chosen_folder_of_numba_is_kept(monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/chosen")
    let_numba_cache()
    assert os.environ["NUMBA_CACHE_DIR"] == "/chosen"


def test_every_kernel_of_the_package_keeps_its_code_in_checked_files():
    package = Path(cache.__file__).parents[1]
    unchecked = re.compile(r"from numba import .*\b(njit|cfunc)\b|numba\.njit")
    files = [file for file in sorted(package.rglob("*.py")) if unchecked.search(file.read_text(encoding="utf-8"))]
    assert [file.name for file in files] == ["machine_code.py"]
