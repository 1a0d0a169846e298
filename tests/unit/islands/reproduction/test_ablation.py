"""Ablation: the sentences and cells of its table follow from the errors of the searches."""

from math import inf

import pytest

from islands.evolution.presets import resolve_settings
from islands.reproduction.ablation import (
    LITERAL,
    SWITCHES,
    compare_errors,
    describe_range,
    median,
    selected_error,
    tabulate_ablation,
)


def search(error, size=9, converging=40):
    selected = {"size": size, "errors": {"validation_100s": {"mape": error}}}
    hall = {"models": 40, "converging": converging}
    return {"selected": None if error is None else selected, "hall": hall}


@pytest.mark.parametrize(
    ("errors", "sentence"),
    [
        ([0.1] * 10, "smaller error with 10, larger with 0 of 10 seeds: a significant difference"),
        ([0.1] * 5 + [0.3] * 5, "smaller error with 5, larger with 5 of 10 seeds: no significant difference"),
        ([0.1] * 5, "smaller error with 5, larger with 0 of 5 seeds: too few seeds for a sign test"),
        ([0.2] * 10, "smaller error with 0, larger with 0 of 10 seeds: no effect on these seeds"),
    ],
)
def test_a_difference_is_claimed_only_if_a_sign_test_supports_it(errors, sentence):
    assert compare_errors(errors, [0.2] * len(errors)).startswith(sentence)


def test_a_row_has_the_median_the_worst_and_the_share_of_its_searches():
    found = {LITERAL: [search(0.2), search(0.3)], "no-root-rule": [search(0.1, 6, 20), search(None, 0, 30)]}
    table = tabulate_ablation(found, "")
    assert table.rows[0][1:5] == ("0.250", "0.300", "9", "100 %")
    assert table.rows[1][1:5] == ("inf", "inf", "6", "62 %")


def test_fewer_seeds_are_compared_with_the_same_seeds_of_the_literal_search():
    table = tabulate_ablation({LITERAL: [search(0.2), search(0.1)], "tournament-3": [search(0.2)]}, "")
    assert "no effect on these seeds" in table.rows[1][-1]


@pytest.mark.parametrize(("values", "middle"), [([3.0], 3.0), ([1.0, 2.0], 1.5), ([1.0, inf, inf], inf)])
def test_median_is_that_of_the_ordered_values(values, middle):
    assert median(values) == middle


@pytest.mark.parametrize(("sizes", "text"), [([], "-"), ([7], "7"), ([9, 6, 7], "6 to 9")])
def test_range_of_sizes_names_its_ends(sizes, text):
    assert describe_range(sizes) == text


def test_a_search_without_a_model_has_an_infinite_error():
    assert selected_error(search(None)) == inf


@pytest.mark.parametrize("name", [name for name in SWITCHES if name != LITERAL])
def test_a_switch_changes_one_thing_of_the_literal_search(name):
    switch = SWITCHES[name]
    changed = resolve_settings("paper-case1", switch.changes) != resolve_settings("paper-case1", {})
    assert len(switch.changes) + (not switch.root_rule) == 1
    assert changed is switch.root_rule
