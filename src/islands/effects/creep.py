"""Creep: exponential and logarithmic."""

from collections.abc import Sequence

import numpy as np

from islands.effects.filters import low_pass
from islands.effects.interface.context import Parameter, Points, Signal, SimulationContext
from islands.effects.interface.effect import Effect, Formula, FormulaQuantity, MapEquation, Site
from islands.records.segments import is_resting

#: Largest step before the first sample, times the fraction that creeps, relative to the largest output.
_MAX_EARLIER_STEP = 10.0


def _creep(y: Signal, taus: Sequence[float], context: SimulationContext) -> Signal:
    """Return the sum of the creeps with several time constants.

    Without a step within the estimation part, creep comes from one before the first sample, whose size is
    unknown: as large as the largest output.
    """
    fitted = round((context.fit_end_time - context.start_time) / context.dt)
    is_earlier = fitted > 0 and is_resting(y[:fitted])
    total = np.zeros(y.size)
    for tau in taus:
        earlier = (
            context.output_peak * -np.expm1(-context.dt * np.arange(y.size) / tau) if is_earlier else 0.0
        )
        total += low_pass(y, tau, context.dt) - y[0] + earlier
    return total


def _write_creep(taus: Sequence[str], context: SimulationContext) -> MapEquation:
    """Write the map of a creep with several time constants; an earlier step counts if the signal rests."""
    parts = [
        f"z{place} - z0 + z1*{context.output_peak}*(1 - exp(-t/{tau}))"
        for place, tau in enumerate(taus, start=2)
    ]
    low_passes = tuple(("low-pass", tau) for tau in taus)
    return MapEquation(f"x + n0*({' + '.join(parts)})", (("first",), ("rests",), *low_passes))


def _limit_kappa(context: SimulationContext, lower: float, upper: float) -> tuple[float, float]:
    """Return the bounds of kappa: the given ones, or wider ones for an earlier step of unknown size."""
    return (-_MAX_EARLIER_STEP, _MAX_EARLIER_STEP) if context.has_resting_input else (lower, upper)


def _limit_tau(context: SimulationContext) -> tuple[float, float]:
    """Return the smallest and the largest time constant that a record resolves, in seconds."""
    return 5 * context.dt, 1.5 * context.fit_end_time


def _exponential_creep_starting_points(context: SimulationContext, _residual: Signal) -> Points:
    taus = (max(part * context.fit_end_time, 6 * context.dt) for part in (0.003, 0.01, 0.03, 0.1, 0.3))
    return tuple((0.03, float(np.log(tau))) for tau in taus)


EXPONENTIAL_CREEP = Effect(
    name="exponential-creep",
    title="exponential creep",
    summary="Exponential creep of the output: y + kappa times y after a low-pass with time constant tau",
    family="memory",
    site=Site.OUTPUT,
    parameters=lambda context: (
        Parameter("kappa", "", 0.0, 0.02, *_limit_kappa(context, -0.5, 1.0)),
        Parameter("log_tau", "ln s", 0.0, 0.3, *np.log(_limit_tau(context))),
    ),
    starting_points=_exponential_creep_starting_points,
    form=lambda y, values, context: y + values[0] * _creep(y, [float(np.exp(values[1]))], context),
    equation=lambda context: _write_creep(["exp(n1)"], context),
    formula=Formula(
        "x + kappa*(z - z(0))",
        quantities=lambda values, _: (
            FormulaQuantity("kappa", float(values[0]), "", "kappa"),
            FormulaQuantity("tau", float(np.exp(values[1])), "s"),
        ),
        states=(("z", "(x - z)/tau"),),
    ),
    source="Kuhnen and Janocha, Inverse feedforward controller for complex hysteretic nonlinearities, 1999",
    similar_to="relaxation, logarithmic-creep, linear-drift",
    distinguished_by="the output continues at constant input, with one time constant",
    occurs_in="piezoelectric stacks, adhesives, polymers, heating of a load cell",
)

#: Time constants of the low-passes of logarithmic creep, in seconds.
TAUS = (0.3, 1.0, 3.0, 10.0, 30.0)

#: Minimum number of these time constants that a record resolves.
_MIN_RESOLVED_TAUS = 3


def _resolves_logarithm(context: SimulationContext) -> bool:
    """Return whether a record resolves a decade of logarithmic creep.

    Creep that ends within a few samples is a gain and, less its first value, an offset.
    """
    lower, upper = _limit_tau(context)
    return sum(lower <= tau <= upper for tau in TAUS) >= _MIN_RESOLVED_TAUS


LOGARITHMIC_CREEP = Effect(
    name="logarithmic-creep",
    title="logarithmic creep",
    summary="Logarithmic creep of the output: y + kappa times a sum of low-passes, two per decade",
    family="memory",
    site=Site.OUTPUT,
    parameters=lambda context: (Parameter("kappa", "", 0.0, 0.005, *_limit_kappa(context, -0.3, 0.3)),),
    starting_points=lambda _context, _residual: ((0.01,),),
    form=lambda y, values, context: y + values[0] * _creep(y, TAUS, context),
    equation=lambda context: _write_creep(list(map(str, TAUS)), context),
    formula=Formula(
        "x + kappa*f(x)",
        names=("f",),
        note="{f} is a sum of low-passes with the time constants "
        f"{', '.join(f'{tau:g}' for tau in TAUS[:-1])} and {TAUS[-1]:g} s, less their first values",
    ),
    is_applicable=_resolves_logarithm,
    source="Jung and Gweon, Creep characteristics of piezoelectric actuators, 2000",
    similar_to="exponential-creep",
    distinguished_by="the output continues at constant input, by equal steps in each decade of time",
    occurs_in="piezoelectric stacks and ferroelectric materials",
)
