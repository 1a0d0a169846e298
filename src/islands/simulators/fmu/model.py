"""Simulation by an FMU: the variables that are its input, output, channels, parameters and initial values."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import TypeVar

from islands.errors import SettingsError, suggest
from islands.simulators.fmu.fmi_description import FmiDescription, FmiInterface, FmiVariable
from islands.simulators.ode.equation_parser import is_free_name
from islands.simulators.ode.system import OUTPUT

T = TypeVar("T")

#: Largest number of parameters that are taken if none are chosen; one record cannot determine more.
MAX_DEFAULT_PARAMETERS = 20

#: Largest number of states whose initial values are calibrated if none are chosen.
MAX_DEFAULT_STATES = 20

#: Name of a start value of an FMU that islands has written: a past sample of a column.
_START_VALUE = re.compile(r"start\.(.+)\[\d+\]")

#: Number of names in the message about a name that does not exist.
_NAMED = 12


@dataclass(frozen=True, slots=True)
class FmuParameter:
    """Parameter of an FMU.

    Attributes
    ----------
    variable : FmiVariable
    value : float
        Nominal value.
    tolerance : float or None
        Relative standard deviation about the nominal value; None if the parameter is free.
    lower, upper : float
        Bounds of the calibration; by default a twentieth and twenty times the value, within the limits of the
        model description.
    fixed : bool
        Whether the value is exact and is not calibrated.
    """

    variable: FmiVariable
    value: float
    tolerance: float | None = None
    lower: float = -inf
    upper: float = inf
    fixed: bool = False


@dataclass(frozen=True, slots=True)
class FmuInitialValue:
    """Value at the first sample, which belongs to the record.

    Attributes
    ----------
    variable : FmiVariable
    place : int
        Place among the continuous states; -1 if the value is set as a start value.
    sample_of : str
        ``input`` or ``output`` if the value is a past sample of it; empty otherwise.
    """

    variable: FmiVariable
    place: int = -1
    sample_of: str = ""


@dataclass(frozen=True, slots=True)
class FmuModel:
    """FMU with the variables that a simulation uses.

    Attributes
    ----------
    description : FmiDescription
    input, output : FmiVariable
    channels : tuple of FmiVariable
        Further inputs, which columns of the record drive.
    parameters : tuple of FmuParameter
    initial : tuple of FmuInitialValue
        Values at the first sample that are calibrated.
    steps : int
        Steps of the integrator per sample; 0 if the simulation chooses it.
    symbols : mapping
        Names in equations of the input, the channels, the states with initial values, and the output. They
        are those of the variables, with ``_`` for characters that no name in equations has, and behind a
        name that has a meaning already.
    """

    description: FmiDescription
    input: FmiVariable
    output: FmiVariable
    channels: tuple[FmiVariable, ...]
    parameters: tuple[FmuParameter, ...]
    initial: tuple[FmuInitialValue, ...]
    steps: int = 0

    symbols: Mapping[str, str] = field(init=False, compare=False)

    def __post_init__(self) -> None:
        taken = {OUTPUT, *(parameter.variable.name for parameter in self.parameters)}
        symbols: dict[str, str] = {}
        states = (each.variable for each in self.initial if each.place >= 0)
        for variable in (self.input, *self.channels, *states, self.output):
            if variable.name in symbols:
                continue
            symbol = re.sub(r"\W", "_", variable.name, flags=re.ASCII)
            while symbol in taken or not is_free_name(symbol):
                symbol = f"{symbol}_" if symbol[:1].isidentifier() else f"_{symbol}"
            symbols[variable.name] = symbol
            taken.add(symbol)
        object.__setattr__(self, "symbols", symbols)


@dataclass(frozen=True, slots=True)
class FmuParameterChoice:
    """Properties of a parameter that differ from those of the model description; see `FmuParameter`."""

    value: float | None = None
    tolerance: float | None = None
    lower: float | None = None
    upper: float | None = None
    fixed: bool = False


def choose_variables(
    description: FmiDescription,
    input: str = "",  # noqa: A002 - the name of the specification
    output: str = "",
    channels: Sequence[str] = (),
    parameters: Mapping[str, FmuParameterChoice] | None = None,
    initial: Sequence[str] | None = None,
    steps: int = 0,
) -> FmuModel:
    """Choose the variables of a simulation by name.

    Parameters
    ----------
    input, output : str
        May be empty if the FMU has one of them.
    channels : sequence of str
        Further inputs; those that are not chosen keep their start values.
    parameters : mapping, optional
        Parameters by name; by default all.
    initial : sequence of str, optional
        States or start values that are calibrated; by default all that can be set.

    Raises
    ------
    SettingsError
        A name is missing or unknown, or a value is out of range.
    """
    name = description.name
    if steps and description.interface == FmiInterface.CO_SIMULATION:
        raise SettingsError(f"{name} is a co-simulation, which takes its own steps: leave out steps")
    inputs, outputs = _by_name(description.inputs), _by_name(description.outputs)
    chosen_input = inputs[_choose_one(name, "input", inputs, input)]
    chosen_output = outputs[_choose_one(name, "output", outputs, output)]
    if chosen_input.name in channels:
        raise SettingsError(f"{name}: {chosen_input.name} is the input and cannot be a channel as well")
    possible = _find_initial_values(description, chosen_input.name, chosen_output.name)
    known = _find_parameters(description, possible)
    if parameters is None:
        _check_number(name, "parameters", known, MAX_DEFAULT_PARAMETERS)
        parameters = dict.fromkeys(known, FmuParameterChoice())
    if initial is None:
        _check_number(name, "initial", possible, MAX_DEFAULT_STATES)
        initial = list(possible)
    return FmuModel(
        description,
        chosen_input,
        chosen_output,
        tuple(_find(name, "input", inputs, channel) for channel in channels),
        tuple(
            _make_parameter(name, _find(name, "parameter", known, parameter), choice)
            for parameter, choice in parameters.items()
        ),
        tuple(_find(name, "initial value", possible, start) for start in initial),
        steps,
    )


def list_calibrated(description: FmiDescription) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of the parameters, and of the values at the first sample, that can be calibrated."""
    initial = _find_initial_values(description, "", "")
    return tuple(_find_parameters(description, initial)), tuple(initial)


