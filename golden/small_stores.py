"""A store of basins and a session of the explorer, small enough to be kept for each version.

PYTHONPATH=src:tests python golden/small_stores.py ARCHIVE

writes those of this version. `tests/test_golden.py` opens those of older versions.
"""

from __future__ import annotations

import sys
import tempfile
import zipfile
from pathlib import Path

from discrete import tent_of
from saltus import find_attractors, map_basins
from saltus.explorer.session import Session, new_folder
from saltus.explorer.steps import Continue, FindOrbit, Place
from saltus.explorer.subjects import of_system
from saltus.options import AttractorOptions
from systems import ball_on_table

STORE = "plane.zarr"
SESSION = "session.nc"
STEPS = {
    "orbit1": FindOrbit(parameters={"a": 1.2}, x0=(0.6, 3.1, 0.5)),
    "branch1": Continue(place=Place(of="orbit1"), parameter="a", bounds=(0.9, 1.8)),
}
"""What was done in the session."""


def write_store(path: Path) -> None:
    """Map basins of a tent map at 12 cells into a store."""
    tent, region = tent_of(), {"x": (-0.2, 1.2)}
    found = find_attractors(tent, {"a": 1.7}, region, options=AttractorOptions(starts=16, samples=100))
    map_basins(tent, {"a": 1.7}, {"x": (-0.2, 1.2, 12)}, found, path=path)


def write_session(path: Path) -> None:
    """Take the steps of the session, and pack it."""
    made = Session(of_system(ball_on_table()), new_folder(path.parent / "sessions"))
    for step in STEPS.values():
        made.add(step, step.run(made.system, made.results, False))
    made.packed(path)


def main() -> None:
    """Write the archive."""
    with tempfile.TemporaryDirectory() as folder, zipfile.ZipFile(sys.argv[1], "w", zipfile.ZIP_DEFLATED) as archive:
        home = Path(folder)
        write_store(home / STORE)
        write_session(home / SESSION)
        for path in [home / SESSION, *sorted((home / STORE).rglob("*"))]:
            if path.is_file():
                archive.write(path, path.relative_to(home))


if __name__ == "__main__":
    main()
