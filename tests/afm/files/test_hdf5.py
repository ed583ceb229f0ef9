"""Files of HDF5 whose texts tell more bytes than the file has are refused before room is made for them."""

import subprocess
import sys

import h5py
import numpy as np
import pytest

from saltus import InputError, afm

TEXT = "a text of an attribute, of 40 characters"
READING = """
import resource, sys
import h5py
from saltus import InputError, afm
afm.instrument_file(sys.argv[1])
size = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (size + 2**27, size + 2**27))
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
for path in sys.argv[2:]:
    try:
        afm.instrument_file(path)
    except InputError as error:
        print(error)
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < 2**25)
"""


def _written(path, libver, more):
    """A curve whose attribute is a text of 40 bytes, beside others; many attributes lie in a heap of their own."""
    with h5py.File(path, "w", libver=libver) as file:
        file["height"] = np.linspace(0.0, 5e-8, 6)
        file["height"].attrs["unit"] = "m"
        file.attrs.update({f"other {k}": "abc" for k in range(more)})
        file.attrs["names"] = ["one", "three", ""]
        file.attrs["told"] = TEXT
    return path


def _flipped(path, bit):
    """Return a copy whose text of 40 bytes tells far more: its length stands before the address of its heap."""
    content = path.read_bytes()
    heap = content.find(b"GCOL").to_bytes(8, "little")
    place = content.find(len(TEXT).to_bytes(4, "little") + heap)
    assert place > 0
    changed = bytearray(content)
    changed[place + 3] ^= 1 << bit
    other = path.with_stem(f"{path.stem}_{bit}")
    other.write_bytes(changed)
    return other


@pytest.mark.parametrize("libver", ["earliest", "latest"])
@pytest.mark.parametrize("more", [0, 20])
def test_a_text_longer_than_its_file_is_refused(tmp_path, libver, more):
    path = _written(tmp_path / "c.h5", libver, more)
    assert afm.instrument_file(path).constants["told"] == TEXT
    with pytest.raises(InputError, match=r"an attribute tells a text of 16,777,256 bytes, and the file has \d"):
        afm.instrument_file(_flipped(path, 0))


@pytest.mark.skipif(sys.platform != "linux", reason="the size of a process is read from /proc")
def test_a_text_of_gigabytes_takes_no_memory(tmp_path):
    path = _written(tmp_path / "c.h5", "earliest", 0)
    files = [path, *(_flipped(path, bit) for bit in (3, 5, 7))]
    done = subprocess.run([sys.executable, "-c", READING, *map(str, files)], capture_output=True, text=True, check=True)
    *told, bounded = done.stdout.splitlines()
    assert [line.split("a text of ")[1].split(" bytes")[0] for line in told] == [
        f"{len(TEXT) + 2 ** (24 + bit):,}" for bit in (3, 5, 7)
    ]
    assert bounded == "True"
