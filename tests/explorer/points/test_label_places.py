"""Labels beside marks: within the frame, none upon another."""

import numpy as np

from saltus.explorer.points.label_places import Beside, places_beside

SIZE = (400.0, 300.0)


def boxes(marks, labels, places) -> list[tuple[float, ...]]:
    """Return left, right, top and bottom of labels of letters 6 pixels wide and 12 pixels high."""
    found = []
    for (x, y), label, beside in zip(marks, labels, places, strict=True):
        left = x + beside.aside - (6.0 * len(label) if beside.align == "right" else 0.0)
        found.append((left, left + 6.0 * len(label), y + beside.below - 12.0, y + beside.below))
    return found


def test_a_label_alone_stands_at_the_right_above_its_mark():
    assert places_beside([(100.0, 100.0)], ["SN1"], SIZE) == [Beside("left", 8.0, -4.0)]


def test_labels_stay_within_the_frame_and_apart():
    rng = np.random.default_rng(11)
    for _ in range(50):
        marks = [(float(x), float(y)) for x, y in rng.uniform((40.0, 60.0), (360.0, 240.0), (6, 2))]
        labels = [["SN1", "branch2 PD1", "branch1 SN1 + 11"][i % 3] for i in range(6)]
        drawn = boxes(marks, labels, places_beside(marks, labels, SIZE))
        for i, one in enumerate(drawn):
            assert one[0] >= 0.0
            assert one[1] <= SIZE[0]
            assert one[2] >= 0.0
            for other in drawn[:i]:
                apart = one[0] >= other[1] or other[0] >= one[1] or one[2] >= other[3] or other[2] >= one[3]
                assert apart, (marks, labels)


def test_where_there_is_no_room_a_label_stands_nevertheless():
    places = places_beside([(50.0, 20.0)] * 30, ["a long label of a mark"] * 30, (100.0, 40.0))
    assert len(places) == 30


def test_empty_labels_take_no_room():
    assert places_beside([(50.0, 50.0)] * 2, ["", "SN1"], SIZE)[1] == Beside("left", 8.0, -4.0)


def test_a_label_without_a_free_place_says_so():
    found = places_beside([(300.0, 200.0)] * 20, ["SN1"] * 20, (600.0, 400.0))
    free = [place for place in found if place.free]
    assert 1 < len(free) < 20
    assert len({*free}) == len(free)
