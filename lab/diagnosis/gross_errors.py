"""Gross errors in simulated records: how often each is found, and false findings on other records.

    python -m lab.diagnosis.gross_errors SYSTEM ... [--first SEED] [--count N]
    python -m lab.diagnosis.gross_errors SYSTEM ... --others [--noise KIND] [--band LOW HIGH]

SYSTEM is piezo, second-order, tanks or linear (identified on the same record without the error). Parameters
of the simulation are given, with the tolerances of the trials. With ``--others`` the records have no gross
error, but all faults of the trials with a misfit of LOW to HIGH standard deviations of the noise of a
KIND of the trials.
"""

import argparse
import os
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace

for library in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(library, "1")

import numpy as np  # noqa: E402 - after the environment is set

from islands.diagnosis.calibration.levenberg_marquardt import calibrate  # noqa: E402
from islands.diagnosis.calibration.preparation import count_fitted_samples, make_target  # noqa: E402
from islands.diagnosis.gross_errors.channel_admission import admit_channels  # noqa: E402
from islands.diagnosis.gross_errors.closed_loop import find_closed_loop  # noqa: E402
from islands.diagnosis.gross_errors.explanation import GrossError  # noqa: E402
from islands.diagnosis.gross_errors.search import find_gross_errors  # noqa: E402
from islands.records.dataset import Dataset  # noqa: E402
from islands.simulators.extended import ExtendedSimulator, make_context  # noqa: E402
from islands.simulators.interface import Simulator  # noqa: E402
from islands.simulators.linear import estimate_linear  # noqa: E402
from islands.simulators.specification.factory import make_simulator  # noqa: E402
from islands.simulators.specification.table import PhysicalSpec  # noqa: E402
from lab.diagnosis.cases import CASES, SimulatedCase  # noqa: E402
from lab.diagnosis.injection.measurement import inject  # noqa: E402
from lab.diagnosis.self_test import estimate_rate  # noqa: E402

#: Place of the neighbour among the inputs of a record.
NEIGHBOUR = 2

#: Entry of the table of trial cases for each system.
SYSTEMS = {
    "piezo": CASES["bouc-wen-piezo"],
    "second-order": CASES["second-order"],
    "tanks": CASES["cascaded-tanks"],
    "linear": CASES["second-order"],
}


def scale_input(record: Dataset, factor: float) -> Dataset:
    """Return the record with its first input multiplied."""
    return replace(record, u=np.column_stack([factor * record.u[:, 0], record.u[:, 1:]]))


def exchange(record: Dataset, place: int) -> Dataset:
    """Return the record with an input exchanged for the output."""
    u = record.u.copy()
    u[:, place] = record.y
    return replace(record, u=u, y=record.u[:, place])


def exchange_inputs(record: Dataset) -> Dataset:
    """Return the record with the input and the neighbour exchanged."""
    return replace(record, u=record.u[:, [NEIGHBOUR, 1, 0]])


def move(record: Dataset, samples: int) -> Dataset:
    """Return the record with an output that is recorded later."""
    moved = replace(record, y=np.roll(record.y, samples))
    return moved[max(samples, 0) : record.samples + min(samples, 0)]


def time_error(factor: float) -> Callable[[Dataset], Dataset]:
    """Return the function that multiplies the sampling time."""
    return lambda record: replace(record, dt=factor * record.dt)


def output_error(factor: float) -> Callable[[Dataset], Dataset]:
    """Return the function that multiplies the output."""
    return lambda record: replace(record, y=factor * record.y)


#: Injected error, its name and value, and the systems in which it is not identifiable.
ERRORS: Mapping[str, tuple[Callable[[Dataset], Dataset], str, float | None, tuple[str, ...]]] = {
    "dt / 1000": (time_error(1e-3), "sampling-time", 1e-3, ("piezo", "linear")),
    "dt * 2": (time_error(2.0), "sampling-time", 2.0, ("piezo", "linear")),
    "dt / 10": (time_error(0.1), "sampling-time", 0.1, ("piezo", "linear")),
    "y * 1000": (output_error(1e3), "output-unit", 1e3, ()),
    "y / 9.81": (output_error(1 / 9.80665), "output-unit", 1 / 9.80665, ()),
    "y * 2 pi": (output_error(2 * np.pi), "output-unit", 2 * np.pi, ()),
    "y * pi / 180": (output_error(np.pi / 180), "output-unit", np.pi / 180, ()),
    "u * 1000": (lambda record: scale_input(record, 1e3), "input-unit", 1e3, ()),
    "u * 9.81": (lambda record: scale_input(record, 9.80665), "input-unit", 9.80665, ()),
    "u / 2 pi": (lambda record: scale_input(record, 0.5 / np.pi), "input-unit", 0.5 / np.pi, ()),
    "- y": (output_error(-1.0), "sign", None, ()),
    "- u": (lambda record: scale_input(record, -1.0), "sign", None, ()),
    "u and w exchanged": (exchange_inputs, "swapped-channels", None, ()),
    "y and w exchanged": (lambda record: exchange(record, NEIGHBOUR), "swapped-channels", None, ()),
    "u and y exchanged": (lambda record: exchange(record, 0), "swapped-channels", None, ()),
    "y 10 samples early": (lambda record: move(record, -10), "time-offset", -10.0, ()),
    "y 60 samples early": (lambda record: move(record, -60), "time-offset", -60.0, ()),
    "y 100 samples late": (lambda record: move(record, 100), "time-offset", 100.0, ()),
}


