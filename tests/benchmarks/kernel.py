"""Milliseconds per individual, our kernels beside plain numpy, in one run on one record.

The yardstick is the plain implementation: column_stack, modified Gram-Schmidt forward selection for every
second individual, lstsq, and a Python loop over the steps on vectors of all shooting intervals. Ratios are
what counts; times are process CPU time, medians over the individuals. Run it with ``make bench``, which keeps
the linear algebra library on one thread: its idle threads would be counted against numpy.
"""

import argparse
import hashlib
import json
import random
import statistics
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.estimation.froe import froe
from islands.estimation.normal_equations import from_gram
from islands.kernels.simulate import Layout, simulate
from islands.model.expression import Apply, Constant, Expression, Lagged
from islands.model.model import canonical_order
from islands.model.primitives import MUL, PRIMITIVES, SIGN, SUB
from islands.model.regressor import Regressor, regressor
from islands.model.text import plain
from islands.program.columns import gram_matrix
from islands.program.linker import link
from islands.simulation.layout import layout
from islands.simulation.predictors import bound_of
from islands.systems.catalogue import make_record

TERMS, INTERVAL, DEEPEST = 10, 500, 25


def main() -> None:
    """Print the table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--individuals", type=int, default=30)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    whole = make_record("bouc-wen-piezo", "consistent", "estimation")
    # In units of their own spread, so that products of many factors keep their size.
    record = Dataset(whole.u / (3 * whole.u.std()), whole.y / (3 * whole.y.std()), whole.dt)
    figures = {}
    for kind, make in (("poly", monomial), ("general", tree)):
        individuals = population(make, arguments.individuals)
        text = "\n".join(plain(item.expression) for terms in individuals for item in terms)
        figures[kind] = measure(record, individuals) | {
            "workload": hashlib.sha256(text.encode()).hexdigest()[:12]
        }
    if arguments.json:
        print(json.dumps({"samples": record.samples, **figures}, indent=2))
        return
    print(f"{record.samples} samples, {TERMS} terms, intervals of {INTERVAL}, ms per individual (median)")
    for kind, row in figures.items():
        print(f"\n{kind}  (workload {row['workload']})")
        for what in (*STEPS, "evaluation"):
            ours, theirs = row[what]
            print(f"  {what:14s} {ours:8.3f}   numpy {theirs:8.3f}   ratio {theirs / ours:6.1f}")


def monomial(draw: random.Random) -> Expression:
    """Draw a product of one to five lagged signals."""
    degree = draw.choices([1, 2, 3, 4, 5], [20, 25, 25, 18, 12])[0]
    return Apply(MUL, (*(leaf(draw) for _ in range(degree)), Constant(1.0)))


def tree(draw: random.Random, height: int = 4) -> Expression:
    """Draw a tree of products, differences and signs."""
    if height == 0 or draw.random() < 0.15:
        return leaf(draw)
    match draw.choices("*-sq", [35, 25, 15, 25])[0]:
        case "*":
            return Apply(MUL, (tree(draw, height - 1), tree(draw, height - 1)))
        case "-":
            return Apply(SUB, (tree(draw, height - 1), tree(draw, height - 1)))
        case "s":
            return Apply(SIGN, (tree(draw, height - 1),))
    return tree(draw, height - 1)


def leaf(draw: random.Random) -> Lagged:
    """Draw a signal and a lag up to 25."""
    return Lagged(draw.choice((0, 1)), 1 + min(int(draw.expovariate(0.25)), DEEPEST - 1))


def population(make: Callable[[random.Random], Expression], count: int) -> list[list[Regressor]]:
    """Draw individuals: y(k-1) and others, ten different regressors each."""
    draw = random.Random(1)
    individuals = []
    while len(individuals) < count:
        terms = [regressor(Lagged(0, 1))[1]]
        while len(terms) < TERMS:
            candidate = regressor(make(draw))[1]
            if candidate is not None and candidate.lags and candidate not in terms:
                terms.append(candidate)
        individuals.append(canonical_order(item for item in terms if item is not None))
    return individuals


#: Ours have inner products where numpy has columns; nothing is cached.
STEPS = ("columns", "froe", "least squares", "linking", "simulation")

#: How often an evaluation takes each step: every second individual is pruned.
SHARES = (1.0, 0.5, 1.0, 1.0, 1.0)


def measure(record: Dataset, individuals: list[list[Regressor]]) -> dict[str, tuple[float, float]]:
    """Time each step of an evaluation, ours and numpy's."""
    cut = layout(record, DEEPEST, INTERVAL)
    draw = random.Random(2)
    ours, theirs = [], []
    for terms in [individuals[0], *individuals]:  # the first one once more: it compiles
        theta = np.array([0.97] + [(draw.random() - 0.5) * 0.004 for _ in terms[1:]])
        # Each side twice: the second time its data are in the caches, as they are in a search.
        (_, _), (times, squared) = (our_evaluation(terms, theta, record, cut) for _ in range(2))
        ours.append(times)
        (_, _), (times, error) = (numpy_evaluation(terms, theta, record) for _ in range(2))
        theirs.append(times)
        assert np.isclose(squared, error, rtol=1e-9), "the two simulations differ"
    medians = {
        name: (
            statistics.median(row[step] for row in ours[1:]),
            statistics.median(row[step] for row in theirs[1:]),
        )
        for step, name in enumerate(STEPS)
    }
    own, other = (
        sum(share * medians[name][side] for share, name in zip(SHARES, STEPS, strict=True)) for side in (0, 1)
    )
    return medians | {"evaluation": (own, other)}


