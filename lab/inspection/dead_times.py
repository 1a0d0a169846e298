"""Calibration of dead times: stated probabilities against the share of right values on simulated records.

    python -m lab.inspection.dead_times [--seed SEED] [--count N]

A record has one to three inputs: random telegraph signals, steps, ramps, filtered noise, daily cycles or
pairs of correlated signals. Each acts through a first- or second-order lag and a dead time of 0 to 60
samples, or not at all. The noise is 0.1 to 10 % of the output, white or coloured, in some records with an
unknown disturbance. A value is right within one sample.
"""

import argparse
import os
import time
from itertools import pairwise

for library in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(library, "1")

import numpy as np  # noqa: E402 - after the environment is set
from numpy.typing import NDArray  # noqa: E402
from scipy.signal import lfilter  # noqa: E402

from islands.records.dataset import Dataset  # noqa: E402
from islands.records.inspection.record_facts import measure_facts  # noqa: E402

#: Bounds of the stated probabilities in the table.
BINS = (0.0, 0.3, 0.5, 0.7, 0.9, 0.97, 1.0)


def lag(signal: NDArray[np.float64], constant: float) -> NDArray[np.float64]:
    """Return the response of a first-order lag, held between the samples, from rest."""
    pole = np.exp(-1.0 / constant)
    filtered: NDArray[np.float64] = lfilter([0.0, 1.0 - pole], [1.0, -pole], signal - signal[0]) + signal[0]
    return filtered


def make_input(kind: str, samples: int, draw: np.random.Generator) -> NDArray[np.float64]:
    """Return an input of a kind with a standard deviation of one."""
    if kind in ("telegraph", "steps"):
        hold = int(draw.integers(3, 40)) if kind == "telegraph" else int(draw.integers(60, 200))
        levels = draw.choice([-1.0, 1.0], samples) if kind == "telegraph" else draw.normal(size=samples)
        signal = np.repeat(levels, hold)[:samples]
    elif kind == "ramps":
        knots = np.arange(0, samples + 300, int(draw.integers(80, 300)))
        signal = np.interp(np.arange(samples), knots, draw.normal(size=knots.size))
    elif kind == "filtered":
        signal = lag(draw.normal(size=samples), draw.uniform(10.0, 200.0))
        signal = lag(signal, draw.uniform(2.0, 40.0))
    else:
        phase = 2.0 * np.pi * (np.arange(samples) / draw.integers(90, 300) + draw.random())
        signal = np.sin(phase)
        if draw.random() < 0.5:
            days = (phase / (2.0 * np.pi)).astype(int)
            signal = np.maximum(signal, 0.0) * draw.uniform(0.2, 1.0, days.max() + 1)[days]
        else:
            signal = signal + 0.02 * np.cumsum(draw.normal(size=samples))
    spread = float(np.std(signal))
    return (signal - signal.mean()) / (spread if spread > 0.0 else 1.0)


def make_record(seed: int) -> tuple[Dataset, list[int | None]]:
    """Return a record and the first lag of the response to each input, None without a response."""
    draw = np.random.default_rng(seed)
    samples, count = int(draw.integers(600, 3000)), int(draw.integers(1, 4))
    kinds = draw.choice(["telegraph", "steps", "ramps", "filtered", "daily"], count)
    u = np.column_stack([make_input(kind, samples, draw) for kind in kinds])
    if count > 1 and draw.random() < 0.5:
        u[:, 1] = u[:, 0] + draw.uniform(0.2, 1.0) * u[:, 1]
    y, lags = np.zeros(samples), []
    for signal in u.T:
        delay = 0 if draw.random() < 0.4 else int(draw.integers(1, 61))
        response = lag(np.concatenate([np.full(delay, signal[0]), signal])[:samples], draw.uniform(2.0, 60.0))
        if draw.random() < 0.5:
            pole = np.exp(-1.0 / draw.uniform(2.0, 30.0))
            centred = response - response[0]
            response = lfilter([1.0 - pole], [1.0, -pole], centred) + response[0]
        acts = bool(draw.random() < 0.9)
        y += acts * draw.uniform(0.3, 1.0) * response
        lags.append(delay + 1 if acts else None)
    scale = float(np.std(y)) or 1.0
    noise = draw.normal(size=samples)
    if draw.random() < 0.5:
        noise = lfilter([1.0], [1.0, -draw.uniform(0.3, 0.95)], noise)
    y += scale * 10.0 ** draw.uniform(-3.0, -1.0) * noise / np.std(noise)
    if draw.random() < 0.3:
        y += scale * draw.uniform(0.02, 0.3) * make_input("filtered", samples, draw)
    return Dataset(u, y, 1.0), lags


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=1, help="seed of the first record")
    parser.add_argument("--count", type=int, default=200, help="number of records")
    arguments = parser.parse_args()
    stated, covered, false, missing, seconds = [], [], 0, 0, 0.0
    for seed in range(arguments.seed, arguments.seed + arguments.count):
        record, lags = make_record(1000 * seed)
        begin = time.process_time()
        facts = [fact for fact in measure_facts(record).facts if fact.name == "dead-time"]
        seconds += time.process_time() - begin
        for fact, right in zip(facts, lags, strict=True):
            if fact.interval is not None and right is not None:
                covered.append(fact.interval[0] <= right <= fact.interval[1])
            if fact.value is None or fact.confidence is None:
                missing += right is not None
            elif right is None:
                false += 1
                stated.append((fact.confidence, False))
            else:
                stated.append((fact.confidence, abs(fact.value - right) <= 1.0))
    print("stated probability   values   mean stated   share of right ones")
    for low, high in pairwise(BINS):
        here = [each for each in stated if low <= each[0] < high or each[0] == high == 1.0]
        if here:
            mean, share = np.mean(here, axis=0)
            print(f"{low:8.2f} to {high:.2f} {len(here):12d} {mean:13.2f} {share:18.2f}")
    mean, share = np.mean(stated, axis=0)
    brier = np.mean([(each - right) ** 2 for each, right in stated])
    print(f"all {len(stated)} values: stated {mean:.2f}, right {share:.2f}, Brier score {brier:.3f}")
    right = sum(right for _, right in stated)
    print(f"right values: {right}; without a value: {missing}; without a response: {false}")
    print(f"95 % intervals that contain the lag: {np.mean(covered):.2f} of {len(covered)}")
    print(f"{seconds:.1f} s of CPU")


if __name__ == "__main__":
    main()
