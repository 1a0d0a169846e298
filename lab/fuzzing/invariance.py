"""Fuzzing of what a result must not depend on: units, offsets, digits, rounding noise, order of the columns.

    python -m lab.fuzzing.invariance [--cases 300] [--seconds N] [--seed 0] [--first 0] [--only offset]

A case is a record of one of `PLANTS`, written as text twice: with 17 digits, and after one of
`TRANSFORMATIONS`. Both texts are read and fitted; one case in 15 runs `identify`. It is a defect if the kinds
of the recommended models differ, if a free-run error differs by more than 1 % and more than the rounding of
the text explains, if only one of the two records is refused, or if the call raises another exception than an
error of `islands.errors`. ``--seed S --first N --cases 1`` repeats a case. The exit status is 1 if there is a
defect.

Offsets move the signals of both records to places far from zero: a zero that a signal reaches, or nearly so,
may be a fact about the system, which has another law about another point (decision 0043).
"""

import argparse
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

import islands
from islands.errors import ExtrapolationWarning, IslandsError

Generator = np.random.Generator
Signal = NDArray[np.float64]

#: Largest relative difference of two errors, and that of errors relative to the range of the output: an error
#: of a record without noise is rounding.
SAME, ROUNDING = 0.01, 1e-6

#: Share of the cases that run `identify`.
IDENTIFIED = 1 / 15

#: Most samples of most records, and of all.
MOST, LONGEST = 800, 20_000


def linear(numerator: Sequence[float], denominator: Sequence[float], delay: int = 1) -> Callable[..., Signal]:
    """Return a plant whose inputs act alike through a linear difference equation."""

    def respond(u: Signal) -> Signal:
        total = u @ (1.0 / np.arange(1, u.shape[1] + 1))
        y = np.zeros(len(u))
        for k in range(len(u)):
            past = sum(b * total[k - delay - lag] for lag, b in enumerate(numerator) if k >= delay + lag)
            y[k] = past - sum(a * y[k - lag] for lag, a in enumerate(denominator, 1) if k >= lag)
        return y

    return respond


def _two_tanks(u: Signal) -> Signal:
    upper, lower, y = 1.0, 1.0, np.zeros(len(u))
    for k, row in enumerate(u):
        y[k] = lower
        down, out = 0.2 * np.sqrt(max(upper, 0.0)), 0.2 * np.sqrt(max(lower, 0.0))
        upper, lower = upper + 0.2 + 0.08 * row.mean() - down, lower + down - out
    return y


def _bilinear(u: Signal) -> Signal:
    y, drive = np.zeros(len(u)), u.mean(axis=1)
    for k in range(1, len(u)):
        y[k] = 0.8 * y[k - 1] + 0.15 * y[k - 1] * drive[k - 1] + 0.3 * u[k - 1, 0]
    return y


def _dry_friction(u: Signal) -> Signal:
    y, speed, position = np.zeros(len(u)), 0.0, 0.0
    for k, row in enumerate(u):
        y[k] = position
        speed += 0.1 * (row.sum() - 0.4 * np.tanh(speed / 0.02) - 0.5 * speed - position)
        position += 0.1 * speed
    return y


def _bouc_wen(u: Signal) -> Signal:
    h, y = 0.0, np.zeros(len(u))
    for k in range(len(u)):
        rate = u[k, 0] - u[k - 1, 0] if k else 0.0
        h += 0.9 * rate - 0.6 * (abs(rate) * h + rate * abs(h))
        y[k] = 1.6 * u[k, 0] - h + 0.3 * u[k, 1:].sum()
    return y


def _play(u: Signal) -> Signal:
    y, drive = np.zeros(len(u)), u.mean(axis=1)
    for k in range(1, len(u)):
        y[k] = min(max(y[k - 1], drive[k - 1] - 0.3), drive[k - 1] + 0.3)
    return y


_LAG = linear([0.2], [-0.8])

#: Responses to inputs between about -1 and 1, shape (samples, inputs).
PLANTS: dict[str, Callable[[Signal], Signal]] = {
    "first order": linear([0.1], [-0.9]),
    "second order": linear([0.1, 0.05], [-1.5, 0.7]),
    "third order": linear([0.05, 0.02, 0.01], [-2.1, 1.52, -0.378]),
    "dead time": linear([0.3], [-0.8], 6),
    "integrating": linear([0.02], [-1.0]),
    "saturation": lambda u: np.clip(_LAG(1.5 * u), -0.6, 0.6),
    "dry friction": _dry_friction,
    "Bouc-Wen": _bouc_wen,
    "play": _play,
    "Hammerstein": lambda u: _LAG(u + 0.5 * u**2 - 0.3 * u**3),
    "Wiener": lambda u: np.tanh(_LAG(u)) + 0.2 * _LAG(u) ** 2,
    "two tanks": _two_tanks,
    "bilinear": _bilinear,
    "static curve": lambda u: u[:, 0] + 0.4 * u[:, 0] ** 2 + 0.3 * u.prod(axis=1),
}


