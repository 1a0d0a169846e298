"""A simulation of the user's own: a Python function of the input and the sampling time."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import isfinite

import numpy as np

from islands.discrepancy.interfaces.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.discrepancy.interfaces.effect import Effect, Site
from islands.discrepancy.interfaces.force import add_output_forces
from islands.discrepancy.interfaces.simulator import Forces
from islands.discrepancy.simulators.coordinates import input_coordinate
from islands.errors import RecordError, SettingsError

#: A change of a parameter that matters, relative to it, and how far one may go.
_SCALE, _FAR = 0.01, 10.0


@dataclass(frozen=True, slots=True, eq=False)
class PythonFunctionSimulator:
    """``function(u, dt, **parameters) -> y``; what has a number for its default is a parameter.

    Attributes
    ----------
    function : callable
    source : str
        FILE.py:FUNCTION.
    given : mapping
        Nominal values of its parameters, by name; who is not named has the function's own.
    """

    function: Callable[..., Signal]
    source: str
    given: Mapping[str, float] = field(default_factory=dict)
    sites: frozenset[Site] = frozenset((Site.INPUT, Site.FORCE, Site.PARAMETER, Site.OUTPUT))
    supported_effects: frozenset[str] = frozenset()
    built_in_effects: frozenset[str] = frozenset()
    state_effects: tuple[Effect, ...] = ()
    is_continuous_time: bool = False

    def __post_init__(self) -> None:
        try:
            known = list(inspect.signature(self.function).parameters.values())
        except ValueError as error:  # one that is not written in Python
            raise SettingsError(f"nobody knows what {self.name} takes: write a function around it") from error
        given = {each.name: each.default for each in known[2:]}
        if unknown := self.given.keys() - given.keys():
            raise SettingsError(f"{self.name} has no parameter {', '.join(sorted(unknown))}")
        for name, value in given.items():
            if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
                raise SettingsError(
                    f"{self.name}: the parameter {name} needs a number for its default, like {name}=1.0"
                )
        if len(known) < 2:
            raise SettingsError(f"{self.name} has to take (u, dt), and parameters with numbers for defaults")
        object.__setattr__(
            self, "given", {name: float(value) for name, value in {**given, **self.given}.items()}
        )

    @property
    def name(self) -> str:
        """FILE.py:FUNCTION, without the folder."""
        return self.source.replace("\\", "/").rpartition("/")[2]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its keywords."""
        return tuple(
            Parameter(
                name,
                "",
                value,
                _SCALE * abs(value) or _SCALE,
                *((value - _FAR * abs(value), value + _FAR * abs(value)) if value else ()),
            )
            for name, value in self.given.items()
        )

    def make_force_coordinate(self, context: SimulationContext, output: Signal) -> ForceCoordinate:
        """See `islands.discrepancy.interfaces.simulator.Simulator`."""
        return input_coordinate(context, output)

    def simulate(
        self, values: Signal, x: Signal, context: SimulationContext, _own: Mapping[str, float], forces: Forces
    ) -> Signal:
        """See `islands.discrepancy.interfaces.simulator.Simulator`."""
        chosen = {name: float(value) for name, value in zip(self.given, values, strict=True)}
        # Its own copy: a function that writes into what it is given would spoil the record.
        try:
            y = np.asarray(self.function(x.copy(), context.dt, **chosen))
            if np.iscomplexobj(y):
                raise TypeError("its output is complex")
            y = np.asarray(y, dtype=np.float64)
        except (Exception, SystemExit) as error:
            raise RecordError(f"{self.name} fails: {type(error).__name__}: {error}") from error
        if y.shape != x.shape:
            raise RecordError(
                f"{self.name} gave an output of shape {y.shape} for an input of {x.shape}: it has to give "
                "one value a sample"
            )
        return y + add_output_forces(x, context, forces)
