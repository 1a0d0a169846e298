"""Values of options of the command line."""

import pytest

from islands.cli.options import columns


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
