"""Coupled models: equations that belong together."""

from dataclasses import replace

import pytest

from islands.errors import ModelError
from islands.models.coupled_narx import CoupledModel
from support.coupled_systems import TWO_MASSES, equation

ONE, TWO = TWO_MASSES.models
TERMS = {"y(k-1)": 0.5}


def test_channels_are_the_outputs_and_then_the_inputs() -> None:
    three = CoupledModel(
        tuple(
            equation(TERMS, ("u", "v", *(other for other in "abc" if other != name)), name) for name in "abc"
        )
    )
    assert [three.channels(place) for place in range(3)] == [
        (0, 3, 4, 1, 2),
        (1, 3, 4, 0, 2),
        (2, 3, 4, 0, 1),
    ]


@pytest.mark.parametrize(
    ("models", "message"),
    [
        ((ONE,), "at least two equations"),
        ((ONE, ONE), "same output: y1, y1"),
        ((ONE, replace(TWO, input_names=("v", "y1"))), "expected are inputs and then the other outputs"),
        ((ONE, replace(TWO, input_names=("u", "y1+1"))), "the equation of y2 has the inputs"),
        ((replace(ONE, input_names=("u", "z")), TWO), "the equation of y1 has the inputs"),
        ((ONE, replace(TWO, dt=0.2)), "different sampling times"),
        ((ONE, replace(TWO, average=2)), "different sampling times"),
    ],
)
def test_equations_that_do_not_belong_together_are_refused(models, message) -> None:
    with pytest.raises(ModelError, match=message):
        CoupledModel(models)
