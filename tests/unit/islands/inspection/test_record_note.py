"""`find_advice`: the options that a text names are those that its writer named."""

import pytest

from islands.errors import command_line_names, name_option
from islands.inspection.record_note import AdvisedOption, find_advice, make_note

OPTIONS = [
    ("gaps", "split"),
    ("gaps", "interpolate"),
    ("outliers", "keep"),
    ("rates", "sample"),
    ("decimal", "comma"),
    ("dates", "day-first"),
    ("resample", 0.01),
    ("resample", 1e-06),
    ("dt", 12.5),
    ("missing", "Failed"),
    ("missing", "no value"),
    ("time_unit", "ms"),
]


@pytest.mark.parametrize(("option", "value"), OPTIONS)
@pytest.mark.parametrize("end", [" to do so", ", or leave the rows out", ". Otherwise nothing", ""])
def test_an_option_is_read_as_it_was_written(option, value, end):
    assert find_advice(f"give {name_option(option, value)}{end}") == (AdvisedOption(option, value),)
    with command_line_names():
        assert find_advice(f"give {name_option(option, value)}{end}") == (AdvisedOption(option, value),)


@pytest.mark.parametrize(
    ("option", "value"), [("time", None), ("resample", "DT"), ("dt", "DT"), ("timezone", "Europe/Berlin")]
)
def test_a_value_that_only_the_user_knows_is_none(option, value):
    text = f"name it by {name_option(option, value)}, or not"
    assert find_advice(text) == (AdvisedOption(option, None),)
    with command_line_names():
        text = f"name it by {name_option(option, value)}, or not"
    assert find_advice(text) == (AdvisedOption(option, None),)


def test_options_have_the_order_of_the_text_and_occur_once():
    text = (
        f"give {name_option('gaps', 'split')} or {name_option('dt', 1.0)} or {name_option('gaps', 'split')}"
    )
    assert [each.option for each in find_advice(text)] == ["gaps", "dt"]


@pytest.mark.parametrize("text", ["the time=stamps of u", "widths and gaps of 3 rows", "a--gaps", "x_dt=3"])
def test_a_text_without_options_has_no_advice(text):
    assert [each for each in find_advice(text) if each.value is not None] == []


def test_a_note_lists_a_limited_number_of_rows():
    assert make_note("many", rows=range(1000)).rows == tuple(range(20))
