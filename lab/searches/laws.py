"""Recommended model of 24 simulated laws with known terms, and an ablation of the rule that recommends it.

    python -m lab.searches.laws [--seeds 0 1] [--samples 2000] [--laws tank friction]

Every law is simulated without noise and with noise of 0.3 and 1 % of the standard deviation of its output,
identified with a small search, and tested on another record with the same noise. Other rules choose among the
same models. Results are printed, not asserted.
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, log, sqrt

import numpy as np
from numpy.typing import NDArray

import islands
from islands.evolution.search_result import SearchResult
from islands.facade.results.fitted_model import FittedModel
from islands.records.dataset import Dataset
from islands.rounding import RESOLUTION
from islands.simulation.predictors import free_run
from islands.validation.assessment import Assessment
from islands.validation.metrics import metrics
from islands.validation.recommendation import is_sound
from support.laws import LAWS, Law

#: Noise as a fraction of the standard deviation of the output.
LEVELS = (0.0, 0.003, 0.01)

#: Seeds of the test records differ from those of the records by this number.
_TEST = 1000

#: Largest ratio of the test error to the least test error of all models.
_CLOSE = 1.2

#: Largest number of consecutive blocks of the validation data whose errors are compared between models.
_BLOCKS = 20

Rule = Callable[[SearchResult], int]


@dataclass(frozen=True)
class Case:
    """One search: which model each rule chooses, which models are exact, and their test errors.

    Attributes
    ----------
    sizes, exact, errors : sequence
        Number of terms, whether the terms are those of the law, and RMSE of the free run on the test record,
        by position.
    chosen : mapping
        Position of the chosen model by rule.
    rounding : float
        RMSE below which errors are equal.
    """

    law: str
    level: float
    seed: int
    sizes: Sequence[int]
    exact: Sequence[bool]
    errors: Sequence[float]
    chosen: Mapping[str, int]
    rounding: float

    def ratio(self, rule: str) -> float:
        """Ratio of the test error of the chosen model to the least one."""
        return max(self.errors[self.chosen[rule]], self.rounding) / max(min(self.errors), self.rounding)


def compare_blocks(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean squared errors of two models on blocks of the samples that both predict.

    Parameters
    ----------
    one, other : ndarray, shape (samples,)
        As of `square_errors`, on the same validation data. The numbers of samples differ if the samples
        are means of different numbers of samples; samples at the same part of the data are then compared.

    Returns
    -------
    ndarray, shape (2, blocks)
        At most `_BLOCKS` consecutive blocks; none if no sample is predicted by both.
    """
    common = [_select_common(one, other), _select_common(other, one)]
    count = min(_BLOCKS, *map(len, common))
    blocks = [np.array_split(errors, count) if count else [] for errors in common]
    return np.array([[np.add.reduce(block) / len(block) for block in each] for each in blocks])


def square_errors(entry: Assessment) -> NDArray[np.float64]:
    """Return the squared errors of the free run on the validation data; none after a divergence."""
    errors = entry.errors[entry.split.estimation.samples :]
    return errors[:0] if np.isinf(errors).any() else errors**2


