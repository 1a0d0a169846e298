"""Settings that are declared once, and what derives from them."""

from inspect import signature

import pytest

import islands
from islands.facade.fit_settings import FitSettings
from islands.settings_schema import list_settings
from support.searches import record


@pytest.mark.parametrize(
    ("function", "cls"), [(islands.fit, FitSettings), (islands.identify, islands.Settings)]
)
def test_the_signature_and_the_docstring_of_a_function_list_each_setting(function, cls):
    for name, info, values in list_settings(cls):
        assert name in signature(function).parameters
        assert f"    {name} : {values}\n        {info.description}" in function.__doc__


@pytest.mark.parametrize("function", [islands.fit, islands.identify])
def test_a_misspelt_setting_is_an_error_that_suggests_the_right_one(function):
    with pytest.raises(islands.SettingsError, match=r"'max_term'.*max_terms"):
        function(record(), max_term=3)
