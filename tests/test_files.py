"""Files are written whole or not at all."""

from __future__ import annotations

import errno
import os
import signal
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from saltus import load
from saltus.basins.map.basins import Basins
from saltus.errors import InputError
from saltus.files import checked_seal, whole_file, write_sealed
from saltus.work import interrupt_waits

posix = pytest.mark.skipif(os.name == "nt", reason="of POSIX")


def _basins(labels=(0, 1, 1, 0)):
    return Basins.from_array(np.array(labels), {"x": np.arange(4.0)}, {"a": 0, "b": 1})


@contextmanager
def files_of_at_most(count):
    """The system refuses longer files: a disk that is full in the midst of one."""
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (count, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@posix
def test_a_save_for_which_there_is_no_room_leaves_the_old_file_and_nothing_else(tmp_path):
    old = _basins()
    path = old.save(tmp_path / "a.nc")
    with (
        files_of_at_most(1000),
        pytest.raises(InputError, match=r"a.nc': must be on a disk with room for it; File too"),
    ):
        _basins((1, 1, 1, 1)).save(path)
    assert load(path) == old
    assert [file.name for file in tmp_path.iterdir()] == ["a.nc"]


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_a_full_disk_is_told_in_a_line_whenever_it_shows(tmp_path, monkeypatch, step):
    path = _basins().save(tmp_path / "a.nc")

    def refuse(*args):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(os, step, refuse)
        with pytest.raises(InputError) as told:
            _basins((1, 1, 1, 1)).save(path)
    assert str(told.value) == f"path = {str(path)!r}: must be on a disk with room for it; No space left on device"
    assert load(path) == _basins()
    assert [file.name for file in tmp_path.iterdir()] == ["a.nc"]


def test_an_error_or_an_interrupt_in_the_midst_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def write(error):
        with whole_file(path) as draft:
            draft.write_text("new")
            raise error

    for error in (RuntimeError, KeyboardInterrupt, SystemExit):
        with pytest.raises(error):
            write(error)
        assert path.read_text() == "old"
        assert list(tmp_path.iterdir()) == [path]


@posix
def test_a_file_keeps_its_permissions_and_a_link_leads_on(tmp_path):
    kept, link = tmp_path / "kept.txt", tmp_path / "link.txt"
    kept.write_text("old")
    kept.chmod(0o640)
    link.symlink_to(kept)
    with whole_file(link) as draft:
        assert draft.suffix == ".txt"
        draft.write_text("new")
    assert link.is_symlink()
    assert kept.read_text() == "new"
    assert kept.stat().st_mode & 0o777 == 0o640


def test_a_name_as_long_as_names_may_be_is_written(tmp_path):
    path = tmp_path / ("é" * 125 + ".txt")
    with whole_file(path) as draft:
        draft.write_text("new")
    assert path.read_text() == "new"


@posix
@pytest.mark.parametrize("place", ["/dev/null", "/dev/full"])
def test_a_device_is_no_place_for_a_file(place):
    with pytest.raises(InputError, match=f"path = '{place}': must be a regular file; it is a device or a pipe"):
        _basins().save(place)
    assert Path(place).is_char_device()


def test_places_that_cannot_be_written_are_told(tmp_path, monkeypatch):
    (tmp_path / "folder.nc").mkdir()
    with pytest.raises(InputError, match="must be a file; it is a folder"):
        _basins().save(tmp_path / "folder.nc")
    with pytest.raises(InputError, match="must be in a folder that exists"):
        _basins().save(tmp_path / "missing" / "a.nc")
    (tmp_path / "a.txt").write_text("")
    with pytest.raises(InputError, match="must be in a folder that exists"):
        _basins().save(tmp_path / "a.txt" / "a.nc")
    with pytest.raises(InputError, match="is longer than 255 bytes|a file that can be written; "):
        _basins().save(tmp_path / ("n" * 300 + ".nc"))
    path = _basins().save(tmp_path / "b.nc")
    monkeypatch.setattr(os, "access", lambda *args: False)  # as for one who is not root, of a file that is read-only
    with pytest.raises(InputError, match="must be a file that can be written; Permission denied"):
        _basins().save(path)


@pytest.mark.parametrize("value", [b"a.nc", 3, None, "", "a\0.nc", ["a.nc"]])
def test_what_is_no_path_is_told(value):
    for call in (load, Basins.load, Basins.open, _basins().save):
        with pytest.raises(InputError, match=r"path = .*: must be the path of a f"):
            call(value)


def test_relative_paths_are_those_of_the_working_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _basins().save("a.nc")
    _basins().save("a.zarr")
    assert load("a.nc") == load("a.zarr") == load(tmp_path / "a.nc")


@posix
def test_an_interrupt_waits_for_the_end_of_a_block_and_is_not_lost():
    after = []

    def work():
        with interrupt_waits():
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)
            after.append(1)

    with pytest.raises(KeyboardInterrupt):
        work()
    assert after == [1]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_other_threads_have_no_interrupt_to_wait_for():
    found = []

    def work():
        with interrupt_waits():
            found.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert found == [signal.default_int_handler]


def test_whatever_byte_is_changed_it_is_seen(tmp_path):
    path = tmp_path / "a"
    content = bytes(range(256)) * 2
    write_sealed(path, memoryview(content))
    whole = path.read_bytes()
    assert whole.startswith(content)
    assert checked_seal(path)
    for place in range(0, len(content), 7):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 4]) + whole[place + 1 :])
        with pytest.raises(InputError, match="it is damaged: its content is not what was written"):
            checked_seal(path)
    path.write_bytes(content)
    assert not checked_seal(path)
