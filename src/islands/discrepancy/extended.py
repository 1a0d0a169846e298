"""A simulation with effects in it: input maps, the core with its forces, output maps."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from islands.discrepancy.core import Core
from islands.discrepancy.effect import Effect, Scene, Signal, Site
from islands.discrepancy.parameter import Parameter

#: Outputs of the core that are remembered: derivatives ask for the same one again and again.
_REMEMBERED = 4


@dataclass(frozen=True, slots=True, eq=False)
class Extended:
    """A core and the effects in it, one vector of values for all: the core's first, then each effect's.

    Attributes
    ----------
    core : Core
    effects : tuple of Effect
        In the order of the catalogue, which is the order in which maps act.
    scene : Scene
    """

    core: Core
    effects: tuple[Effect, ...]
    scene: Scene
    parameters: tuple[Parameter, ...] = field(init=False)
    _parts: tuple[slice, ...] = field(init=False)
    _inner: NDArray[np.bool_] = field(init=False)
    _known: dict[bytes, Signal] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        own = len(self.core.parameters)
        parameters, parts, inner = list(self.core.parameters), [], [True] * own
        for effect in self.effects:
            added = effect.parameters(self.scene)
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

    def part(self, effect: Effect) -> slice:
        """Return where an effect's values are."""
        return self._parts[self.effects.index(effect)]

    def with_effects(self, effects: Sequence[Effect]) -> "Extended":
        """Return the core with other effects in it."""
        return replace(self, effects=tuple(effects))

    def simulate(self, values: Signal) -> Signal:
        """Simulate the whole record, shape (samples,).

        Values that a search tries may make something explode: what comes back is not finite then.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            y = self._behind_core(values)
            for effect, part in zip(self.effects, self._parts, strict=True):
                if effect.site == Site.OUTPUT:
                    assert effect.form is not None
                    y = effect.form(y, values[part], self.scene)
        return y

    def _behind_core(self, values: Signal) -> Signal:
        key = values[self._inner].tobytes()
        y = self._known.get(key)
        if y is None:
            y = self._simulate_core(values)
            while len(self._known) >= _REMEMBERED:
                del self._known[next(iter(self._known))]
            self._known[key] = y
        return y

    def _simulate_core(self, values: Signal) -> Signal:
        x, forces = self.scene.u, []
        own: dict[str, float] = {}
        core = values[: len(self.core.parameters)].copy()
        for effect, part in zip(self.effects, self._parts, strict=True):
            match effect.site:
                case Site.INPUT:
                    assert effect.form is not None
                    x = effect.form(x, values[part], self.scene)
                case Site.CORE:
                    own |= {
                        parameter.name: float(value)
                        for parameter, value in zip(self.parameters[part], values[part], strict=True)
                    }
                case Site.PARAMETER:
                    core[self._place(effect)] *= 1.0 + values[part][0]
                case Site.FORCE:
                    forces.append((effect, values[part]))
        return self.core.simulate(core, x, self.scene, own, forces)

    def _place(self, effect: Effect) -> int:
        _, _, name = effect.name.partition(":")
        return [parameter.name for parameter in self.core.parameters].index(name)
