"""Values of options of the command line."""

import pytest

from islands.cli.options import columns, require_inputs
from islands.errors import SettingsError


@pytest.mark.parametrize(
    ("texts", "names"),
    [
        (["a,b", "c"], ["a", "b", "c"]),
        (["Напряжение, В"], ["Напряжение, В"]),
        (["a,Voltage, V,b"], ["a", "Voltage, V", "b"]),
        (['"drive,left"'], ["drive,left"]),
        (["a,", '"'], ["a", '"']),
    ],
)
def test_a_comma_separates_names_unless_a_blank_follows_or_quotes_enclose_it(texts, names):
    assert columns(texts) == names


def test_a_record_without_an_input_is_refused_with_what_to_record():
    assert require_inputs(["u"]) == ["u"]
    for nothing in ([], None):
        with pytest.raises(SettingsError, match=r"a free decay .* record the force, voltage or set point"):
            require_inputs(nothing)