def _find_parameters(description: FmiDescription, initial: Mapping[str, object]) -> dict[str, FmiVariable]:
    return {name: each for name, each in _by_name(description.parameters).items() if name not in initial}


def _by_name(variables: Sequence[FmiVariable]) -> dict[str, FmiVariable]:
    return {each.name: each for each in variables}


def _choose_one(file: str, kind: str, known: Mapping[str, FmiVariable], chosen: str) -> str:
    if not known:
        raise SettingsError(f"{file} has no {kind} that is a scalar of type real: a diagnosis needs one")
    if chosen:
        return _find(file, kind, known, chosen).name
    if len(known) > 1:
        raise SettingsError(f"{file} has {len(known)} {kind}s: choose {kind}=NAME of {_list(known)}")
    return next(iter(known))


def _find(file: str, kind: str, known: Mapping[str, T], name: str) -> T:
    """Return the entry of a name, or raise an error that suggests similar names."""
    if name not in known:
        raise SettingsError(
            f"{file} has no {kind} {name!r}: take one of {_list(known)}{suggest(name, known)}"
        )
    return known[name]


def _list(names: Sequence[str] | Mapping[str, object]) -> str:
    listed = list(names)
    more = f" and {len(listed) - _NAMED} more" if len(listed) > _NAMED else ""
    return (", ".join(listed[:_NAMED]) or "none") + more


def _check_number(file: str, option: str, known: Mapping[str, object], most: int) -> None:
    if len(known) > most:
        raise SettingsError(
            f"{file} has {len(known)} variables for {option}, too many to calibrate: choose with "
            f"{option}=NAME,NAME of {_list(known)}"
        )


def _find_initial_values(
    description: FmiDescription, input_name: str, output_name: str
) -> dict[str, FmuInitialValue]:
    """Return the values at the first sample that can be set, by name."""
    columns = {input_name: "input", output_name: "output"}
    found = {}
    for place, state in enumerate(description.states):
        sample_of = columns.get(state.name, "")
        if description.interface == FmiInterface.MODEL_EXCHANGE:
            found[state.name] = FmuInitialValue(state, place, sample_of)
        elif state.name in description.settable:
            found[state.name] = FmuInitialValue(state, -1, sample_of)
    for parameter in description.parameters:
        if match := _START_VALUE.fullmatch(parameter.name):
            found[parameter.name] = FmuInitialValue(parameter, -1, columns.get(match[1], ""))
    return found


def _make_parameter(file: str, variable: FmiVariable, choice: FmuParameterChoice) -> FmuParameter:
    value = choice.value
    if value is None:
        assert variable.start is not None  # every parameter of a description has a start value
        value = variable.start
    ends = (0.05 * value, 20.0 * value) if value else (-inf, inf)
    lower = max(min(ends), variable.lower) if choice.lower is None else choice.lower
    upper = min(max(ends), variable.upper) if choice.upper is None else choice.upper
    if not (choice.fixed or lower <= value <= upper) or lower >= upper:
        raise SettingsError(
            f"{file}: {variable.name} = {value:g} is outside its bounds {lower:g} to {upper:g}: correct them"
        )
    return FmuParameter(variable, value, choice.tolerance, lower, upper, choice.fixed)
