"""Simulations outside of islands: a Python function, and an output that was recorded."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import ClassVar

import numpy as np

from islands.effects.interface.context import Parameter, Signal, SimulationContext
from islands.effects.interface.effect import Site
from islands.effects.interface.force import add_output_forces
from islands.errors import RecordError, SettingsError, suggest
from islands.records.masked_values import fill_masked
from islands.simulators.interface import Forces, Simulator

#: Typical change of a parameter, relative to its value.
_SCALE = 0.01

#: Largest change of a parameter, relative to its value.
_MAX_CHANGE = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class PythonFunctionSimulator(Simulator):
    """``function(u, dt, **parameters) -> y``; arguments with a numeric default are parameters.

    Attributes
    ----------
    function : callable
    source : str
        ``FILE.py:FUNCTION``, or the name of the function.
    given : mapping
        Nominal values of parameters by name; the default of the function for the others.
    """

    function: Callable[..., Signal]
    source: str
    given: Mapping[str, float] = field(default_factory=dict)
    sites: ClassVar[frozenset[Site]] = frozenset((Site.INPUT, Site.FORCE, Site.PARAMETER, Site.OUTPUT))

    def __post_init__(self) -> None:
        try:
            arguments = list(inspect.signature(self.function).parameters.values())
        except ValueError as error:  # a built-in function without a signature
            raise SettingsError(
                f"the arguments of {self.name} are unknown: wrap it in a Python function"
            ) from error
        defaults = {each.name: each.default for each in arguments[2:]}
        if unknown := sorted(self.given.keys() - defaults.keys()):
            raise SettingsError(
                f"{self.name} has no parameter {', '.join(unknown)}: it has {', '.join(defaults) or 'none'}"
                f"{suggest(unknown[0], defaults)}"
            )
        for name, value in defaults.items():
            if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
                raise SettingsError(
                    f"{self.name}: the parameter {name} needs a number for its default, like {name}=1.0"
                )
        if len(arguments) < 2:
            raise SettingsError(f"{self.name} must take (u, dt), then parameters with numeric defaults")
        object.__setattr__(
            self, "given", {name: float(value) for name, value in {**defaults, **self.given}.items()}
        )

    @property
    def name(self) -> str:
        """Source without the folder."""
        return self.source.replace("\\", "/").rpartition("/")[2]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Arguments with numeric defaults."""
        return tuple(
            Parameter(
                name,
                "",
                value,
                _SCALE * abs(value) or _SCALE,
                *((value - _MAX_CHANGE * abs(value), value + _MAX_CHANGE * abs(value)) if value else ()),
            )
            for name, value in self.given.items()
        )

    def simulate(
        self,
        values: Signal,
        x: Signal,
        context: SimulationContext,
        _effect_parameters: Mapping[str, float],
        forces: Forces,
    ) -> Signal:
        """Simulate the output; see `Simulator.simulate`."""
        keywords = {name: float(value) for name, value in zip(self.given, values, strict=True)}
        # A copy, since the function could write into its argument.
        try:
            y = np.asarray(fill_masked(self.function(x.copy(), context.dt, **keywords)))
            if np.iscomplexobj(y):
                raise TypeError("its output is complex")
            y = np.asarray(y, dtype=np.float64)
        except (Exception, SystemExit) as error:
            raise RecordError(f"{self.name} fails: {type(error).__name__}: {error}") from error
        if y.shape != x.shape:
            raise RecordError(
                f"{self.name} gave an output of shape {y.shape} for an input of {x.shape}: it has to return "
                "one value per sample"
            )
        return y + add_output_forces(x, context, forces)


@dataclass(frozen=True, slots=True, eq=False)
class RecordedOutput(Simulator):
    """Output of an external simulation.

    The simulation cannot be repeated with a different input or equation. Only effects on the output and
    forces on the recorded input can be searched for.

    Attributes
    ----------
    column : str
        Name of the column.
    simulated : ndarray, shape (samples,)
        Simulated output.
    """

    column: str
    simulated: Signal
    sites: ClassVar[frozenset[Site]] = frozenset((Site.FORCE, Site.OUTPUT))

    @property
    def name(self) -> str:
        """Name in reports."""
        return f"column {self.column}"

    @property
    def is_recorded(self) -> bool:
        """Whether the output was recorded."""
        return True

    def for_samples(self, first: int, last: int) -> "RecordedOutput":
        """Return the output of one recording."""
        return replace(self, simulated=np.asarray(self.simulated)[first:last])

    def simulate(
        self,
        _values: Signal,
        x: Signal,
        context: SimulationContext,
        _effect_parameters: Mapping[str, float],
        forces: Forces,
    ) -> Signal:
        """Simulate the output; see `Simulator.simulate`."""
        return np.asarray(self.simulated) + add_output_forces(x, context, forces)
