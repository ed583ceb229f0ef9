"""Unknowns of a measurement: values without effect, and those among the varied names."""

from saltus.fitting.instrument import Instrument

WHOLE = Instrument("offset", "gain", ("R",), "drift", {"k": 2.0})


def test_values_that_are_not_given_have_no_effect():
    for one in (WHOLE, Instrument()):
        assert (one.moved_by, one.drifted_by, one.factor("R"), one.factor("phase")) == (0.0, 0.0, 1.0, 1.0)


def test_a_gain_multiplies_only_its_columns():
    one = Instrument("offset", "gain", ("R",), "drift", {}, {"offset": 0.5, "gain": 1.2, "drift": 3.0})
    assert (one.moved_by, one.drifted_by, one.factor("R"), one.factor("phase")) == (0.5, 3.0, 1.2, 1.0)


def test_only_varied_unknowns_are_unknown():
    one = WHOLE.among({"gain": (0.5, 2.0), "k": (0.1, 1.0)})
    assert one.names == ("gain",)
    assert one.of_model(("k", "gain")) == ("k",)
