"""Error of linear models of the free run under coloured noise: output error against Box-Jenkins models.

    python -m lab.searches.linear_models [--seeds 20] [--samples 300 1000 5000] [--systems lag tank ...]

Every system is simulated with noise of five colours. The models of `fit_output_error` are estimated from the
first three quarters of the record. The table has the models of the true order, and the model of any order
with the least error on the last quarter, among output-error models alone and among all. The figure is the
error of the free run from the true start on a record without noise and with another input, as a percentage of
the standard deviation of its output: median and quartiles. Results are printed, not asserted.
"""

import argparse
from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from islands.estimation.output_error import fit_output_error
from islands.models.narx import Model
from islands.records.dataset import Dataset
from islands.simulation.initial_outputs import simulate_freely
from islands.simulation.predictors import free_run
from support.slow_processes import BATTERY_POLE

Signal = NDArray[np.float64]

#: Resistance, integrator and RC pair of the battery of decision 0035.
_BATTERY = -(
    0.05 * np.poly([1.0, BATTERY_POLE])
    + 1e-4 * np.array([1.0, -BATTERY_POLE, 0.0])
    + 0.03 * (1.0 - BATTERY_POLE) * np.array([1.0, -1.0, 0.0])
)

#: Numerator from one sample earlier on, denominator, and noise as a fraction of the output, by system. The
#: deviation is that of the values.
SYSTEMS: Mapping[str, tuple[Sequence[float], Sequence[float], float]] = {
    "lag": ([0.1], [1.0, -0.9], 0.1),
    "resonance": ([0.1, 0.1], [1.0, -1.6, 0.8], 0.1),
    "slow": ([0.002, 0.001], np.poly([0.99, 0.9]), 0.1),
    "third order": ([0.01, 0.02, 0.005], np.poly([0.98, 0.8 + 0.5j, 0.8 - 0.5j]).real, 0.1),
    "battery": (_BATTERY, np.poly([1.0, BATTERY_POLE]), 0.01),
    "tank": ([0.02], [1.0, -1.0], 0.05),
}

#: Denominator of the noise by colour.
COLOURS: Mapping[str, Sequence[float]] = {
    "white": [1.0],
    "AR(1) 0.9": [1.0, -0.9],
    "AR(1) 0.98": [1.0, -0.98],
    "AR(2)": np.poly([0.95 * np.exp(0.4j), 0.95 * np.exp(-0.4j)]).real,
    "drift": [1.0, -1.0],
}


def make_records(system: str, colour: str, seed: int, samples: int) -> tuple[Dataset, Dataset]:
    """Return a record with noise, and one without noise."""
    random = np.random.default_rng(seed)
    numerator, denominator, level = SYSTEMS[system]
    name = "u+1" if len(numerator) == len(denominator) else "u"
    u = np.repeat(random.uniform(-1.0, 1.0, (2, samples // 10)), 10, axis=1)
    y = lfilter([0.0, *numerator], denominator, u)
    noise = lfilter([1.0], COLOURS[colour], random.standard_normal(samples + 500))[500:]
    noise *= level * y[0].std() / noise.std()
    return Dataset(u[0], y[0] + noise, 1.0, (name,)), Dataset(u[1], y[1], 1.0, (name,))


def fit_models(record: Dataset) -> tuple[list[Model], list[Model]]:
    """Return output-error models, and Box-Jenkins models; each are in the sequence of their orders."""
    models = [each.model for each in fit_output_error(record)]
    falls = [place for place, (a, b) in enumerate(pairwise(models), 1) if a.output_lag >= b.output_lag]
    first = falls[0] if falls else len(models)
    return models[:first], models[first:]


def measure(system: str, colour: str, seed: int, samples: int) -> list[float]:
    """Return the errors of both models of the true order, and of the choices without and with Box-Jenkins."""
    record, clean = make_records(system, colour, seed, samples)
    held = samples // 4
    simulated, weighted = fit_models(record[:-held])
    order = len(SYSTEMS[system][1]) - 1
    pair = [next((each for each in some if each.output_lag == order), None) for some in (simulated, weighted)]

    def choose(models: Sequence[Model]) -> Model:
        return min(models, key=lambda each: simulate_freely(each, record[-held:]).mean_squared_error)

    chosen = [choose(simulated), choose([*simulated, *weighted])]
    # An order whose residual is white has no second model.
    compared = [pair[0], pair[1] or pair[0], *chosen]
    return [measure_error(each, clean) if each else np.nan for each in compared]


def measure_error(model: Model, clean: Dataset) -> float:
    """Return the error of the free run in percent of the standard deviation of the output."""
    return 100.0 * float(free_run(model, clean).mean_squared_error ** 0.5 / clean.y.std())


def print_table(systems: Sequence[str], lengths: Sequence[int], seeds: int) -> None:
    """Print a line for every system, colour and length, with the ratios of the medians."""
    print(
        f"{'system':12}{'noise':11}{'samples':>8}{'both':>5}{'output error':>22}{'Box-Jenkins':>22}", end=""
    )
    print(f"{'ratio':>7}{'chosen without':>22}{'chosen with':>22}{'ratio':>7}")
    for system in systems:
        for colour in COLOURS:
            for samples in lengths:
                errors = np.array([measure(system, colour, seed, samples) for seed in range(seeds)])
                both = errors[np.isfinite(errors[:, :2]).all(axis=1)]
                print(f"{system:12}{colour:11}{samples:8}{len(both):5}", end="")
                for first, second in (both.T[:2], errors.T[2:]):
                    ratio = np.median(second) / np.median(first) if first.size else np.nan
                    print(f"{summarise(first):>22}{summarise(second):>22}{ratio:7.2f}", end="")
                print(flush=True)


def summarise(values: Signal) -> str:
    """Return median and quartiles."""
    if not values.size:
        return "-"
    low, median, high = np.quantile(values, [0.25, 0.5, 0.75])
    return f"{median:.3g} ({low:.3g}-{high:.3g})"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--samples", type=int, nargs="+", default=[300, 1000, 5000])
    parser.add_argument("--systems", nargs="+", default=list(SYSTEMS), choices=SYSTEMS)
    arguments = parser.parse_args()
    print_table(arguments.systems, arguments.samples, arguments.seeds)