def our_evaluation(
    terms: list[Regressor], theta: NDArray[np.float64], record: Dataset, cut: Layout
) -> tuple[list[float], float]:
    """Return the milliseconds of each step and the squared error over the whole intervals."""
    squared, diverged, nothing = np.empty(len(cut.start)), np.empty(len(cut.start), np.int64), np.empty(0)
    watch = Watch()
    gram = gram_matrix([*terms, Lagged(0, 0)], record, DEEPEST)
    watch.lap()
    froe(gram, 1e-9)
    watch.lap()
    from_gram(gram, np.empty((0, len(terms))), np.empty(0))
    watch.lap()
    program = link(terms)
    watch.lap()
    simulate(program, theta, cut, bound_of(record), False, squared, diverged, nothing)
    watch.lap()
    return watch.times, float(squared[cut.length == INTERVAL].sum())


def numpy_evaluation(
    terms: list[Regressor], theta: NDArray[np.float64], record: Dataset
) -> tuple[list[float], float]:
    """Return the same of plain numpy."""
    u, y = record.u[:, 0], record.y
    watch = Watch()
    matrix = numpy_columns(terms, u, y)
    watch.lap()
    numpy_froe(matrix, y[DEEPEST:], 1e-9)
    watch.lap()
    np.linalg.lstsq(matrix, y[DEEPEST:], rcond=None)
    watch.lap()
    watch.lap()  # numpy links nothing
    error = numpy_simulation(terms, theta, u, y)
    watch.lap()
    return watch.times, error


class Watch:
    """A stopwatch of process CPU time, in milliseconds."""

    def __init__(self) -> None:
        self.times: list[float] = []
        self._last = time.process_time()

    def lap(self) -> None:
        """Note the time since the last lap."""
        now = time.process_time()
        self.times.append(1e3 * (now - self._last))
        self._last = now


def numpy_columns(
    terms: list[Regressor], u: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Stack the columns of the regressor matrix."""
    signals = (y, u)
    return np.column_stack(
        [evaluate(item.expression, lambda c, lag: signals[c][DEEPEST - lag : len(y) - lag]) for item in terms]
    )


def evaluate(
    expression: Expression, signal: Callable[[int, int], NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Evaluate an expression on whole arrays."""
    match expression:
        case Lagged(channel, lag):
            return signal(channel, lag)
        case Constant(number):
            return np.float64(number)
        case Apply(primitive, arguments):
            parts = [evaluate(argument, signal) for argument in arguments]
            if primitive == SIGN:
                return np.sign(parts[0])
            result = parts[0]
            for part in parts[1:]:
                result = PRIMITIVES[primitive.name].scalar(result, part)
            return result
    raise ValueError(expression)


def numpy_froe(matrix: NDArray[np.float64], target: NDArray[np.float64], tolerance: float) -> list[int]:
    """Select columns by modified Gram-Schmidt, the textbook's way."""
    matrix, energy = matrix.copy(), target @ target
    selected: list[int] = []
    left = list(range(matrix.shape[1]))
    while left:
        ratios = [(matrix[:, j] @ target) ** 2 / (matrix[:, j] @ matrix[:, j]) / energy for j in left]
        best = int(np.argmax(ratios))
        if ratios[best] < tolerance:
            break
        chosen = left.pop(best)
        selected.append(chosen)
        w = matrix[:, chosen]
        norm = w @ w
        for j in left:
            matrix[:, j] -= (w @ matrix[:, j]) / norm * w
    return selected


def numpy_simulation(
    terms: list[Regressor], theta: NDArray[np.float64], u: NDArray[np.float64], y: NDArray[np.float64]
) -> float:
    """Simulate all whole intervals together, a Python loop over their steps; return the squared error."""
    lanes = (len(y) - DEEPEST) // INTERVAL
    samples = (np.arange(lanes) * INTERVAL)[None, :] + np.arange(DEEPEST + INTERVAL)[:, None]
    measured, inputs = y[samples], u[samples]
    simulated = measured.copy()
    signals = (simulated, inputs)
    for k in range(DEEPEST, DEEPEST + INTERVAL):
        total = np.zeros(lanes)
        for weight, item in zip(theta, terms, strict=True):
            total = total + weight * evaluate(item.expression, lambda c, lag, k=k: signals[c][k - lag])
        simulated[k] = total
    return float(np.sum((simulated[DEEPEST:] - measured[DEEPEST:]) ** 2))


if __name__ == "__main__":
    main()
