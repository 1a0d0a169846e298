"""Effects: physics that a simulation may lack."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from islands.effects.interface.context import Parameter, Signal, SimulationContext
from islands.effects.interface.force import ForceLaw
from islands.effects.interface.formula import Formula
from islands.effects.interface.map_equation import MakeEquation
from islands.errors import SettingsError

__all__ = ["Effect", "EffectTemplate", "ForceLaw", "Formula", "Signal", "SimulationContext", "Site"]


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
