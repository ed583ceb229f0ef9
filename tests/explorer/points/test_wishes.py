"""What the page's script asks for."""

from html import unescape

from saltus.explorer.look import figure_of
from saltus.explorer.points.wishes import Wishes, wish


def test_what_is_asked_for_is_done_and_what_nobody_knows_is_left_out():
    done = []
    wishes = Wishes(figure_of("some"))
    wishes.on("step", lambda count, special: done.append((count, special)))
    wishes.source.data = {"wish": ['["step", 2, true]'], "at": [1]}
    wishes.source.data = {"wish": ['["unknown", 1]'], "at": [2]}
    wishes.source.data = {"wish": ['["step", 2, true]'], "at": [3]}
    assert done == [(2, True), (2, True)]


def test_an_attribute_holds_any_name():
    told = wish("take", 'a"b', "<c>")
    assert "<" not in told
    assert unescape(told) == """data-wish="["take", "a\\"b", "<c>"]\""""


def test_an_answer_travels_to_the_page():
    wishes = Wishes(figure_of("some"))
    wishes.answer("leave 3")
    assert wishes.source.tags == ["leave 3"]
