"""Equations of maps of a signal, from which programs in other languages are written."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from islands.effects.interface.context import SimulationContext

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
