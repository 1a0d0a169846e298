"""A simulation with effects in it: input maps, the core with its forces, output maps."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from islands.discrepancy.interfaces.context import Parameter, Signal, SimulationContext
from islands.discrepancy.interfaces.effect import Effect, ForceLaw, Site
from islands.discrepancy.interfaces.simulator import Forces, Simulator
from islands.errors import SettingsError

#: Outputs of the core that are remembered: derivatives ask for the same one again and again.
_REMEMBERED = 4

_NONE: Mapping[str, float] = MappingProxyType({})

#: An output that is so many times its peak has exploded: its squares would soon be no numbers any more.
_EXPLODED = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class ExtendedSimulator:
    """A core and the effects in it, one vector of values for all: the core's first, then each effect's.

    Attributes
    ----------
    simulator : Simulator
    effects : tuple of Effect
        In the order of the catalogue, which is the order in which maps act.
    context : SimulationContext
    """

    simulator: Simulator
    effects: tuple[Effect, ...]
    context: SimulationContext
    parameters: tuple[Parameter, ...] = field(init=False)
    _parts: tuple[slice, ...] = field(init=False)
    _inner: NDArray[np.bool_] = field(init=False)
    _known: dict[bytes, Signal] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        own = len(self.simulator.parameters)
        parameters, parts, inner = list(self.simulator.parameters), [], [True] * own
        for effect in self.effects:
            added = effect.parameters(self.context)
            parts.append(slice(len(parameters), len(parameters) + len(added)))
            parameters += added
            inner += [effect.site != Site.OUTPUT] * len(added)
        object.__setattr__(self, "parameters", tuple(parameters))
        object.__setattr__(self, "_parts", tuple(parts))
        object.__setattr__(self, "_inner", np.array(inner, dtype=bool))

    @property
    def nominal(self) -> Signal:
        """Values of the core as it is, and of effects that do nothing."""
        return np.array([parameter.nominal for parameter in self.parameters])

    @property
    def bounds(self) -> tuple[Signal, Signal]:
        """Lower and upper bounds."""
        return (
            np.array([parameter.lower for parameter in self.parameters]),
            np.array([parameter.upper for parameter in self.parameters]),
        )

    @property
    def scales(self) -> Signal:
        """Changes that matter."""
        return np.array([parameter.scale for parameter in self.parameters])

    def get_slice(self, effect: Effect) -> slice:
        """Return where an effect's values are."""
        return self._parts[self.effects.index(effect)]

    def with_effects(self, effects: Sequence[Effect]) -> "ExtendedSimulator":
        """Return the core with other effects in it."""
        return replace(self, effects=tuple(effects))

    def simulate(self, values: Signal, own: Mapping[str, float] = _NONE, forces: Forces = ()) -> Signal:
        """Simulate the whole record, shape (samples,).

        ``own`` and ``forces`` are more of what the core takes.

        Values that a search tries may make something explode: what comes back is not a number then.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            more = bool(own or forces)
            y = (
                self._simulate_core(values, own, forces)
                if more
                else self._simulate_without_output_maps(values)
            )
            for effect, part in zip(self.effects, self._parts, strict=True):
                if effect.site == Site.OUTPUT:
                    y = apply_map(effect, y, values[part], self.context)
            exploded = not float(np.max(np.abs(y))) < _EXPLODED * self.context.output_peak
        return np.full_like(y, np.nan) if exploded else y

    def _simulate_without_output_maps(self, values: Signal) -> Signal:
        key = values[self._inner].tobytes()
        y = self._known.get(key)
        if y is None:
            y = self._simulate_core(values, _NONE, ())
            while len(self._known) >= _REMEMBERED:
                del self._known[next(iter(self._known))]
            self._known[key] = y
        return y

    def _simulate_core(self, values: Signal, more: Mapping[str, float], further: Forces) -> Signal:
        x, forces = self.context.u, list(further)
        own = dict(more)
        simulator = values[: len(self.simulator.parameters)].copy()
        for effect, part in zip(self.effects, self._parts, strict=True):
            match effect.site:
                case Site.INPUT:
                    x = apply_map(effect, x, values[part], self.context)
                case Site.CORE:
                    own |= {
                        parameter.name: float(value)
                        for parameter, value in zip(self.parameters[part], values[part], strict=True)
                    }
                case Site.PARAMETER:
                    simulator[self._apply_maps(effect)] *= 1.0 + values[part][0]
                case Site.FORCE:
                    assert isinstance(effect.form, ForceLaw)
                    forces.append((effect.form, values[part]))
        return self.simulator.simulate(simulator, x, self.context, own, forces)

    def _apply_maps(self, effect: Effect) -> int:
        _, _, name = effect.name.partition(":")
        return [parameter.name for parameter in self.simulator.parameters].index(name)


def apply_map(effect: Effect, signal: Signal, values: Signal, context: SimulationContext) -> Signal:
    """Return a signal behind the map of an effect."""
    assert callable(effect.form)
    try:
        out = np.asarray(effect.form(signal, values, context), dtype=np.float64)
    except Exception as error:
        raise invalid_effect_error(effect, f"its form fails: {type(error).__name__}: {error}") from error
    if out.shape != signal.shape:
        raise invalid_effect_error(effect, f"its form gives {out.shape} for {signal.shape}")
    return out


def invalid_effect_error(effect: Effect, why: str) -> SettingsError:
    """Return the error of an entry of the catalogue that does not do what it says."""
    file = effect.parameters.__code__.co_filename
    return SettingsError(
        f"the effect {effect.name} is broken: {why}; mend {file} or take it out of the catalogue"
    )
