"""Effects: physics that a simulation may lack."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple, TypeAlias

import numpy as np

from islands.effects.interface.context import Parameter, Signal, SimulationContext
from islands.effects.interface.force import ForceLaw
from islands.errors import SettingsError

#: Operators by name, with their arguments. The result is a signal, or a number if it is the same at all
#: samples.
#:
#: * ``low-pass`` (time constant in s): `islands.effects.filters.low_pass`
#: * ``resonance`` (period in s, damping ratio): mode in series with the signal
#: * ``play`` (half width): `islands.kernels.memory_operators`
#: * ``slider`` (breakaway): `islands.effects.hysteresis.stick`
#: * ``limit-rate`` (inverse of the rate per second): `islands.kernels.memory_operators`
#: * ``lag-unevenly`` (rate per second, four time constants in s): `islands.kernels.memory_operators`
#: * ``lag-by-gap`` (time constant in s, inverse of the rate per second): `islands.kernels.memory_operators`
#: * ``interpolate`` (e, tau in s, cosine in s, sine in s, f in Hz): the signal at the time
#:   ``t (1 + e) - tau - cosine cos(2 pi f t) - sine sin(2 pi f t)``
#: * ``first``: number, the first sample
#: * ``rests``: number, 1 if the signal is constant over the estimation part, otherwise 0
#: * ``temperature``: the first temperature among the channels, relative to its first value
#: * ``coupled``: the first other channel
#:
#: Without a positive first argument, the first six return the signal itself.
OPERATORS = (
    "low-pass",
    "resonance",
    "play",
    "slider",
    "limit-rate",
    "lag-unevenly",
    "lag-by-gap",
    "interpolate",
    "first",
    "rests",
    "temperature",
    "coupled",
)

__all__ = ["Effect", "EffectTemplate", "ForceLaw", "Formula", "Signal", "SimulationContext", "Site"]


class FormulaQuantity(NamedTuple):
    """A number in a formula.

    Attributes
    ----------
    symbol : str
    value : float
    unit : str
    parameter : str
        Name of the parameter whose value it is; empty if it is computed from one.
    """

    symbol: str
    value: float
    unit: str
    parameter: str = ""


@dataclass(frozen=True, slots=True)
class Formula:
    """Formula of an effect.

    Programs and simulations compute ``equation`` and ``form`` of an effect. They contain smoothed steps and
    values relative to a peak, and the formula contains what these mean: ``F*sign(v)``, ``clip(x, -L, L)``.

    Attributes
    ----------
    text : str
        Signal after a map as an expression of the signal ``x`` before it; force as one of the coordinate
        ``x`` and its rate ``v``. ``t`` is the time, and ``at(x, t - tau)`` the signal at another time.
        Functions may have any name. Empty if the equations of the simulation contain the term, or if the
        effect limits a state.
    symbols : tuple of str
        Names of the values, without those that are initial states; by default the names of the parameters.
    quantities : callable or None
        ``(values, context) -> quantities``: the numbers of the formula if they are not the values.
    states : tuple of (str, str)
        States of the effect with their derivatives.
    conditions : tuple of str
        Limits of the state ``x`` that the effect is named after.
    names : tuple of str
        Further signals and functions in ``text``, which the note explains.
    note : str
        Sentence on the formula without a period, as a format string with the names in braces.
    """

    text: str = ""
    symbols: tuple[str, ...] = ()
    quantities: Callable[[Signal, SimulationContext], Sequence[FormulaQuantity]] | None = None
    states: tuple[tuple[str, str], ...] = ()
    conditions: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    note: str = ""

    def list_quantities(
        self, parameters: Sequence[Parameter], values: Signal, context: SimulationContext
    ) -> tuple[FormulaQuantity, ...]:
        """Return the numbers of the formula, given the parameters of the effect and their values."""
        if self.quantities is not None:
            return tuple(self.quantities(values, context))
        given = [
            (parameter, float(value))
            for parameter, value in zip(parameters, values, strict=False)  # copies of initial states follow
            if not parameter.initial
        ]
        symbols = self.symbols or tuple(parameter.name for parameter, _ in given)
        return tuple(
            FormulaQuantity(symbol, value, parameter.unit, parameter.name)
            for symbol, (parameter, value) in zip(symbols, given, strict=True)
        )


def write_curve_formula(text: str, what: str) -> Formula:
    """Return the formula of a free form, whose function ``f`` is drawn, and is not given by a few numbers."""
    return Formula(
        text,
        quantities=lambda _values, _context: (),
        names=("f",),
        note=f"{{f}} is {what}, whose values are in the figure of the free forms",
    )


@dataclass(frozen=True, slots=True)
class MapEquation:
    """Equation of a map.

    Attributes
    ----------
    equation : str
        Signal after the map as an expression of the signal ``x`` before it, the time ``t``, the values
        ``n0``, ``n1``, ... of the effect, and the results ``z0``, ``z1``, ... of operators on ``x``.
    operators : tuple of tuple of str
        Name of each operator in `OPERATORS`, then its arguments as expressions of the values.
    """

    equation: str
    operators: tuple[tuple[str, ...], ...] = ()


#: ``context -> equation``: the scales of the context are numbers in the equation.
MakeEquation: TypeAlias = Callable[[SimulationContext], MapEquation]


class Site(StrEnum):
    """Part of the simulation that an effect changes."""

    INPUT = "input map"
    FORCE = "coordinate and rate"
    CORE = "state equation"
    PARAMETER = "parameter"
    OUTPUT = "output map"


#: A map: ``(signal, values, context) -> signal``, both signals of shape (samples,).
Map = Callable[[Signal, Signal, SimulationContext], Signal]


@dataclass(frozen=True, slots=True)
class Effect:
    """An entry of the catalogue.

    Attributes
    ----------
    name : str
    summary : str
        One line with the equation of the effect, without a period.
    family : str
        Group of effects in reports.
    site : Site
    parameters : callable
        ``context -> tuple of Parameter``: the strength first, then the shape. The effect vanishes at the
        nominal strength.
    starting_points : callable
        ``(context, residual) -> points``: starting points of the calibration, each with a value for every
        parameter. The residual is that of the current simulation, shape (samples,).
    form : callable, ForceLaw or None
        Map of a signal, or force law on the coordinate. None if the simulator implements the effect; it
        receives the parameters by name.
    source : str
        Publication that describes the form.
    equation : callable or None
        ``context -> MapEquation``: the same map as an equation, from which programs in other languages are
        written. An effect on the gain has one as well, which maps the gain. None if there is no program.
    formula : Formula or None
        What readers see in the equations of an extended simulation. None if it is only a function.
    is_applicable : callable
        ``context -> bool``: whether the record can show the effect.
    linear_parameters : int
        Number of leading parameters to which the response of a weak effect is proportional.
    project : callable or None
        ``values -> values``: the nearest values that the form admits, if these are not given by the bounds of
        each value. Calibration moves along such a limit and not beyond it, where derivatives would be zero.
    centre : callable or None
        ``(values, context) -> values``: the middle of the values with the same response to the input of the
        estimation part, for a map that jumps. Another input tells such values apart. The first value is a
        width, the others are distances. None if every change of a value changes the response.
    acts_between_samples : bool
        Whether a map of the input depends on the order of values, and on the ``intervals`` of the context,
        and not on their instants. In continuous time it is then applied to the interpolated input: a dead
        zone or a limit is not reached at a sample, but between two of them.
    is_gain : bool
        Whether the effect is a gain. Gains are searched for only if every parameter except initial states has
        a tolerance; otherwise calibration absorbs them.
    is_free : bool
        Whether the effect is a free form, which has any shape of its family. It has one starting point for
        each coefficient, and its calibration starts from their best combination.
    is_tuned : bool
        Whether its starting points are fitted to the residual over two numbers or more, so that they explain
        a part of any noise.
    depends_on_time : bool
        Whether it is a function of the time of the record, so that it says nothing about another record.
    special_cases : tuple of str
        Names of the effects with a shape that a free form has as well.
    extra_degrees_of_freedom : int
        Degrees of freedom added to the number of parameters in the information criterion, for example for an
        instant or a frequency that is selected among all samples.
    confounded_with : tuple or None
        Another effect with the same mean response, and the factor from the values of this effect to those of
        the other one.
    similar_to : str
        Names of effects with a similar response, for the reference.
    distinguished_by : str
        Observation that distinguishes the effect from those, for results and the reference.
    occurs_in : str
        Parts of machines that have the effect, for results and the reference; empty for a free form.
    title : str
        Plain name in sentences, which the name of the effect follows in brackets; empty for the name alone.
    """

    name: str
    summary: str
    family: str
    site: Site
    parameters: Callable[[SimulationContext], tuple[Parameter, ...]]
    starting_points: Callable[[SimulationContext, Signal], Sequence[tuple[float, ...]]]
    form: Map | ForceLaw | None
    source: str
    equation: MakeEquation | None = None
    formula: Formula | None = None
    is_applicable: Callable[[SimulationContext], bool] = lambda _: True
    linear_parameters: int = 1
    project: Callable[[Signal], Signal] | None = None
    centre: Callable[[Signal, SimulationContext], Signal] | None = None
    acts_between_samples: bool = False
    is_gain: bool = False
    is_free: bool = False
    is_tuned: bool = False
    depends_on_time: bool = False
    special_cases: tuple[str, ...] = ()
    extra_degrees_of_freedom: int = 0
    confounded_with: "tuple[Effect, float] | None" = None
    similar_to: str = ""
    distinguished_by: str = ""
    occurs_in: str = ""
    title: str = ""

    @property
    def cause(self) -> str:
        """Name without the state or parameter after the colon."""
        return self.name.partition(":")[0]

    @property
    def place(self) -> str:
        """State or parameter after the colon of the name; empty if it has none."""
        return self.name.partition(":")[2]


@dataclass(frozen=True, slots=True)
class EffectTemplate:
    """An entry of the catalogue that exists once for each state, parameter or model of a simulation.

    Attributes
    ----------
    name, summary : str
        As in `Effect`. The name of an effect is this name, usually with a colon and the name of a state or
        parameter.
    title, similar_to, distinguished_by, occurs_in : str
        As in `Effect`.
    placed_title : str
        The same as a format string of the state or parameter; empty for the title without it.
    """

    name: str
    summary: str
    title: str = ""
    placed_title: str = ""
    similar_to: str = ""
    distinguished_by: str = ""
    occurs_in: str = ""


def apply_map(effect: Effect, signal: Signal, values: Signal, context: SimulationContext) -> Signal:
    """Apply the map of an effect to a signal.

    Raises
    ------
    SettingsError
        The map raises an exception or changes the shape of the signal.
    """
    assert callable(effect.form)
    try:
        out = np.asarray(effect.form(signal, values, context), dtype=np.float64)
    except Exception as error:
        raise invalid_effect_error(effect, f"its form fails: {type(error).__name__}: {error}") from error
    if out.shape != signal.shape:
        raise invalid_effect_error(effect, f"its form gives {out.shape} for {signal.shape}")
    return out


def invalid_effect_error(effect: Effect, why: str) -> SettingsError:
    """Return the error for an effect whose definition is invalid."""
    file = effect.parameters.__code__.co_filename
    return SettingsError(
        f"the effect {effect.name} is broken: {why}; correct {file} or remove the effect from the catalogue"
    )
