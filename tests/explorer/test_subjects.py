"""Systems that are explored: one at hand, one in a file or a module; each has Python that makes it again."""

import pytest

import known_maps
import saltus
from saltus.errors import InputError
from saltus.explorer.subjects import definition_of, of_file, of_system, system_of
from systems import ball_on_table

SWINGS = """
import saltus
pendulum = saltus.HybridSystem.smooth({"x": "v", "v": "-sin(x)"})
class Shelf:
    inner = pendulum
other = 3
"""


@pytest.fixture
def folder(tmp_path):
    """Return a folder with a file of systems, whose module has another name in each test."""
    (tmp_path / f"{tmp_path.name}.py").write_text(SWINGS)
    return tmp_path


def again(subject) -> saltus.HybridSystem:
    """Return the system that the Python of a subject makes."""
    told: dict = {}
    exec("\n".join(subject.lines), told)
    return told["system"]


def test_a_system_at_hand_is_made_again_by_its_python(ball_on_table):
    subject = of_system(ball_on_table)
    assert (subject.key, subject.x0, subject.ranges) == ("ball on a table", (), {})
    assert again(subject).definition() == ball_on_table.definition() == subject.system.definition()


def test_a_system_without_a_name_has_a_key():
    swing = saltus.HybridSystem.smooth({"x": "v", "v": "-x"})
    assert of_system(swing).key == "system"
    assert of_system(swing, "swing").key == "swing"


def test_a_system_is_read_once_from_its_definition():
    text = definition_of(ball_on_table())
    assert system_of(text) is system_of(text)


@pytest.mark.parametrize("wrong", [3, None, "pendulum"])
def test_what_is_no_system_is_refused(wrong):
    with pytest.raises(InputError, match="must be a HybridSystem or a Map"):
        of_system(wrong)


@pytest.mark.parametrize("made", [known_maps.logistic, known_maps.tent])
def test_a_map_is_made_again_by_its_python_and_does_not_start_at_zero(made):
    subject = of_system(made())
    assert again(subject) == made() == subject.system
    assert subject.start == (0.1,)


def test_a_system_in_a_file_is_made_again_by_its_python(folder):
    subject = of_file(f"{folder.name}.py:pendulum", folder)
    assert subject.key == f"{folder / folder.name}.py:pendulum"
    assert again(subject).definition() == subject.system.definition()


def test_a_system_in_a_module_or_in_a_class_is_found(folder):
    module = of_file(f"{folder.name}:pendulum", folder)
    inner = of_file(f"{folder.name}:Shelf.inner", folder)
    assert module.definition == inner.definition
    assert module.key == f"{folder.name}:pendulum"
    assert again(inner).definition() == module.system.definition()


@pytest.mark.parametrize(
    ("reference", "told"),
    [
        ("{}.py", r"FILE.py:NAME or MODULE:NAME; .*:oscillator, where the file has oscillator = "),
        (":pendulum", "FILE.py:NAME or MODULE:NAME"),
        ("nowhere.py:pendulum", "a file that exists"),
        ("{}.py:pendulun", "pendulum"),
        ("{}.py:other", "a HybridSystem or a Map; other is of type int"),
    ],
)
def test_a_reference_that_leads_nowhere_is_told(folder, reference, told):
    with pytest.raises(InputError, match=told):
        of_file(reference.format(folder.name), folder)
