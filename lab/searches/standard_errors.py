"""Coverage of 95 % intervals and bias, for every kind of noise and every estimator.

Run it by hand: ``python -m lab.searches.standard_errors --records 400``. It prints, for every parameter
of a bilinear system, the fraction of records whose interval of 1.96 standard errors contains the true value,
the standard deviation of the estimates divided by the standard error, and the bias divided by the true value.
"""

import argparse

import numpy as np

from islands.estimation.estimate import estimate
from islands.estimation.estimator_table import ESTIMATORS
from islands.estimation.estimators import estimate_with
from islands.expressions.parsing import parse
from islands.models.regressor import regressor
from islands.simulation.outcome import EvaluationOutcome
from support.noisy_records import NOISES, TERMS, TRUE, coverage, make_noisy_record

#: The estimator that is recommended for every kind of noise, and the coverage that it must reach.
RECOMMENDED = {"equation": "least-squares", "output": "free-run", "arma": "extended-least-squares"}
GOAL = (0.92, 0.98)


def main() -> None:
    """Print one line per kind of noise and estimator."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=400, help="records per kind of noise")
    parser.add_argument("--samples", type=int, default=3000, help="samples of a record")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--noise", choices=NOISES, action="append", help="all by default")
    arguments = parser.parse_args()
    structure = [regressor(parse(text))[1] for text in TERMS]
    estimators = [(name, 100) for name in ESTIMATORS if name != "shooting"]
    estimators[-1:-1] = [("shooting", 20), ("shooting", 100)]
    print(f"parameters of {', '.join(TERMS)}: {TRUE}; * is the recommended estimator")
    print(
        f"{'noise':9} {'estimator':24} {'coverage':18} {'sd / se':18} {'bias / true':24} least-squares bias"
    )
    for noise in arguments.noise or NOISES:
        models, biases = {key: [] for key in estimators}, {key: [] for key in estimators}
        for seed in range(arguments.first_seed, arguments.first_seed + arguments.records):
            record = make_noisy_record(noise, seed, arguments.samples)
            start = estimate(structure, record)
            for key in estimators:
                found = estimate_with(key[0], start, record, shooting=key[1])
                if isinstance(found, EvaluationOutcome):
                    raise SystemExit(f"{key} failed on seed {seed}: {found}")
                models[key].append(found.model)
                biases[key].append(found.least_squares_bias or 0.0)
        for key in estimators:
            theta = np.array([model.theta for model in models[key]])
            errors = np.array([model.standard_errors for model in models[key]])
            covered = coverage(models[key])
            recommended = RECOMMENDED[noise] == key[0]
            missed = recommended and not all(GOAL[0] <= value <= GOAL[1] for value in covered)
            name = f"{key[0]} {key[1]}" if key[0] == "shooting" else key[0]
            print(
                f"{noise:9} {name + ' *' * recommended:24} {_numbers(covered, 3):18} "
                f"{_numbers(theta.std(axis=0) / np.sqrt(np.mean(errors**2, axis=0)), 2):18} "
                f"{_numbers(theta.mean(axis=0) / TRUE - 1.0, 4):24} "
                f"{np.median(biases[key]):.1f}{'  MISSED' * missed}",
                flush=True,
            )


def _numbers(values: np.ndarray, digits: int) -> str:
    return " ".join(f"{value:.{digits}f}" for value in values)


if __name__ == "__main__":
    main()
