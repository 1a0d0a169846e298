"""Error of the automatic choice relative to the best choice by hand, on records of many kinds.

    python -m lab.searches.auto_preset [--command fit] [--seeds 0 1 ...] [--kinds stiction ...]

Every record is searched with each choice by hand, and with the automatic one. The figure is the RMSE of the
free run of the recommended model on a test record that no search uses, as a fraction of the output's range.
Errors below 1e-4 of the range count as equal. Measured records are searched once.
Results are printed, not asserted.
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
from time import process_time
from typing import Any

import numpy as np

import islands
from islands.errors import IslandsError
from islands.models.candidate_library import LIBRARIES
from islands.records.dataset import Dataset
from support.measured_portfolio import MEASURED
from support.portfolio_records import KINDS

#: Effort of an evolution, the same for all choices. The full effort of the presets takes much longer.
EFFORT: Mapping[str, Any] = {"population": 60, "generations": 5}

#: Choices by hand: presets, and functions for the smooth one. The presets of the paper have no library and
#: need their full effort.
BY_HAND: Mapping[str, Mapping[str, Any]] = {
    "hysteresis": {"preset": "hysteresis"},
    "narx": {"preset": "narx"},
    "narx, sign": {"preset": "narx", "primitives": ("mul", "sign")},
    "narx, sqrt, abs": {"preset": "narx", "primitives": ("mul", "sqrt", "abs")},
    "latent": {"preset": "latent"},
}

#: Error as a fraction of the output's range below which errors count as equal.
FLOOR = 1e-4

#: Bounds of the ratio of errors: on nine of ten records, and on all.
CLOSE, LARGEST = 1.2, 2.0


def identify(record: Dataset, choice: Mapping[str, Any]) -> islands.Result:
    """Identify with a small effort."""
    return islands.identify(record, **{**EFFORT, **choice})


#: Choices by hand and search of each command.
COMMANDS: Mapping[str, tuple[Mapping[str, Mapping[str, Any]], Callable[..., islands.Result]]] = {
    "fit": (
        {name: {"library": name} for name in LIBRARIES},
        lambda record, choice: islands.fit(record, **choice),
    ),
    "identify": (BY_HAND, identify),
}


def measure_error(result: islands.Result, test: Dataset) -> float:
    """Return the RMSE of the free run as a fraction of the output's range; infinite after a divergence."""
    run = result.best.simulate(test)
    return float(np.sqrt(run.mean_squared_error)) / test.output_range if run.outcome else float("inf")


def search(
    search_record: Callable[..., islands.Result], pair: tuple[Dataset, Dataset], choice: Mapping[str, Any]
) -> tuple[float, str]:
    """Return the test error of a choice, and the kind that an automatic choice found."""
    record, test = pair
    try:
        result = search_record(record, choice)
    except IslandsError as reason:
        return float("inf"), f"{reason}"[:40]
    found = result.search_result.settings.get("choice", {})
    return measure_error(result, test), f"{found.get('kind', '')} {list(found.get('delays', ()))}"


def compare(command: str, name: str, pair: tuple[Dataset, Dataset]) -> float:
    """Print the errors of all choices for a record; return the ratio of the automatic one to the best."""
    choices, search_record = COMMANDS[command]
    errors = {label: search(search_record, pair, choice)[0] for label, choice in choices.items()}
    best = min(errors, key=lambda label: errors[label])
    started = process_time()
    error, found = search(search_record, pair, {})
    ratio = max(error, FLOOR) / max(errors[best], FLOOR)
    print(
        f"{name:22} {best:18} {100 * errors[best]:9.4f} %  auto {100 * error:9.4f} %  {ratio:6.2f}  "
        f"{found} ({process_time() - started:.1f} s)",
        flush=True,
    )
    return ratio


def measure(command: str, kinds: Sequence[str], seeds: Sequence[int]) -> None:
    """Print the table of all records, and the share of records whose error is close to the best."""
    ratios = []
    for name in kinds:
        if name in MEASURED:
            ratios.append(compare(command, name, MEASURED[name]()))
        else:
            ratios += [compare(command, name, KINDS[name].record(seed)) for seed in seeds]
    close = sum(ratio <= CLOSE for ratio in ratios) / len(ratios)
    print(
        f"{len(ratios)} records: within {CLOSE} of the best on {100 * close:.0f} %, worst {max(ratios):.2f}"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--command", choices=list(COMMANDS), default="identify")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    names = [*KINDS, *MEASURED]
    parser.add_argument("--kinds", nargs="+", default=names, choices=names)
    arguments = parser.parse_args()
    measure(arguments.command, arguments.kinds, arguments.seeds)
