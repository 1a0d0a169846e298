"""Compare planned log-likelihood ratios with those of fits to simulated data in coloured noise.

``python -m lab.diagnosis.planned_ratios [--seeds N] [--noise KIND]`` measures noise in one record without a
cause, and plans with its noise model, and with white noise of the same standard deviation. It hides a cause
of at most 1 sigma in other records, and calibrates it and every other effect to them: whitened with the noise
model of the true cause's residual, and as a diagnosis does, which fits a noise model to the residual of each
effect. It prints the quotient of the mean realised ratio and the planned one, of all pairs of causes with a
realised ratio in `RANGE`: the median, and the quantiles at 10 % and 90 %.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import calibrate, evaluate_fit, whiten_target
from islands.diagnosis.calibration.preparation import make_target
from islands.diagnosis.planning.cause import Cause, CauseScale
from islands.diagnosis.planning.experiment import Experiment, ExperimentModel
from islands.diagnosis.planning.noise_free_fit import NoiseFreeFit, fit_noise_free
from islands.diagnosis.planning.response_dictionary import ResponseDictionary
from islands.effects.interface.effect import Effect
from islands.records.dataset import Dataset
from lab.diagnosis.injection.noise import NOISES
from lab.diagnosis.planned_experiments import EXPERIMENTS, NoisePlans, make_plans

#: Kinds of noise, and the number of records of each cause.
KINDS, SEEDS = ("white", "ar", "slow-ar", "pink"), 5

#: Realised ratios that are compared. Smaller ones are chance, and larger ones decide nothing.
RANGE = (10.0, 300.0)

#: Misfits of causes, the first of which that the bounds allow is taken.
MISFITS = (1.0, 0.5, 0.25, 0.1)

#: Seed of the noise.
SEED = 53

#: Columns of the realised ratios.
WHITENED, DIAGNOSED = 0, 1


@dataclass(frozen=True)
class Comparison:
    """Planned ratio of a pair of causes by the noise of the plan, and the realised ones, shape (2,)."""

    planned: dict[str, float]
    realised: np.ndarray


def compare(plans: NoisePlans, seeds: Sequence[int]) -> Iterator[Comparison]:
    """Hide causes in simulated records, and calibrate all effects to them."""
    dictionaries = {name: ResponseDictionary(each) for name, each in plans.experiments.items()}
    first = next(iter(dictionaries.values()))
    for effect in plans.effects:
        if effect.name not in plans.planned.causes:
            continue
        scale = CauseScale(first, effect)
        cause = next(found for misfit in MISFITS if (found := scale.find_cause(misfit)))
        model = first.get_model(effect)
        true_values = model.insert(effect, cause.values)
        others = [each for each in plans.effects if each.cause != effect.cause]
        planned: list[dict[str, float]] = [{} for _ in others]
        starts: list[np.ndarray] = []
        for name, dictionary in dictionaries.items():
            same = CauseScale(dictionary, effect).make_cause(cause.values)
            assert same is not None
            without = same.whitened_misfit**2 * dictionary.experiment.estimation_samples
            fits = [_fit(dictionary, same, other) for other in others]
            starts = starts or [fit.values for fit in fits]
            for ratios, fit in zip(planned, fits, strict=True):
                ratios[name] = min(fit.squared_distance, without)
        hypotheses = [(model, true_values), (first.without, first.without.output.nominal)]
        hypotheses += [(first.get_model(each), values) for each, values in zip(others, starts, strict=True)]
        costs = np.array([_calibrate(plans, hypotheses, seed) for seed in seeds])
        ratios = np.mean(np.minimum(costs[:, 2:], costs[:, 1:2]) - costs[:, :1], axis=0)
        yield from map(Comparison, planned, ratios)


def _fit(dictionary: ResponseDictionary, cause: Cause, other: Effect) -> NoiseFreeFit:
    model = dictionary.get_model(other)
    starts = dictionary.find_starts(other, cause.observed) or [model.output.nominal]
    return fit_noise_free(model, cause.observed, starts)


def _calibrate(
    plans: NoisePlans, hypotheses: Sequence[tuple[ExperimentModel, np.ndarray]], seed: int
) -> np.ndarray:
    """Calibrate hypotheses to a record of the first one.

    Returns
    -------
    ndarray, shape (hypotheses, 2)
        Minus twice the log-likelihoods, with the noise model of the true cause, and each with that of its
        residual.
    """
    (model, values), *_ = hypotheses
    experiment: Experiment = model.experiment
    y = model.output.simulate(values)
    noise = plans.size * NOISES[plans.kind](np.random.default_rng([seed, SEED]), plans.clean)
    record = Dataset(u=plans.planned.u, y=y + noise, dt=plans.planned.dt)
    target = make_target(record, experiment.estimation_samples, experiment.prior_std)
    target = whiten_target(target, evaluate_fit(model.output, target, values))
    assert target.noise is not None
    start = target.noise.order  # the first samples have no complete predictor
    fits = [calibrate(each.output, target, near) for each, near in hypotheses]
    squares = [float(np.sum(target.residual(fit.output)[start:] ** 2)) for fit in fits]
    variance = squares[0] / (experiment.estimation_samples - start)
    return np.array(
        [(each / variance + fit.penalty, fit.score) for each, fit in zip(squares, fits, strict=True)]
    )


def main() -> None:
    """Print the comparison."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--noise", choices=tuple(NOISES), action="append")
    given = parser.parse_args()
    for kind in given.noise or KINDS:
        found: list[Comparison] = []
        for planned in EXPERIMENTS.values():
            found += compare(make_plans(planned, kind), range(given.seeds))
        for column, name in ((WHITENED, "whitened fits"), (DIAGNOSED, "diagnosis")):
            kept = [each for each in found if RANGE[0] < each.realised[column] < RANGE[1]]
            for plan in found[0].planned:
                quotients = [each.realised[column] / max(each.planned[plan], 1e-3) for each in kept]
                low, middle, high = np.quantile(quotients, (0.1, 0.5, 0.9))
                print(f"{kind:10s}{name:14s}/ plan with {plan:8s} noise: {middle:5.2f}", end=" ")
                print(f"({low:.2f} to {high:.2f}), {len(kept)} pairs", flush=True)


if __name__ == "__main__":
    main()
