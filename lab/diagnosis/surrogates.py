"""Surrogate records: output of the calibrated simulation plus noise, with or without an injected effect."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from islands.diagnosis.calibration.preparation import select_effects
from islands.diagnosis.detectability import STRENGTHS, Injection
from islands.diagnosis.inference.screening import transfer_parameters
from islands.diagnosis.result import Diagnosis
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect
from islands.records.dataset import Dataset
from islands.records.noise_model import NoiseModel, fit_noise
from islands.records.segments import count_runs
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.interface import Simulator

#: Maximum number of doublings or halvings of a strength, relative to the starting point of the effect.
_MAX_DOUBLINGS = 30

#: Number of bisections of the interval that contains a misfit.
_BISECTIONS = 7

#: Minimum length of a record in time constants of its noise; slower noise is drift.
_MIN_TIME_CONSTANTS = 10.0


@dataclass(frozen=True, slots=True)
class SurrogateCase:
    """A surrogate to be diagnosed, given by its injection and the seed of its noise.

    A surrogate without an injection is clean.
    """

    injection: Injection | None
    seed: int


@dataclass(frozen=True, slots=True, eq=False)
class Surrogates:
    """Generator of surrogates of a diagnosed record.

    Attributes
    ----------
    record : Dataset
    simulator, prior_std : Simulator, mapping
        Simulator and tolerances of the diagnosis.
    simulation : ExtendedSimulator
        The simulation without effects.
    values : ndarray, shape (parameters,)
        Values of the simulation.
    noise : NoiseModel
        Noise model of the residual, with limited time constants.
    sigma : float
        Standard deviation of the residual.
    estimation_samples : int
        Number of samples used for estimation.
    """

    record: Dataset
    simulator: Simulator
    prior_std: Mapping[str, float]
    simulation: ExtendedSimulator
    values: Signal
    noise: NoiseModel
    sigma: float
    estimation_samples: int

    def simulate(self, effect: Effect | None = None, values: Sequence[float] = ()) -> Signal:
        """Return the output without noise, with at most one effect."""
        if effect is None:
            return self.simulation.simulate(self.values)
        extended = self.simulation.with_effects([effect])
        extended_values = transfer_parameters(self.values, self.simulation, extended)
        extended_values[extended.get_slice(effect)] = extended.expand(effect, values)
        return extended.simulate(extended_values)

    @property
    def effects(self) -> Mapping[str, Effect]:
        """Effects of the catalogue that are applicable to the simulation, by name."""
        effects = select_effects(self.simulation.simulator, self.simulation.context, self.prior_std)
        return {effect.name: effect for effect in effects}

    def draw_noise(self, seed: int) -> Signal:
        """Draw the noise of a surrogate; that of different recordings is independent."""
        warm_up = self.record.samples
        # The stream differs from that of the diagnosis with the same seed.
        rng = np.random.default_rng([seed, 1])
        parts = [
            self.noise.colour(rng.standard_normal(warm_up + length))[warm_up:]
            for length in self.record.segments
        ]
        noise: Signal = np.sqrt(self.noise.variance) * np.concatenate(parts)
        return noise

    def draw_record(self, case: SurrogateCase) -> Dataset:
        """Draw the surrogate record of a case."""
        injection = case.injection
        simulated = (
            self.simulate()
            if injection is None
            else self.simulate(self.effects[injection.effect], injection.values)
        )
        y = simulated + self.draw_noise(case.seed)
        return replace(self.record, y=np.where(np.isnan(self.record.y), np.nan, y))


def make_surrogates(diagnosis: Diagnosis, simulator: Simulator, tolerance: Mapping[str, float]) -> Surrogates:
    """Make the generator of surrogates of a diagnosed record.

    Clean surrogates follow the simulation without effects. If the diagnosis named effects, the values of the
    simulation are those calibrated together with them, and the noise is the residual of the extended
    simulation. A surrogate thus has no cause but the injected one, and a named cause is not part of its
    noise.
    """
    best = diagnosis.best
    simulation = best.simulation.with_effects(())
    residual = (diagnosis.record.y - best.output)[: diagnosis.estimation_samples]
    is_known = ~np.isnan(residual)
    residual, runs = residual[is_known], count_runs(is_known, diagnosis.record.segments)
    return Surrogates(
        diagnosis.record,
        simulator,
        tolerance,
        simulation,
        transfer_parameters(best.values, best.simulation, simulation),
        fit_noise(residual, segments=runs).limit_poles(diagnosis.record.samples / _MIN_TIME_CONSTANTS),
        float(np.sqrt(np.mean(residual**2))),
        diagnosis.estimation_samples,
    )


def injection_strengths(
    surrogates: Surrogates, effect: Effect, rng: np.random.Generator
) -> tuple[Injection, ...]:
    """Return injections of one effect in order of increasing strength.

    The shape is a random starting point of the effect, with a random sign if both are allowed. The strengths
    are the smallest ones with the misfits `STRENGTHS`. Effects that cannot reach a misfit yield fewer
    injections.
    """
    context = surrogates.simulation.context
    parameters = effect.parameters(context)
    points = effect.starting_points(context, surrogates.draw_noise(int(rng.integers(2**32))))
    point = np.array(points[int(rng.integers(len(points)))], dtype=np.float64)
    scaled = slice(0, max(effect.linear_parameters, 1))
    lower = np.array([parameter.lower for parameter in parameters[scaled]])
    upper = np.array([parameter.upper for parameter in parameters[scaled]])
    if rng.random() < 0.5 and (-point[scaled] >= lower).all():
        point[scaled] *= -1.0
    limits = np.where(point[scaled] > 0.0, upper, lower)
    is_nonzero = point[scaled] != 0.0
    max_factor = min(
        2.0**_MAX_DOUBLINGS, float(np.min(limits[is_nonzero] / point[scaled][is_nonzero], initial=inf))
    )
    without_effect = surrogates.simulate()

    def make_injection(factor: float) -> Injection:
        values = point.copy()
        values[scaled] *= factor
        simulated = surrogates.simulate(effect, values.tolist())
        change = (simulated - without_effect)[: surrogates.estimation_samples]
        with np.errstate(over="ignore", invalid="ignore"):  # a simulation that diverges has infinite misfit
            misfit = float(np.sqrt(np.mean(change**2))) / max(surrogates.sigma, np.finfo(float).tiny)
        size = float(np.linalg.norm(values[scaled]))
        return Injection(
            *(effect.name, tuple(values.tolist()), size, parameters[0].unit),
            misfit if np.isfinite(misfit) else inf,
        )

    low = min(1.0, max_factor)
    while make_injection(low).misfit >= STRENGTHS[0] and low > 2.0**-_MAX_DOUBLINGS:
        low /= 2
    injections: list[Injection] = []
    for misfit in STRENGTHS:
        if injections and injections[-1].misfit >= misfit:
            continue  # the previous injection already exceeds this misfit
        high = low
        while (injection := make_injection(high)).misfit < misfit:
            if high >= max_factor:
                return tuple(injections)
            low, high = high, min(2 * high, max_factor)
        for _ in range(_BISECTIONS):
            middle = float(np.sqrt(low * high))
            tried = make_injection(middle)
            if tried.misfit < misfit:
                low = middle
            else:
                high, injection = middle, tried
        if injection.misfit == inf:
            return tuple(injections)
        injections.append(injection)
        low = high
    return tuple(injections)