def _smooth(rng: Generator, samples: int) -> Signal:
    phases, periods = rng.uniform(0, 2 * np.pi, 6), rng.uniform(20, 150, 6)
    signal = np.sin(2 * np.pi * np.arange(samples)[:, None] / periods + phases).sum(axis=1)
    return np.asarray(signal / np.abs(signal).max())


def _stepped(rng: Generator, samples: int) -> Signal:
    return np.repeat(rng.uniform(-1, 1, samples), rng.integers(5, 30))[:samples]


def _sparse(rng: Generator, samples: int) -> Signal:
    signal = np.zeros(samples)
    places = rng.choice(samples, max(4, samples // 25), replace=False)
    signal[places] = rng.uniform(-1, 1, places.size)
    return np.minimum(1.0, np.maximum(-1.0, 2.0 * _LAG(signal[:, None])))


INPUTS = {"smooth": _smooth, "stepped": _stepped, "sparse": _sparse}


@dataclass(frozen=True)
class Table:
    """A record as text: the time in seconds, inputs, and the output; digits; order of the inputs."""

    t: Signal
    u: Signal
    y: Signal
    digits: int = 17
    order: tuple[int, ...] = ()

    def write(self, path: Path) -> None:
        """Write the table; a column keeps its name when it moves."""
        names = ",".join(("t_s", *(f"u{place}" for place in self.order), "y"))
        rows = np.column_stack([self.t, self.u[:, list(self.order)], self.y])
        np.savetxt(path, rows, f"%.{self.digits}g", ",", header=names, comments="")


def _factor(rng: Generator) -> float:
    return 10.0 ** int(rng.choice((-9, -6, -3, -2, -1, 1, 2, 3, 6, 9)))


def _shift(rng: Generator, table: Table) -> Table:
    """Move the mean of each signal to 30 to 3000 ranges on either side of zero."""
    signals = np.column_stack([table.y, table.u])
    places = rng.choice((-1.0, 1.0), signals.shape[1]) * 10 ** rng.uniform(1.5, 3.5, signals.shape[1])
    signals = signals - signals.mean(axis=0) + places * np.ptp(signals, axis=0)
    return replace(table, u=signals[:, 1:], y=signals[:, 0])


def _reorder(rng: Generator, table: Table) -> Table:
    return replace(table, order=tuple(rng.permutation(table.order).tolist()))


def _start(rng: Generator, table: Table) -> Table:
    return replace(table, t=table.t + float(rng.choice((-5.0, 3600.0, 1e6))))


def _digits(rng: Generator, table: Table) -> Table:
    return replace(table, digits=int(rng.choice((6, 7, 8, 9, 10, 12))))


def _noise(rng: Generator, table: Table) -> Table:
    return replace(table, y=table.y + 1e-9 * np.ptp(table.y) * rng.standard_normal(table.y.size))


#: Changes of a record after which its model is the same.
TRANSFORMATIONS: dict[str, Callable[[Generator, Table], Table]] = {
    "units of the inputs": lambda rng, table: replace(table, u=table.u * [_factor(rng) for _ in table.order]),
    "unit of the output": lambda rng, table: replace(table, y=table.y * _factor(rng)),
    "unit of the time": lambda rng, table: replace(table, t=table.t * _factor(rng)),
    "offset": _shift,
    "digits": _digits,
    "noise of 1e-9": _noise,
    "order of the inputs": _reorder,
    "start of the time": _start,
}


@dataclass(frozen=True)
class Case:
    """Two tables with the same model, and the function that finds it."""

    description: str
    transformation: str
    table: Table
    transformed: Table
    find: Callable[..., Any]


@dataclass(frozen=True)
class Answer:
    """Kind of model or of refusal, errors relative to the range of the output, and equation or message."""

    kind: str
    errors: tuple[float, ...] = ()
    equation: str = ""

    def __str__(self) -> str:
        return f"{self.kind} {' '.join(f'{error:.4g}' for error in self.errors)}  {self.equation}"


def draw_case(seed: int, number: int) -> Case:
    """Return a case; it depends on the arguments only."""
    rng = np.random.default_rng((seed, number))
    plant, kind = str(rng.choice(list(PLANTS))), str(rng.choice(list(INPUTS)))
    inputs = int(rng.choice((1, 1, 2, 3)))
    longest = LONGEST if rng.random() < 0.04 else MOST
    samples = int(np.exp(rng.uniform(np.log(100), np.log(longest))))
    noise = float(rng.choice((0.0, 1e-3, 1e-2)))
    changes = [name for name in TRANSFORMATIONS if inputs > 1 or name != "order of the inputs"]
    change = str(rng.choice(changes))
    is_identified = rng.random() < IDENTIFIED
    u = np.column_stack([INPUTS[kind](rng, samples) for _ in range(inputs)])
    y = PLANTS[plant](u)
    y = y + noise * np.ptp(y) * rng.standard_normal(samples)
    dt = float(rng.choice((1e-3, 0.05, 1.0, 60.0)))
    table = Table(dt * np.arange(samples), u, y, order=tuple(range(inputs)))
    if change == "offset":
        table = _shift(rng, table)
    function = partial(islands.identify, population=20, generations=10) if is_identified else islands.fit
    described = (
        f"{plant}, {kind}, {inputs} inputs, {samples} samples of {dt:g} s, noise {noise:g}: {change}"
        f"{' (identify)' if is_identified else ''}"
    )
    return Case(described, change, table, TRANSFORMATIONS[change](rng, table), function)


def answer(table: Table, find: Callable[..., Any], folder: Path) -> Answer:
    """Write a table, read it and find its model."""
    path = folder / "record.csv"
    table.write(path)
    try:
        record = islands.read_record(path, [f"u{place}" for place in table.order], "y")
        with warnings.catch_warnings(), threadpool_limits(1, user_api="blas"):
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", ExtrapolationWarning)
            found = find(record)
    except IslandsError as error:
        return Answer(type(error).__name__, equation=str(error))
    choice = found.search_result.settings.get("choice") or {}
    errors = [found.best.metrics[part]["free_run"].rmse for part in ("estimation", "validation")]
    kind = f"{type(found.best.model).__name__} {choice.get('kind', '')} {choice.get('delays', '')}"
    return Answer(kind, tuple(error / (np.ptp(table.y) or 1.0) for error in errors), found.best.equation)


def compare(first: Answer, second: Answer, resolution: float) -> str:
    """Return in what two answers differ; empty if they are the same."""
    if first.kind != second.kind:
        return "kind"
    for a, b in zip(first.errors, second.errors, strict=True):
        if abs(a - b) > SAME * max(a, b) and max(a, b) > max(ROUNDING, resolution):
            return "error"
    return ""


def run_case(case: Case, folder: Path) -> tuple[str, str]:
    """Return in what the answers of a case differ, and the answers."""
    try:
        first = answer(case.table, case.find, folder)
        second = answer(case.transformed, case.find, folder)
    except Exception:
        return "traceback", traceback.format_exc()
    # Text of d digits resolves 10^(1-d) of the largest value; a free run accumulates some of these roundings.
    largest = float(np.abs(case.transformed.y).max() / (np.ptp(case.transformed.y) or 1.0))
    resolution = largest * 10.0 ** (1 - min(case.transformed.digits, 15))
    return compare(first, second, resolution), f"  {first}\n  {second}"


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--cases", type=int, default=300)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="stop after this time")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--only", nargs="*", default=list(TRANSFORMATIONS), choices=list(TRANSFORMATIONS))
    parser.add_argument("--verbose", action="store_true", help="print the answers of every case")
    options = parser.parse_args(arguments)
    began, done, defects = time.monotonic(), Counter[str](), Counter[str]()
    for number in range(options.first, options.first + options.cases):
        if time.monotonic() - began > options.seconds:
            break
        case = draw_case(options.seed, number)
        if case.transformation not in options.only:
            continue
        with tempfile.TemporaryDirectory() as folder:
            difference, answers = run_case(case, Path(folder))
        done[case.transformation] += 1
        if difference:
            defects[case.transformation] += 1
        if difference or options.verbose:
            print(f"case {number}, {difference or 'same'}: {case.description}\n{answers}", flush=True)
    for name, count in done.items():
        print(f"{name:24} {count - defects[name]:3} of {count:3} hold")
    print(f"{done.total()} cases, {defects.total()} defects, {time.monotonic() - began:.0f} s")
    return 1 if defects else 0


if __name__ == "__main__":
    sys.exit(main())
