"""Defaults that are remembered are those that Bokeh makes, and mutable ones are shared by no two models."""

import re

import bokeh.models
import pytest
from bokeh.core.property.descriptors import PropertyDescriptor
from bokeh.plotting import figure

from saltus.explorer.figures.defaults import remember_defaults


@pytest.fixture
def made_anew():
    """Return how Bokeh makes a default, which it does again after the test."""
    plain = PropertyDescriptor._get_default
    yield plain
    PropertyDescriptor._get_default = plain


def all_properties(model):
    """Return the descriptors of the properties of a model that have their default."""
    unset = sorted(model.properties() - {*model._property_values})
    return [model.lookup(name) for name in unset if type(model.lookup(name)) is PropertyDescriptor]


def told(defaults):
    """Return defaults as texts without the numbers of models, which are others each time."""
    return [re.sub(r"id='\w+'", "id", repr(default)) for default in defaults]


def test_defaults_are_those_of_bokeh_at_the_first_look_and_at_the_second(made_anew):
    models = [
        make() for make in (figure, bokeh.models.Toolbar, bokeh.models.Label, bokeh.models.Div, bokeh.models.Slider)
    ]
    wanted = [told(made_anew(one, model) for one in all_properties(model)) for model in models]
    remember_defaults()
    assert PropertyDescriptor._get_default is not made_anew
    for _ in range(2):
        assert [told(one._get_default(model) for one in all_properties(model)) for model in models] == wanted


def test_a_theme_counts_and_lists_are_each_models_own(made_anew):
    remember_defaults()
    first, second = bokeh.models.Label(), bokeh.models.Label()
    assert first.text_font_size == second.text_font_size
    first.apply_theme({"text_font_size": "33px"})
    assert (first.text_font_size, second.text_font_size) == ("33px", "16px")
    first.tags.append("own")
    assert second.tags == []


def test_asked_twice_it_is_done_once(made_anew):
    remember_defaults()
    once = PropertyDescriptor._get_default
    remember_defaults()
    assert PropertyDescriptor._get_default is once
