import numpy as np
import pytest

from islands.inspection.column_roles import choose_columns, find_role
from support.known_records import delay, lag, steps, white


def make(name="a", other="b", noise=0.05, seed=0):
    u = steps(3000, seed, 10)
    y = delay(lag(u, 5.0), 2)
    return {name: u, other: y + noise * y.std() * white(3000, [seed, 5])}


@pytest.mark.parametrize(
    ("name", "role"),
    [
        *[("u_V", "input"), ("u1", "input"), ("pump/V", "input"), ("run.u", "input")],
        *[("y [um]", "output"), ("level_cm", "output"), ("Temperature (degC)", "output")],
        *[("channel_3", ""), ("k", "")],
    ],
)
def test_names_suggest_roles(name, role):
    assert find_role(name)[0] == role


def test_sure_names_decide():
    choice = choose_columns(make("y", "u"))
    assert choice.inputs == ("u",)
    assert choice.output == "y"


def test_cause_predicts_effect():
    for seed in range(5):
        for swapped in (False, True):
            columns = make(seed=seed)
            if swapped:
                columns = dict(reversed(columns.items()))
            choice = choose_columns(columns)
            assert (choice.inputs, choice.output) == (("a",), "b")
            assert choice.confidence < 0.7
            assert "predicts" in choice.reason


def test_names_with_prediction_are_surer_than_names_against_it():
    assert choose_columns(make("u", "y")).confidence > choose_columns(make("y", "u")).confidence


def test_every_named_input_that_predicts_is_chosen():
    u, v = white(3000, 0), white(3000, 1)
    columns = {"u1": u, "u2": v, "u3": white(3000, 2), "y": lag(u, 3.0) + lag(v, 3.0)}
    assert choose_columns(columns).inputs == ("u1", "u2")


def test_counters_and_parts_of_a_file_are_no_signals():
    columns = {"k": np.arange(3000.0), "test": np.repeat(np.arange(3.0), 1000), **make()}
    choice = choose_columns(columns)
    assert (choice.inputs, choice.output) == (("a",), "b")


def test_the_choice_of_the_user_stays():
    columns = make()
    assert choose_columns(columns, ("b",), "a").inputs == ("b",)
    assert choose_columns(columns, ("b",)).output == "a"
    assert choose_columns(columns, (), "a").inputs == ("b",)


def test_one_signal_is_not_enough():
    choice = choose_columns({"k": np.arange(100.0), "y": white(100, 0)})
    assert choice.output == ""
