"""False alarms and delays of a monitor, on an oscillator with play at its input.

    python -m lab.diagnosis.monitor [--seeds N] [--first SEED] [--noise KIND] [--only alarms|delays]

A month has 720 records of an hour; each has 6 s of data. The records differ by more than their noise: the
stiffness varies from record to record. A change begins 40 records after the training, in standard deviations
of the calibrated values from record to record, and the delay is the number of records until an alarm.
"""

import argparse
from collections.abc import Callable, Sequence
from time import process_time

import numpy as np
import scipy

import islands
from islands.diagnosis.monitoring.record_follower import Alarm
from islands.facade.record_monitor import create_monitor, monitor_record

DT, SAMPLES, MONTH, TRAINING = 0.01, 600, 720, 24

#: Standard deviation of the noise, and of the stiffness from record to record, relative to its mean.
NOISE, SPREAD = 2e-3, 2e-3

#: Correlation of successive samples of the noise.
COLOURS = {"white": 0.0, "AR": 0.8}

SIMULATION = {
    "kind": "ode",
    "name": "oscillator",
    "input": "F",
    "output": "x",
    "equations": "dx/dt = v\ndv/dt = (F - c*v - k*x)/m\n",
    "parameters": {"m": {"value": 1.0}, "c": {"value": 2.0}, "k": {"value": 100.0}},
    "states": {"x": {}, "v": {}},
    "force": {"coordinate": "x", "rate": "v"},
}

Machine = Callable[[int], dict[str, float]]


def make_record(
    rng: np.random.Generator, colour: float, k: float = 100.0, c: float = 2.0, play: float = 0.0
) -> islands.Dataset:
    """Return a record of an oscillator of mass 1 with play at its input."""
    time = DT * np.arange(SAMPLES)
    frequencies = rng.uniform(0.2, 3.0, 10)
    u = 10.0 * np.sin(2 * np.pi * np.outer(time, frequencies) + rng.uniform(0, 6.3, 10)).sum(axis=1)
    force, position = np.empty(SAMPLES), 0.0
    for index, value in enumerate(u.tolist()):
        position = min(max(position, value - play), value + play)
        force[index] = position
    stiffness = k * (1.0 + SPREAD * rng.standard_normal())
    system = ([[0.0, 1.0], [-stiffness, -c]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    _, x, _ = scipy.signal.lsim(system, force, time)
    noise = scipy.signal.lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], rng.standard_normal(SAMPLES))
    return islands.Dataset(u, x + NOISE * noise, DT, input_names=("F",), output_name="x")


def run(seed: int, colour: float, count: int, machine: Machine, stop: bool) -> Sequence[Alarm]:
    """Follow a machine over records; return its alarms, or only the first one."""
    rng = np.random.default_rng([20, seed])
    monitor = None
    for index in range(count):
        record = make_record(rng, colour, **machine(index))
        if monitor is None:
            monitor = create_monitor(
                record, SIMULATION, false_alarms="1 per month", interval=3600.0, training=TRAINING
            )
        monitor = monitor_record(monitor, record, f"{index}")
        if stop and monitor.state.alarms and monitor.state.alarms[-1].record >= TRAINING:
            break
    assert monitor is not None
    return monitor.state.alarms


def measure_spreads(colour: float) -> dict[str, float]:
    """Return the standard deviations of the calibrated stiffness and damping from record to record."""
    rng = np.random.default_rng(19)
    records = [make_record(rng, colour) for _ in range(60)]
    monitor = create_monitor(records[0], SIMULATION, false_alarms="1 per month", interval=3600.0)
    for index, record in enumerate(records):
        monitor = monitor_record(monitor, record, f"{index}")
    values = np.array([each.states.values for each in monitor.state.records])
    assert monitor.state.reference is not None
    names = [each.name for each in monitor.state.reference.parameters]
    return {name: float(np.std(values[:, names.index(name)])) for name in ("k", "c")}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--noise", choices=COLOURS, action="append")
    parser.add_argument("--only", choices=("alarms", "delays"))
    given = parser.parse_args()
    seeds = range(given.first, given.first + given.seeds)
    for name in given.noise or COLOURS:
        if given.only != "delays":
            print_alarms(name, seeds)
        if given.only != "alarms":
            print_delays(name, seeds)


def print_alarms(name: str, seeds: range) -> None:
    """Print the false alarms of a month of each seed."""
    began, total = process_time(), 0
    for months, seed in enumerate(seeds, start=1):
        total += len(run(seed, COLOURS[name], TRAINING + MONTH, lambda _: {}, False))
        upper = scipy.stats.chi2.ppf(0.95, 2 * (total + 1)) / 2 / months
        print(
            f"{name}: {total} false alarms in {months} months of {MONTH} records (wanted at most one per "
            f"month; upper 95 % limit {upper:.2f} per month); {process_time() - began:.0f} s",
            flush=True,
        )


def print_delays(name: str, seeds: range) -> None:
    """Print delays, names and instants of changes."""
    colour, onset = COLOURS[name], TRAINING + 40
    spreads = measure_spreads(colour)
    cases: list[tuple[str, str, Machine]] = [
        (f"{parameter} by {size:g} sigma", parameter, _make_step(parameter, size * spreads[parameter], onset))
        for parameter in ("k", "c")
        for size in (4.0, 2.0, 1.0)
    ]
    cases += [
        (f"play of {size:g} N", "backlash", _make_step("play", size, onset)) for size in (0.5, 0.1, 0.05)
    ]
    cases.append(("play grows by 0.02 N per record", "backlash", _make_ramp("play", 0.02, onset)))
    for title, cause, machine in cases:
        _print_delays(f"{name}, {title}", cause, onset, seeds, colour, machine)


def _make_step(parameter: str, size: float, onset: int) -> Machine:
    start = {"k": 100.0, "c": 2.0, "play": 0.0}[parameter]
    return lambda index: {parameter: start + size * (index >= onset)}


def _make_ramp(parameter: str, slope: float, onset: int) -> Machine:
    return lambda index: {parameter: slope * max(index - onset + 1, 0)}


def _print_delays(title: str, cause: str, onset: int, seeds: range, colour: float, machine: Machine) -> None:
    first = [run(seed, colour, onset + 120, machine, True) for seed in seeds]
    found = [alarms[-1] for alarms in first if alarms and alarms[-1].record >= onset]
    delays: list[float] = [alarm.record - onset + 1 for alarm in found]
    named = sum(alarm.cause == cause for alarm in found)
    errors: list[float] = [abs(alarm.since - onset) for alarm in found]
    inside = sum(alarm.earliest <= onset <= alarm.latest for alarm in found)
    print(
        f"{title}: found {len(found)} of {len(first)}, delay median {np.median(delays or [np.nan]):.0f} "
        f"records (90 % {np.quantile(delays or [np.nan], 0.9):.0f}), named {named}, error of the instant "
        f"median {np.median(errors or [np.nan]):.0f} records, in its 95 % interval {inside}",
        flush=True,
    )


if __name__ == "__main__":
    main()
