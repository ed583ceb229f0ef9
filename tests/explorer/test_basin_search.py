"""Basins over a plane come after a search, coarsely then finely."""

from saltus.explorer.basin_search import Search, map_plane
from saltus.explorer.steps import Attract, Basin

REGION = {"z": (0.0, 2.0), "v": (-1.0, 4.0)}


class Paper:
    """A desk that writes down what is wanted."""

    def __init__(self, session) -> None:
        self.session = session
        self.wanted: list[tuple] = []

    def run(self, step, done=None, replaces="") -> None:
        """Write it down."""
        self.wanted.append((step, done, replaces))


def test_basins_are_mapped_after_a_search_coarsely_then_finely(session):
    desk, search = Paper(session), Search(dict(session.results["orbit1"].parameters), REGION)
    map_plane(desk, search, REGION, {}, (50, 200))
    ((step, found, _),) = desk.wanted
    assert isinstance(step, Attract)
    assert step.parameters == {"a": 1.2}  # as far as they are not the system's
    assert step.region == REGION
    found(session.add(step, session.results["orbit1"]))
    coarse, then, replaces = desk.wanted[-1]
    assert (coarse.grid, coarse.attractors, replaces) == (
        {"z": (0.0, 2.0, 50), "v": (-1.0, 4.0, 50)}, "attractors1", "",
    )  # fmt: skip
    then(session.add(coarse, session.results["orbit1"]))
    fine, last, replaces = desk.wanted[-1]
    assert (fine.grid["z"], replaces) == ((0.0, 2.0, 200), "basins1")
    last(session.entry("basins1"))
    assert len(desk.wanted) == 3
    map_plane(desk, search, REGION, {}, (50, 200))
    assert isinstance(desk.wanted[-1][0], Basin)  # attractors of this region are known
