"""Surrogates: what a record would be if the simulation were right, and with an effect put into it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np
import scipy

from islands.data.dataset import Dataset
from islands.discrepancy.calibration.noise_model import NoiseModel, fit_ar_noise
from islands.discrepancy.calibration.preparation import select_effects
from islands.discrepancy.diagnosis import Diagnosis
from islands.discrepancy.inference.screening import transfer_parameters
from islands.discrepancy.interfaces.effect import Effect, Signal
from islands.discrepancy.interfaces.simulator import Simulator
from islands.discrepancy.simulators.extended import ExtendedSimulator

#: Misfits of what is injected, in standard deviations of the residual.
STRENGTHS = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.4)

#: Doublings of a strength from the grid's, either way, and halvings of the interval in which a misfit lies.
_DOUBLINGS, _HALVINGS = 30, 7

#: Time constants of the noise that a record holds at the least: noise that remembers longer is no noise.
_MEMORIES = 10.0


@dataclass(frozen=True, slots=True)
class Injection:
    """An effect that is put into a surrogate.

    Attributes
    ----------
    effect : str
    values : tuple of float
        Of its parameters.
    strength, unit : float, str
        Its size without a sign, in the effect's own unit.
    misfit : float
        Root mean square of what it changes over the fitted samples, in standard deviations of the residual.
    """

    effect: str
    values: tuple[float, ...]
    strength: float
    unit: str
    misfit: float

    @property
    def cause(self) -> str:
        """The effect's name in the catalogue: without the state or the parameter that it is about."""
        return self.effect.partition(":")[0]


@dataclass(frozen=True, slots=True)
class SurrogateCase:
    """One surrogate to be diagnosed; without an injection it is a clean one."""

    injection: Injection | None
    seed: int


@dataclass(frozen=True, slots=True, eq=False)
class Surrogates:
    """What surrogates of a record are drawn from.

    Attributes
    ----------
    record : Dataset
    simulator, prior_std : Simulator, mapping
        As they were diagnosed.
    simulation : ExtendedSimulator
        Without effects.
    values : ndarray, shape (parameters,)
        Of the simulation.
    noise : NoiseModel
    sigma : float
        The residual's standard deviation.
    estimation_samples : int
        Samples that estimation sees.
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
        """Return the output without noise, with one effect in it or with none."""
        if effect is None:
            return self.simulation.simulate(self.values)
        extended = self.simulation.with_effects([effect])
        moved = transfer_parameters(self.values, self.simulation, extended)
        moved[extended.get_slice(effect)] = values
        return extended.simulate(moved)

    @property
    def effects(self) -> Mapping[str, Effect]:
        """What could enter the simulation, by name."""
        offered = select_effects(self.simulation.simulator, self.simulation.context, self.prior_std)
        return {effect.name: effect for effect in offered}

    def draw_noise(self, seed: int) -> Signal:
        """Draw the noise of a surrogate."""
        samples = self.record.samples
        # Apart from what the analysis draws by the same seed. The first half warms the memory up.
        white = np.random.default_rng([seed, 1]).standard_normal(2 * samples)
        filtered = scipy.signal.lfilter([1.0], np.concatenate([[1.0], -self.noise.coefficients]), white)
        drawn: Signal = np.sqrt(self.noise.variance) * filtered[samples:]
        return drawn

    def draw_record(self, probe: SurrogateCase) -> Dataset:
        """Return the surrogate of a probe."""
        injection = probe.injection
        simulated = (
            self.simulate()
            if injection is None
            else self.simulate(self.effects[injection.effect], injection.values)
        )
        return replace(self.record, y=simulated + self.draw_noise(probe.seed))


def make_surrogates(diagnosis: Diagnosis, simulator: Simulator, tolerance: Mapping[str, float]) -> Surrogates:
    """Return what surrogates of a diagnosed record are drawn from.

    Clean means: the simulation without effects is the truth. Where some were named it is the one that was
    calibrated beside them, and they are taken off; its noise is what the simulation with them leaves. So no
    surrogate has a cause in it that was not put there, and noise is not blamed for one that was named.
    """
    best = diagnosis.best
    simulation = best.simulation.with_effects(())
    left = (diagnosis.record.y - best.output)[: diagnosis.estimation_samples]
    return Surrogates(
        diagnosis.record,
        simulator,
        tolerance,
        simulation,
        transfer_parameters(best.values, best.simulation, simulation),
        _fading(fit_ar_noise(left), diagnosis.record.samples),
        float(np.sqrt(np.mean(left**2))),
        diagnosis.estimation_samples,
    )


def injection_strengths(
    source: Surrogates, effect: Effect, rng: np.random.Generator
) -> tuple[Injection, ...]:
    """Return injections of one effect, each stronger than the one before.

    Its shape is a point of its grid, and its sign one of those that it may have, both by lot. Strengths are
    those at which the misfit first comes to each of `STRENGTHS`; who cannot do so ends earlier.
    """
    context = source.simulation.context
    parameters = effect.parameters(context)
    grid = effect.starting_points(context, source.draw_noise(int(rng.integers(2**32))))
    point = np.array(grid[int(rng.integers(len(grid)))], dtype=np.float64)
    sized = slice(0, max(effect.linear_parameters, 1))
    lower = np.array([parameter.lower for parameter in parameters[sized]])
    upper = np.array([parameter.upper for parameter in parameters[sized]])
    if rng.random() < 0.5 and (-point[sized] >= lower).all():
        point[sized] *= -1.0
    ends = np.where(point[sized] > 0.0, upper, lower)
    moving = point[sized] != 0.0
    farthest = min(2.0**_DOUBLINGS, float(np.min(ends[moving] / point[sized][moving], initial=inf)))
    at_rest = source.simulate()

    def injected(factor: float) -> Injection:
        values = point.copy()
        values[sized] *= factor
        changed = (source.simulate(effect, values.tolist()) - at_rest)[: source.estimation_samples]
        with np.errstate(over="ignore", invalid="ignore"):  # what explodes is too much
            misfit = float(np.sqrt(np.mean(changed**2))) / max(source.sigma, np.finfo(float).tiny)
        size = float(np.linalg.norm(values[sized]))
        return Injection(
            *(effect.name, tuple(values.tolist()), size, parameters[0].unit),
            misfit if np.isfinite(misfit) else inf,
        )

    low = min(1.0, farthest)
    while injected(low).misfit >= STRENGTHS[0] and low > 2.0**-_DOUBLINGS:
        low /= 2
    found: list[Injection] = []
    for wanted in STRENGTHS:
        if found and found[-1].misfit >= wanted:
            continue  # it has leapt over this one
        high = low
        while (there := injected(high)).misfit < wanted:
            if high >= farthest:
                return tuple(found)
            low, high = high, min(2 * high, farthest)
        for _ in range(_HALVINGS):
            middle = float(np.sqrt(low * high))
            tried = injected(middle)
            if tried.misfit < wanted:
                low = middle
            else:
                high, there = middle, tried
        if there.misfit == inf:
            return tuple(found)
        found.append(there)
        low = high
    return tuple(found)


def _fading(noise: NoiseModel, samples: int) -> NoiseModel:
    """Return a noise that forgets within a record: one that was fitted to a drift may not, or may explode."""
    if noise.order == 0:
        return noise
    slowest = float(np.max(np.abs(np.roots(np.concatenate([[1.0], -noise.coefficients])))))
    most = 1.0 - _MEMORIES / samples
    if slowest <= most:
        return noise
    return replace(noise, coefficients=noise.coefficients * (most / slowest) ** np.arange(1, noise.order + 1))
