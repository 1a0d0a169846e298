"""Evolution against a swap search of at least equal time, on laws with terms outside its libraries.

    python -m lab.searches.evolution_gain [--seeds 0 1 ...] [--laws drag ...] [--set name=value ...]

The evolution starts from the swap search over polynomials of degree 3 and lags up to 3; its functions are
the same for all laws. The swap search alone takes larger and larger libraries until it has used the CPU time
of the evolution, and the best of its models by validation error counts. The figure is the RMSE of the free
run on a test record that takes no part in any selection. Results are printed, not asserted.
"""

import argparse
from collections.abc import Mapping, Sequence
from statistics import median
from time import process_time
from typing import Any

import numpy as np

import islands
from islands.facade.results.fitted_model import FittedModel
from islands.records.dataset import Dataset
from support.laws import Law

_UNIT = ((-2.0, 2.0),)
_PAIR = ((-2.0, 2.0), (-2.0, 2.0))

#: Laws with a term that no polynomial of degree 3 and lags up to 3 contains.
LAWS: Mapping[str, Law] = {
    "saturated input": Law({"y(k-1)": 0.8, "tanh(2*u(k-1))": 0.5}, _UNIT),
    "drag": Law({"y(k-1)": 0.95, "y(k-1)*abs(y(k-1))": -0.05, "u(k-1)": 0.3}, _UNIT),
    "outflow": Law({"y(k-1)": 1.0, "sqrt(y(k-1))": -0.1, "u(k-1)": 0.1}, ((0.2, 2.0),)),
    "pendulum": Law({"y(k-1)": 1.7, "y(k-2)": -0.8, "sin(y(k-1))": -0.15, "u(k-1)": 0.3}, _UNIT),
    "rotated input": Law({"y(k-1)": 0.7, "u(k-1)*cos(y(k-2))": 0.5}, _UNIT),
    "fourth degree": Law({"y(k-1)": 0.8, "u1(k-1)": 0.3, "u1(k-1)*u1(k-2)*u2(k-1)*u2(k-2)": 0.1}, _PAIR),
    "dead time": Law({"y(k-1)": 0.7, "u(k-7)": 0.3, "u(k-7)*y(k-2)": 0.1}, _UNIT),
    "rectifier": Law({"y(k-1)": 0.6, "max(u1(k-1), u2(k-1))": 0.3}, _PAIR),
    "distance": Law({"y(k-1)": 0.7, "u(k-1)": 0.3, "abs(u(k-1) - y(k-1))": -0.2}, _UNIT),
    "friction": Law({"y(k-1)": 0.9, "u(k-1)": 0.3, "sign(y(k-1) - y(k-2))": -0.1}, _UNIT),
}

#: Settings of the evolution, the same for all laws.
SETTINGS: Mapping[str, Any] = {
    "preset": "narx",
    "primitives": ("mul", "add", "sub", "abs", "sign", "sqrt", "sin", "cos", "tanh", "max", "min"),
    "max_terms": 6,
    "feedthrough": "no",
}

#: Degree and lags of the libraries of the swap search alone.
LIBRARIES = ((3, 3), (2, 8), (3, 4), (4, 3), (3, 5), (4, 4), (5, 3), (3, 8))

_SAMPLES = 2000
_NOISE = 1e-3

#: Distance between the seed of a record and that of its test record.
_TEST = 1_000_000


def measure_error(fitted: FittedModel, record: Dataset) -> float:
    """Return the RMSE of the free run as a fraction of the output's range; infinite after a divergence."""
    run = fitted.simulate(record)
    return float(np.sqrt(run.mean_squared_error)) / record.output_range if run.outcome else float("inf")


def validation_error(fitted: FittedModel) -> float:
    """Return the RMSE of the free run on the validation data."""
    return float(fitted.metrics["validation"]["free_run"].rmse)


def search_swaps(record: Dataset, seconds: float) -> FittedModel:
    """Fit over one library after the other until the time is over; return the best model by validation."""
    found: list[FittedModel] = []
    started = process_time()
    for degree, lags in LIBRARIES:
        settings = {"library": "polynomial", "degree": degree, "lags": lags, "shooting": 100}
        found += islands.fit(record, max_terms=SETTINGS["max_terms"], feedthrough="no", **settings).models
        if process_time() - started > seconds:
            break
    return min(found, key=validation_error)


def compare(name: str, seed: int, changes: Mapping[str, Any]) -> tuple[float, float]:
    """Return the test errors of evolution and swap search on one record of a law, and print them."""
    law = LAWS[name]
    record, test = law.record(_SAMPLES, _NOISE, seed), law.record(_SAMPLES, _NOISE, seed + _TEST)
    started = process_time()
    result = islands.identify(record, seed=seed, **{**SETTINGS, **changes})
    evolved, seconds = min(result.models, key=validation_error), process_time() - started
    swapped = search_swaps(record, seconds)
    errors = measure_error(evolved, test), measure_error(swapped, test)
    exact = any(law.has_terms_of(each.model, record) for each in result.models)
    print(
        f"{name:16} seed {seed:4}  evolution {errors[0]:.5f} ({seconds:.0f} s, {evolved.model.size} terms"
        f"{', exact' if exact else ''})  swaps {errors[1]:.5f} ({process_time() - started - seconds:.0f} s)"
        f"  {evolved.equation}",
        flush=True,
    )
    return errors


def measure(laws: Sequence[str], seeds: Sequence[int], changes: Mapping[str, Any]) -> None:
    """Print the errors of every law and seed, and on how many laws the evolution is better."""
    better = 0
    found = {name: [compare(name, seed, changes) for seed in seeds] for name in laws}
    for name, errors in found.items():
        ratios = sorted(evolved / swapped for evolved, swapped in errors)
        better += median(ratios) < 1.0
        print(f"{name:16} evolution / swaps: median {median(ratios):.3f}, worst {ratios[-1]:.3f}")
    print(f"evolution better on {better} of {len(found)} laws")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(10)))
    parser.add_argument("--laws", nargs="+", default=list(LAWS), choices=list(LAWS))
    parser.add_argument("--set", action="append", default=[], help="setting of the evolution, name=value")
    arguments = parser.parse_args()
    changes = {name: int(value) for name, value in (pair.split("=") for pair in arguments.set)}
    measure(arguments.laws, arguments.seeds, changes)
