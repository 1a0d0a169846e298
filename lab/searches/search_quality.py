"""Free-run error of models identified on three piezo records, over seeds.

    python -m lab.searches.search_quality [--seeds 0 1 ...] [--records authors consistent measured]

The record of the authors and the consistent record are simulated. Their validation data are 20 s of a 1 Hz
sine. The best models by validation error of at most 6 and 9 terms are simulated on records that take no part
in any selection: a 5 Hz sine, a sine of 20 V, other noise. The measured record (150 V, 1 Hz) needs the folder
ISLANDS_MEASURED_DIR: its first 60 % estimate, the next 20 % select, the rest test. Results are printed, not
asserted.
"""

import argparse
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import median
from time import perf_counter

import islands
from islands.facade.results.fitted_model import FittedModel
from islands.facade.results.identification import Result
from islands.records.dataset import Dataset
from islands.records.reading import read_record
from islands.records.signal_map import match_rate
from islands.systems.catalogue import make_record
from islands.validation.metrics import metrics

#: Records that take no part in any selection.
PROBES = ("sine-5Hz", "sine-20V", "noise-2")


def mape(fitted: FittedModel, record: Dataset) -> float:
    """Return the free-run MAPE in per cent, NaN after a divergence."""
    simulated = fitted.simulate(record)
    measured = match_rate(fitted.model, record).y[: len(simulated.y)]
    return metrics(measured, simulated.y).mape if simulated.outcome else float("nan")


def best_of_size(result: Result, terms: int) -> FittedModel:
    """Return the model of at most a number of terms with the least validation MAPE."""
    errors = {
        fitted.metrics["validation"]["free_run"].mape: fitted
        for fitted in result.models
        if fitted.model.size <= terms
    }
    return errors[min(errors)]


def simulated_figures(variant: str, seed: int) -> Iterator[tuple[str, float]]:
    """Identify a simulated record and yield the named figures."""
    parts = [make_record("bouc-wen-piezo", variant, part) for part in ("estimation", "validation")]
    started = perf_counter()
    result = islands.identify(parts[0], validation=parts[1][:20_000], preset="hysteresis", seed=seed)
    seconds = perf_counter() - started
    for terms in (6, 9):
        yield (
            f"validation, <= {terms} terms",
            best_of_size(result, terms).metrics["validation"]["free_run"].mape,
        )
    for probe in PROBES:
        record = make_record("bouc-wen-piezo", variant, probe)
        yield f"{probe}, <= 9 terms", mape(best_of_size(result, 9), record)
        yield f"{probe}, recommended", mape(result.best, record)
    yield "terms, recommended", float(result.best.model.size)
    yield "models without Property 1", float(sum(not each.physics.property_1 for each in result.models))
    yield "seconds", seconds


def measured_figures(seed: int) -> Iterator[tuple[str, float]]:
    """Identify the measured record and yield the named figures."""
    path = Path(os.environ["ISLANDS_MEASURED_DIR"]) / "piezo_micromanipulator_150V_1Hz.csv"
    record = read_record(path, ["u_V"], "y_um")
    first, second = round(0.6 * record.samples), round(0.8 * record.samples)
    started = perf_counter()
    result = islands.identify(record[:first], validation=record[first:second], preset="hysteresis", seed=seed)
    seconds = perf_counter() - started
    yield "validation, best", result.models[0].metrics["validation"]["free_run"].mape
    yield "test, best", mape(result.models[0], record[second:])
    yield "test, recommended", mape(result.best, record[second:])
    yield "models without Property 1", float(sum(not each.physics.property_1 for each in result.models))
    yield "seconds", seconds


def measure(record: str, seeds: Sequence[int]) -> None:
    """Print the figures of every seed, and their median and worst."""
    found: dict[str, list[float]] = {}
    for seed in seeds:
        figures = measured_figures(seed) if record == "measured" else simulated_figures(record, seed)
        for name, value in figures:
            found.setdefault(name, []).append(value)
        print(
            record, "seed", seed, {name: round(values[-1], 4) for name, values in found.items()}, flush=True
        )
    for name, values in found.items():
        print(f"{record:10} {name:28} median {median(values):8.4f}   worst {max(values):8.4f}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(10)))
    parser.add_argument("--records", nargs="+", default=["authors", "consistent", "measured"])
    arguments = parser.parse_args()
    for name in arguments.records:
        measure(name, arguments.seeds)
