"""Cost as a function of samples, terms, size of trees and islands."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import cycle
from pathlib import Path
from statistics import fmean, median

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from islands.expressions.tree import walk
from islands.records.dataset import Dataset
from islands.report.figures.style import MEASURED, RESIDUAL, SIMULATED, blank, finish, house_style, save
from lab.speed import kernel_evaluator
from lab.speed.full_runs import Run
from lab.speed.workload import WorkloadModel, full_tree, monomial, random_workload

#: Samples at which the cost is measured.
SAMPLES = (1_000, 2_000, 5_000, 10_000, 20_000, 50_000, 100_000)

#: Terms at which the cost is measured.
TERMS = (2, 5, 10, 15, 20)

#: Heights of trees at which the cost is measured.
HEIGHTS = (1, 2, 3, 4, 5)

Points = tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class Line:
    """Least-squares line through points, ``y = intercept + slope x``.

    Attributes
    ----------
    r2 : float
        Fraction of the variance of y that the line explains; 1 if y is constant.
    """

    intercept: float
    slope: float
    r2: float


@dataclass(frozen=True, slots=True)
class Scaling:
    """Cost as a function of one quantity.

    Attributes
    ----------
    name : str
        Key of the quantity, for example ``samples``.
    x_label, y_label : str
        Axis labels with units.
    curves : mapping of str to points
        Pairs (x, y) in ascending order of x.
    """

    name: str
    x_label: str
    y_label: str
    curves: Mapping[str, Points]


def line_through(points: Points) -> Line:
    """Fit a line to two points or more."""
    x, y = np.array(points).T
    slope, intercept = np.polyfit(x, y, 1)
    spread = float(np.sum((y - y.mean()) ** 2))
    left = float(np.sum((y - intercept - slope * x) ** 2))
    return Line(float(intercept), float(slope), 1.0 - left / spread if spread else 1.0)


def against_samples(record: Dataset, individuals: int, progress: Callable[[float], None]) -> Scaling:
    """Measure products of lagged signals on more and more of the first samples of a record."""
    candidates = random_workload(monomial, individuals)
    sizes = [size for size in SAMPLES if size <= record.samples]
    costs = []
    for place, size in enumerate(sizes):
        costs.append((float(size), _cost(kernel_evaluator.prepare_record(record[:size]), candidates)))
        progress((place + 1) / len(sizes))
    return _evaluation("samples", "samples of the record", costs)


def against_terms(
    state: kernel_evaluator.Prepared, individuals: int, progress: Callable[[float], None]
) -> Scaling:
    """Measure individuals with an increasing number of products of lagged signals."""
    costs = []
    for place, terms in enumerate(TERMS):
        costs.append((float(terms), _cost(state, random_workload(monomial, individuals, terms))))
        progress((place + 1) / len(TERMS))
    return _evaluation("terms", "terms of an individual", costs)


def against_tree_size(
    state: kernel_evaluator.Prepared, individuals: int, progress: Callable[[float], None]
) -> Scaling:
    """Measure individuals of ten full trees of increasing height; their size is the number of nodes."""
    costs = []
    for place, height in enumerate(HEIGHTS):
        candidates = random_workload(partial(full_tree, height=height), individuals)
        costs.append((_nodes(candidates), _cost(state, candidates)))
        progress((place + 1) / len(HEIGHTS))
    return _evaluation("tree_size", "nodes of an individual, ten full trees of height 1 to 5", costs)


def against_islands(runs: Mapping[int, Sequence[Run]]) -> Scaling:
    """Return the individuals per second of simultaneous searches, by the number of islands."""
    points = tuple(
        (float(islands), sum(run.per_second for run in each)) for islands, each in sorted(runs.items())
    )
    return Scaling(
        "islands", "islands, each in a process", "individuals per second", {"all islands together": points}
    )


def _cost(state: kernel_evaluator.Prepared, candidates: Sequence[WorkloadModel]) -> dict[str, float]:
    """Return the median time in milliseconds of evaluations with pruning, by the state of the cache."""
    return {
        "nothing cached": median(
            kernel_evaluator.uncached_ms(state, each, pruned=True) for each in candidates
        ),
        "inner products cached": median(
            kernel_evaluator.cached_ms(state, each, pruned=True) for each in candidates
        ),
    }


def _evaluation(name: str, x_label: str, costs: Sequence[tuple[float, Mapping[str, float]]]) -> Scaling:
    curves = {curve: tuple((x, cost[curve]) for x, cost in costs) for curve in costs[0][1]}
    return Scaling(name, x_label, "CPU time of an evaluation (ms)", curves)


def _nodes(candidates: Sequence[WorkloadModel]) -> float:
    return fmean(sum(1 for item in each.regressors for _ in walk(item.expression)) for each in candidates)


_LOOKS = ((SIMULATED, "o"), (RESIDUAL, "s"), (MEASURED, "^"))


@house_style()
def draw_scaling(scaling: Scaling) -> Figure:
    """Draw a scaling; the legend shows how well a line fits each curve."""
    figure = blank(3.2)
    axes = figure.subplots()
    for (name, points), (colour, marker) in zip(scaling.curves.items(), cycle(_LOOKS), strict=False):
        x, y = np.array(points).T
        line = line_through(points)
        # A line through two points is always exact.
        label = f"{name}, line with R² = {line.r2:.4f}" if len(points) > 2 else name
        axes.plot(x, y, marker, color=colour, markersize=4, label=label)
        ends = np.array([x[0], x[-1]])
        axes.plot(ends, line.intercept + line.slope * ends, color=colour, lw=0.8)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel(scaling.x_label)
    axes.set_ylabel(scaling.y_label)
    axes.legend()
    return finish(figure)


def save_scalings(scalings: Iterable[Scaling], folder: Path) -> tuple[Path, ...]:
    """Write one SVG figure per scaling; return the files."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for scaling in scalings:
        path = folder / f"{scaling.name}.svg"
        save(draw_scaling(scaling), path)
        written.append(path)
    return tuple(written)