def make_given_simulator(name: str, record: Dataset, clean: Dataset) -> tuple[Simulator, Mapping[str, float]]:
    """Return the simulator of a system with given parameters, and their tolerances."""
    if name == "piezo":
        return make_simulator("bouc-wen-piezo", record), SYSTEMS[name].tolerance
    if name == "linear":
        linear = estimate_linear(2, 0, clean[: clean.samples // 2])
        known = [each.name for each in linear.parameters if each.name[0] in "ab" and each.nominal]
        return linear, dict.fromkeys(known, 0.01)
    kind, given = (
        ("second-order", {"m": 8e-4, "c": 8e-3, "k": 2.0})
        if name == "second-order"
        else ("cascaded-tanks", {"k1": 0.05, "k2": 0.05, "k3": 0.04})
    )
    tolerance = {each: 0.06 if each == "c" else 0.02 for each in given}
    return make_simulator(PhysicalSpec(kind=kind, parameters=given), record), tolerance


def draw(
    case: SimulatedCase, names: tuple[str, ...], seed: int, noise: str, band: tuple[float, float] | None
) -> Dataset:
    """Draw a record of a trial."""
    rng = np.random.default_rng([seed, *map(ord, "".join(names))])
    return inject(
        names, rng, None, noise, band if names else None, False, case.system, True, case.free
    ).record


def find(
    record: Dataset, simulator: Simulator, tolerance: Mapping[str, float]
) -> tuple[list[GrossError], list[str]]:
    """Return the gross errors, and the names of all other findings about a record."""
    fitted = count_fitted_samples(record)
    admitted, channels = admit_channels(record, fitted)
    simulation = ExtendedSimulator(simulator, (), make_context(admitted, simulator, fitted))
    target = make_target(record, fitted, tolerance)
    base = calibrate(simulation, target, simulation.nominal)
    errors = find_gross_errors(admitted, simulator, base, target)
    closed = find_closed_loop(base, target, "u")
    return list(errors), [each.name for each in (*channels, *closed)]


def has_value(error: GrossError, value: float | None) -> bool:
    """Return whether a gross error has a value, if one is given."""
    return value is None or any(np.isclose(value, each) for each, _ in error.correction.parameters.values())


def count_found(name: str, seeds: range) -> None:
    """Print how often each gross error is found."""
    for label, (spoil, error, value, hidden) in ERRORS.items():
        if name in hidden:
            continue
        first = among = 0
        for seed in seeds:
            clean = draw(SYSTEMS[name], (), seed, "white", None)
            record = spoil(clean)
            found, _ = find(record, *make_given_simulator(name, record, clean))
            right = [each.name == error and has_value(each, value) for each in found]
            first += bool(right and right[0])
            among += any(right)
        rates = (f"{estimate_rate(count, len(seeds)).value:.0%}" for count in (first, among))
        print(
            f"{name:13} {label:20} first {first}, among {among} of {len(seeds)}: {', '.join(rates)}",
            flush=True,
        )


def count_false(name: str, seeds: range, noise: str, band: tuple[float, float]) -> None:
    """Print how many records without a gross error have a finding."""
    case, found, records = SYSTEMS[name], Counter[tuple[tuple[str, ...], str]](), 0
    for names in ((), *((fault,) for fault in (*case.system.known, *case.system.unknown))):
        for seed in seeds:
            try:
                record = draw(case, names, seed, noise, band)
                clean = draw(case, (), seed, noise, None)
            except ValueError:  # no strength of this fault has such a misfit
                continue
            errors, others = find(record, *make_given_simulator(name, record, clean))
            records += 1
            found.update((names, each) for each in (*(error.name for error in errors), *others))
    print(f"{name:13} {noise} noise, misfit {band}: {records} records, found {dict(found)}", flush=True)


def main() -> None:
    """Run the trials that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("systems", nargs="+", choices=SYSTEMS)
    parser.add_argument("--first", type=int, default=7_000_000)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--others", action="store_true")
    parser.add_argument("--noise", default="white", help="a kind of noise of the trials, such as ar")
    parser.add_argument("--band", type=float, nargs=2, default=(1.0, 4.0))
    asked = parser.parse_args()
    seeds = range(asked.first, asked.first + asked.count)
    for name in asked.systems:
        if asked.others:
            count_false(name, seeds, asked.noise, tuple(asked.band))
        else:
            count_found(name, seeds)


if __name__ == "__main__":
    main()
