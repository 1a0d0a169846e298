"""Input of a simulation after the maps of effects."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from islands.effects.interface.context import Signal, SimulationContext
from islands.effects.interface.effect import Effect, apply_map


class MappedInput(NamedTuple):
    """Input of a simulation, as in `SimulationRun`.

    Attributes
    ----------
    x : ndarray, shape (samples,)
    characteristic : callable or None
        Map that acts on the values between samples as well.
    """

    x: Signal
    characteristic: Callable[[Signal, Signal], Signal] | None


def count_sampled_maps(effects: Sequence[Effect]) -> int:
    """Return how many maps of the input act on its samples in continuous time.

    They are the maps up to the last one that does not act between samples.
    """
    places = [place for place, effect in enumerate(effects, start=1) if not effect.acts_between_samples]
    return max(places, default=0)


def map_input(
    maps: Sequence[tuple[Effect, Signal]], context: SimulationContext, is_continuous_time: bool
) -> MappedInput:
    """Apply maps of the input, each with its values, in their order.

    In continuous time, the last ones form the characteristic if they act between samples.
    """
    last = count_sampled_maps([effect for effect, _ in maps]) if is_continuous_time else len(maps)

    def apply(
        part: Sequence[tuple[Effect, Signal]], signal: Signal, intervals: Signal | None = None
    ) -> Signal:
        given = replace(context, intervals=intervals)
        for effect, values in part:
            signal = apply_map(effect, signal, values, given)
        return signal

    return MappedInput(apply(maps[:last], context.u), partial(apply, maps[last:]) if maps[last:] else None)
