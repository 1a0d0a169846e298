"""Choice of the variables of an FMU by name."""

from pathlib import Path
from typing import Any

import pytest

from islands.errors import SettingsError
from islands.simulators.fmu.fmi_description import FmiDescription, FmiInterface, FmiVariable
from islands.simulators.fmu.model import MAX_DEFAULT_PARAMETERS, FmuParameterChoice, choose_variables

# The library of FMUs is imported, which takes seconds.
pytestmark = pytest.mark.ci


def describe(**changes: Any) -> FmiDescription:
    given: dict[str, Any] = {
        "path": str(Path("folder", "axis.fmu")),
        "digest": "",
        "version": 3,
        "interface": FmiInterface.CO_SIMULATION,
        "inputs": (FmiVariable("u", 1),),
        "outputs": (FmiVariable("x", 2),),
        "parameters": (FmiVariable("mass", 3, "kg", 2.0), FmiVariable("damping", 4, "", 0.5, lower=0.1)),
        "states": (FmiVariable("x", 2, "m", 0.0), FmiVariable("v", 5, "m/s", 0.0)),
        "settable": ("v",),
        "fixed_step": None,
        "has_variable_step": True,
        "indicators": 0,
        "completes": False,
    }
    return FmiDescription(**{**given, **changes})


def test_all_parameters_and_settable_states_are_the_default() -> None:
    found = choose_variables(describe())
    assert (found.input.name, found.output.name, found.channels) == ("u", "x", ())
    assert [(each.variable.name, each.value) for each in found.parameters] == [
        ("mass", 2.0),
        ("damping", 0.5),
    ]
    assert [(each.lower, each.upper) for each in found.parameters] == [(0.1, 40.0), (0.1, 10.0)]
    assert [(each.variable.name, each.place) for each in found.initial] == [("v", -1)]


def test_start_values_of_exported_models_are_initial_values() -> None:
    names = ("start.x[1]", "start.u[2]", "start.other[1]", "gain")
    parameters = tuple(FmiVariable(name, place, start=1.0) for place, name in enumerate(names))
    found = choose_variables(describe(parameters=parameters, states=()))
    assert [each.variable.name for each in found.parameters] == ["gain"]
    assert [each.sample_of for each in found.initial] == ["output", "input", ""]


def test_values_tolerances_and_bounds_can_be_given() -> None:
    chosen = {"damping": FmuParameterChoice(0.7, tolerance=0.1, upper=3.0)}
    (found,) = choose_variables(describe(), parameters=chosen, initial=()).parameters
    assert (found.value, found.tolerance, found.lower, found.upper) == (0.7, 0.1, 0.1, 3.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"input": "U"}, "axis.fmu has no input 'U': take one of u"),
        ({"output": "y"}, "axis.fmu has no output 'y': take one of x"),
        (
            {"parameters": {"dampnig": FmuParameterChoice()}},
            "no parameter 'dampnig': take one of mass, damping. Did you mean 'damping'",
        ),
        (
            {"parameters": {"damping": FmuParameterChoice(0.01)}},
            "damping = 0.01 is outside its bounds 0.1 to",
        ),
        ({"initial": ["w"]}, "no initial value 'w': take one of v"),
        ({"channels": ["u"]}, "u is the input and cannot be a channel as well"),
        ({"channels": ["room"]}, "no input 'room': take one of u"),
        ({"steps": 4}, "is a co-simulation, which takes its own steps"),
    ],
)
def test_an_unsuitable_choice_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        choose_variables(describe(), **options)


def test_parameters_have_to_be_chosen_if_there_are_many() -> None:
    many = tuple(FmiVariable(f"p{place}", place, start=1.0) for place in range(MAX_DEFAULT_PARAMETERS + 1))
    with pytest.raises(SettingsError, match="has 21 variables for parameters, too many to calibrate"):
        choose_variables(describe(parameters=many))
    assert choose_variables(describe(parameters=many), parameters={}).parameters == ()
