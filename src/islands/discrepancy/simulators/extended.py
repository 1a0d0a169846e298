"""Simulator with effects: input maps, simulation with forces, output maps."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from islands.discrepancy.interfaces.context import Parameter, Signal, SimulationContext
from islands.discrepancy.interfaces.effect import Effect, ForceLaw, Site
from islands.discrepancy.interfaces.simulator import Forces, Simulator
from islands.errors import SettingsError

#: Cached outputs before the output maps: finite differences need the same one several times.
_CACHE_SIZE = 4

_NONE: Mapping[str, float] = MappingProxyType({})

#: A simulation diverges if its output exceeds its nominal peak by this factor; squares would overflow later.
_DIVERGENCE_FACTOR = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class ExtendedSimulator:
    """Simulator with effects. One vector has the values of the simulator, then those of each effect.

    Attributes
    ----------
    simulator : Simulator
    effects : tuple of Effect
        In the order of the catalogue, in which maps act.
    context : SimulationContext
    parameters : tuple of Parameter
        Parameters of the simulator, then those of each effect.
    """

    simulator: Simulator
    effects: tuple[Effect, ...]
    context: SimulationContext
    parameters: tuple[Parameter, ...] = field(init=False)
    _slices: tuple[slice, ...] = field(init=False)
    _before_output: NDArray[np.bool_] = field(init=False)
    _cache: dict[bytes, Signal] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        parameters = list(self.simulator.parameters)
        slices, before_output = [], [True] * len(parameters)
        for effect in self.effects:
            added = effect.parameters(self.context)
            slices.append(slice(len(parameters), len(parameters) + len(added)))
            parameters += added
            before_output += [effect.site != Site.OUTPUT] * len(added)
        object.__setattr__(self, "parameters", tuple(parameters))
        object.__setattr__(self, "_slices", tuple(slices))
        object.__setattr__(self, "_before_output", np.array(before_output, dtype=bool))

    @property
    def nominal(self) -> Signal:
        """Nominal values of the simulator and of the effects, at which effects vanish."""
        return np.array([parameter.nominal for parameter in self.parameters])

    @property
    def bounds(self) -> tuple[Signal, Signal]:
        """Lower and upper bounds of the values."""
        return (
            np.array([parameter.lower for parameter in self.parameters]),
            np.array([parameter.upper for parameter in self.parameters]),
        )

    @property
    def scales(self) -> Signal:
        """Typical changes of the values."""
        return np.array([parameter.scale for parameter in self.parameters])

    def get_slice(self, effect: Effect) -> slice:
        """Return the slice of the values that belongs to an effect."""
        return self._slices[self.effects.index(effect)]

    def with_effects(self, effects: Sequence[Effect]) -> "ExtendedSimulator":
        """Return the same simulator with other effects."""
        return replace(self, effects=tuple(effects))

    def simulate(
        self, values: Signal, effect_parameters: Mapping[str, float] = _NONE, forces: Forces = ()
    ) -> Signal:
        """Simulate the whole record.

        Parameters
        ----------
        values : ndarray, shape (parameters,)
        effect_parameters, forces
            Further arguments of `Simulator.simulate`, in addition to those of the effects.

        Returns
        -------
        ndarray, shape (samples,)
            NaN in every sample if the simulation diverges.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            y = (
                self._simulate_core(values, effect_parameters, forces)
                if effect_parameters or forces
                else self._simulate_cached(values)
            )
            for effect, part in zip(self.effects, self._slices, strict=True):
                if effect.site == Site.OUTPUT:
                    y = apply_map(effect, y, values[part], self.context)
            diverged = not float(np.max(np.abs(y))) < _DIVERGENCE_FACTOR * self.context.output_peak
        return np.full_like(y, np.nan) if diverged else y

    def _simulate_cached(self, values: Signal) -> Signal:
        """Simulate the output before the output maps, or return it from the cache."""
        key = values[self._before_output].tobytes()
        y = self._cache.get(key)
        if y is None:
            y = self._simulate_core(values, _NONE, ())
            while len(self._cache) >= _CACHE_SIZE:
                del self._cache[next(iter(self._cache))]
            self._cache[key] = y
        return y

    def _simulate_core(
        self, values: Signal, effect_parameters: Mapping[str, float], further: Forces
    ) -> Signal:
        """Simulate the output before the output maps."""
        x, forces = self.context.u, list(further)
        parameters = dict(effect_parameters)
        simulator_values = values[: len(self.simulator.parameters)].copy()
        for effect, part in zip(self.effects, self._slices, strict=True):
            match effect.site:
                case Site.INPUT:
                    x = apply_map(effect, x, values[part], self.context)
                case Site.CORE:
                    parameters |= {
                        parameter.name: float(value)
                        for parameter, value in zip(self.parameters[part], values[part], strict=True)
                    }
                case Site.PARAMETER:
                    simulator_values[self._get_parameter_index(effect)] *= 1.0 + values[part][0]
                case Site.FORCE:
                    assert isinstance(effect.form, ForceLaw)
                    forces.append((effect.form, values[part]))
        return self.simulator.simulate(simulator_values, x, self.context, parameters, forces)

    def _get_parameter_index(self, effect: Effect) -> int:
        _, _, name = effect.name.partition(":")
        return [parameter.name for parameter in self.simulator.parameters].index(name)


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