def _select_common(errors: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the errors at the samples that both models predict."""
    if not (len(errors) and len(others)):
        return np.empty(0)
    at = (2 * np.arange(len(errors)) + 1) * len(others) // (2 * len(errors))  # middle of the sample
    return errors[~(np.isnan(errors) | np.isnan(others[at]))]


def sound(found: SearchResult) -> list[int]:
    """Return the positions of the models that every rule may choose."""
    bounded = [at for at, entry in enumerate(found.models) if square_errors(entry).size]
    checked = [at for at in bounded if is_sound(found.models[at].physics, found.requires_property_1)]
    return checked or bounded or [0]


def error(entry: Assessment) -> float:
    """Return the RMSE of the free run on the validation data as a fraction of the output range."""
    squared = square_errors(entry)
    return sqrt(np.mean(compare_blocks(squared, squared)[0])) if squared.size else inf


def least_error(found: SearchResult) -> int:
    """Choose the least validation error."""
    return min(sound(found), key=lambda at: error(found.models[at]))


def one_standard_error(found: SearchResult) -> int:
    """Choose the smallest model within one standard error of the least error (Breiman)."""
    squared = square_errors(found.models[least_error(found)])
    blocks = compare_blocks(squared, squared)[0]
    limit = max(RESOLUTION**2, blocks.mean() + blocks.std(ddof=1) / sqrt(len(blocks)))
    return min(
        (at for at in sound(found) if error(found.models[at]) ** 2 <= limit),
        key=lambda at: found.models[at].model.size,
    )


def paired(standard_errors: float) -> Rule:
    """Return the rule of paired differences without bounds on the excess."""

    def choose(found: SearchResult) -> int:
        best = least_error(found)
        least = square_errors(found.models[best])
        equal = []
        for at in sound(found):
            blocks = compare_blocks(square_errors(found.models[at]), least)
            excess = blocks[0] - blocks[1]
            limit = standard_errors * excess.std(ddof=1) / sqrt(len(excess))
            if excess.mean() <= max(limit, 0.0) or error(found.models[at]) <= RESOLUTION:
                equal.append(at)
        return min(equal, key=lambda at: found.models[at].model.size)

    return choose


def effective_samples(residual: NDArray[np.float64]) -> float:
    """Return the number of independent samples with the information of a correlated residual."""
    centred = residual - residual.mean()
    lags = min(50, len(centred) // 4)
    products = np.array([centred[: len(centred) - lag] @ centred[lag:] for lag in range(lags)])
    return len(centred) / (1.0 + 2.0 * float(np.sum((products[1:] / products[0]) ** 2)))


def description_length(effective: bool) -> Rule:
    """Return the Bayesian information criterion of the free run on the validation data."""

    def choose(found: SearchResult) -> int:
        best = found.models[least_error(found)]
        data = found.split.validation
        residual = data.y - free_run(best.model, data, best.warm_up).y
        residual = residual[~np.isnan(residual)]
        known = effective and np.ptp(residual) > 0
        count = effective_samples(residual) if known else len(residual)

        def length(at: int) -> float:
            squared = error(found.models[at]) ** 2 + RESOLUTION**2
            return count * log(squared) + found.models[at].model.size * log(count)

        return min(sound(found), key=length)

    return choose


RULES: Mapping[str, Rule] = {
    "recommended": lambda found: found.recommendation.rank - 1,
    "least validation error": least_error,
    "one standard error of the least": one_standard_error,
    "one standard error, paired": paired(1.0),
    "two standard errors, paired": paired(2.0),
    "description length": description_length(False),
    "description length, effective samples": description_length(True),
}


def run(name: str, law: Law, level: float, seed: int, samples: int) -> Case:
    """Identify one record of a law and apply every rule."""
    record, test = law.record(samples, level, seed), law.record(samples, level, seed + _TEST)
    settings = dict(law.search)
    result = islands.identify(record, preset=settings.pop("preset"), seed=seed, **settings)
    return Case(
        name,
        level,
        seed,
        [model.model.size for model in result.models],
        [law.has_terms_of(model.model, record) for model in result.models],
        [test_error(model, test) for model in result.models],
        {rule: choose(result.search_result) for rule, choose in RULES.items()},
        RESOLUTION * record.output_range,
    )


def test_error(model: FittedModel, record: Dataset) -> float:
    """Return the RMSE of the free run on the test record."""
    simulated = model.simulate(record)
    return metrics(record.y, simulated.y).rmse if simulated.outcome else inf


def mark(case: Case) -> str:
    """Return whether the recommended model has the true terms, as `print_cases` shows it."""
    if case.exact[case.chosen["recommended"]]:
        return "*"
    return "." if any(case.exact) else "-"


def print_cases(cases: Sequence[Case]) -> None:
    """Print the recommended sizes by seed and the largest ratio of the test error to the least one.

    A star marks the true terms, a dot other terms although the true ones are among the models, and a dash
    other terms because they are not.
    """
    print(f"{'law':24}{'noise':10}" + "".join(f"{100 * level:>16g} %" for level in LEVELS))
    for name, law in LAWS.items():
        cells = []
        for level in LEVELS:
            own = [case for case in cases if (case.law, case.level) == (name, level)]
            marks = "".join(mark(case) for case in own if law.in_vocabulary)
            sizes = ",".join(str(case.sizes[case.chosen["recommended"]]) for case in own)
            worst = max((case.ratio("recommended") for case in own), default=0.0)
            cells.append(f"{sizes} {marks} {worst:.2f}".rjust(18))
        if any(case.law == name for case in cases):
            print(f"{name:24}{law.noise if law.in_vocabulary else 'inexact':10}{''.join(cells)}")


def print_rules(cases: Sequence[Case]) -> None:
    """Print the share of true terms by noise and the test errors, by rule."""
    inside = [case for case in cases if LAWS[case.law].in_vocabulary]
    print(f"\n{'rule':40}{'true terms:':>11}" + "".join(f"{100 * level:7g} %" for level in LEVELS), end="")
    print(f"{'of found':>10}{'test <= 1.2':>13}{'worst':>8}{'size':>6}")
    for rule in RULES:
        shares = [
            np.mean([case.exact[case.chosen[rule]] for case in inside if case.level == level] or [np.nan])
            for level in LEVELS
        ]
        present = [case.exact[case.chosen[rule]] for case in inside if any(case.exact)]
        ratios = np.array([case.ratio(rule) for case in cases])
        size = np.mean([case.sizes[case.chosen[rule]] for case in cases])
        print(f"{rule:40}{'':11}" + "".join(f"{share:9.2f}" for share in shares), end="")
        print(f"{np.mean(present):10.2f}{np.mean(ratios <= _CLOSE):13.3f}{ratios.max():8.2f}{size:6.1f}")


def main() -> None:
    """Run the cases and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    parser.add_argument("--samples", type=int, default=2000)
    parser.add_argument("--laws", nargs="+", default=list(LAWS), choices=LAWS, metavar="LAW")
    options = parser.parse_args()
    cases = [
        run(name, LAWS[name], level, seed, options.samples)
        for seed in options.seeds
        for name in options.laws
        for level in LEVELS
    ]
    print_cases(cases)
    print_rules(cases)


if __name__ == "__main__":
    main()
