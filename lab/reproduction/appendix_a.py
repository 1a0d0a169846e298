"""Appendix A of the paper: the influence of the pruning probability on S1 and S2 of equation (A.1).

Models are identified on a soft input and validated on a white one. Each run takes the individual of least
training error, the one-step-ahead error that the search minimises; validation data have no influence.
"""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from math import exp, inf, isfinite, log
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy import stats

from islands.evolution.archipelago import Archipelago, empty_archipelago
from islands.evolution.engine import SerialEngine
from islands.evolution.individual import Individual, require_genes
from islands.evolution.presets import PRESETS
from islands.evolution.problem import make_problem
from islands.models.equations import equation
from islands.models.narx import Model
from islands.progress import never_stop
from islands.records.dataset import Dataset
from islands.simulation.predictors import Simulation, free_run, one_step_ahead
from islands.systems import appendix
from islands.systems.appendix import SOFT_VARIANCE
from islands.validation.metrics import metrics
from lab.reproduction.monte_carlo import MonteCarloGroup, ScanLine, draw_groups, draw_scan
from lab.reproduction.section import WHY, ComparisonTable, Section, SectionFigure
from lab.reproduction.tasks import Document, ReproductionOptions, Task

#: Pruning probabilities (PRPB) of the appendix.
PROBABILITIES = (0.0, 0.25, 0.5, 0.75, 1.0)

#: Systems and presets by name.
SYSTEMS = MappingProxyType({"s1": (appendix.S1, "paper-appendix"), "s2": (appendix.S2, "paper-appendix-s2")})

#: Variances of the soft input that are compared.
VARIANCES = (0.003, 0.01, 0.02, 0.025, 0.03, 0.04, 0.06, 0.1, 0.2)

#: Variance that the paper states for the white noise from which it filters the soft input.
STATED_VARIANCE = 0.2

#: System and pruning probability of the runs at every variance, and their number, at most.
SCANNED = MappingProxyType({("s1", 0.0): 50, ("s1", 1.0): 50, ("s2", 0.0): 10})

#: Runs of the quick form for each pruning probability: S1 only, without pruning and with it.
QUICK_RUNS = 3

#: Pruning probabilities of the quick form.
QUICK_PROBABILITIES = (0.0, 1.0)

#: Runs of one task.
_BATCH = 5

#: Simulations of the white record: those of PE and of SE.
_SIMULATIONS = (one_step_ahead, free_run)

#: Number of runs in the paper.
PUBLISHED_RUNS = 50

#: Confidence of the intervals, and of the decisions of Tukey's test.
_CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class AppendixRun:
    """Model of least training error of one search.

    Attributes
    ----------
    seed : int
    size : int
        Number of terms.
    training : float
        Mean squared one-step-ahead error on the soft record.
    prediction, simulation : float
        PE and SE: MAPE of the one-step-ahead prediction and of the free run on the white record, in per cent;
        infinite if it diverges.
    """

    seed: int
    size: int
    training: float
    prediction: float
    simulation: float

    @property
    def unstable(self) -> bool:
        """Whether the free run diverges."""
        return not isfinite(self.simulation)


@dataclass(frozen=True, slots=True)
class PublishedCount:
    """A number of runs that the paper gives, out of 50.

    Attributes
    ----------
    system : str
    prune : float
    event : str
        An entry of `EVENTS`.
    least, most : int
        Range of the count. A statement about a median is that at least half of the runs are on either side.
    """

    system: str
    prune: float
    event: str
    least: int
    most: int


#: Events of a run that the paper counts.
EVENTS = MappingProxyType(
    {
        "unstable": lambda run: run.unstable,
        "10 terms": lambda run: run.size == 10,
        "5 to 8 terms": lambda run: 5 <= run.size <= 8,
        "6 terms or fewer": lambda run: run.size <= 6,
        "6 terms or more": lambda run: run.size >= 6,
    }
)

#: Counts and sizes that the text of the appendix gives.
PUBLISHED = (
    PublishedCount("s1", 0.0, "unstable", 20, 20),
    PublishedCount("s1", 1.0, "unstable", 1, 1),
    PublishedCount("s2", 0.0, "unstable", 49, 49),
    PublishedCount("s1", 0.0, "10 terms", 50, 50),
    PublishedCount("s1", 0.25, "10 terms", 50, 50),
    PublishedCount("s1", 1.0, "5 to 8 terms", 50, 50),
    PublishedCount("s1", 1.0, "6 terms or fewer", 25, 50),
    PublishedCount("s1", 1.0, "6 terms or more", 25, 50),
)

#: Table A.3: difference of the mean PE of S2 between two probabilities, and whether the test rejects equal
#: means.
TABLE_A3 = MappingProxyType(
    {
        (0.0, 0.25): (-6.1251, False),
        (0.0, 0.5): (-10.9347, True),
        (0.0, 0.75): (-14.0503, True),
        (0.0, 1.0): (-15.0704, True),
        (0.25, 0.5): (-4.8096, False),
        (0.25, 0.75): (-7.9252, True),
        (0.25, 1.0): (-8.9454, True),
        (0.5, 0.75): (-3.1157, False),
        (0.5, 1.0): (-4.1358, False),
        (0.75, 1.0): (-1.0201, False),
    }
)

#: System, variance of the soft input, and pruning probability of a set of runs.
Cell = tuple[str, float, float]

#: Rows of Tukey's test by the two pruning probabilities.
Tukey = Mapping[tuple[float, float], "MeanDifference"]


def run_searches(system: str, variance: float, prune: float, first: int, count: int) -> Document:
    """Run searches with consecutive seeds; return the model of least training error of each.

    The seed also determines the records, so that every run of a cell has other data and equal seeds of two
    probabilities have equal data.

    Parameters
    ----------
    system : str
        A key of `SYSTEMS`.
    variance : float
        Variance of the soft input.
    prune : float
        Pruning probability.
    first, count : int
        First seed, and number of runs.
    """
    return {"runs": [_search(system, variance, prune, seed) for seed in range(first, first + count)]}


def _search(system: str, variance: float, prune: float, seed: int) -> Document:
    simulated, preset = SYSTEMS[system]
    record = appendix.soft_record(simulated, seed, variance=variance)
    settings = replace(PRESETS[preset], prune=prune, select="fitness")
    problem, archipelago = make_problem(record, settings), empty_archipelago(1, seed)
    with closing(SerialEngine().run(problem, archipelago, never_stop)) as epochs:
        for epoch in epochs:
            archipelago = epoch.archipelago
    fittest = _fittest(archipelago)
    model = Model(fittest.regressors, fittest.theta, record.input_names, record.output_name, record.dt)
    white, warm_up = appendix.white_record(simulated, seed), settings.maximum_lag
    prediction, simulation = (_measure(simulate(model, white, warm_up), white) for simulate in _SIMULATIONS)
    return {
        "seed": seed,
        "equation": equation(model),
        "size": model.size,
        "training": fittest.fitness,
        "prediction": prediction,
        "simulation": simulation,
    }


def _measure(run: Simulation, record: Dataset) -> float | None:
    """Return the MAPE of a simulation, equation (7); None if it diverged."""
    return metrics(record.y, run.y).mape if run.outcome else None


def _fittest(archipelago: Archipelago) -> Individual:
    """Return the individual of least training error; ties are broken by size, then by text."""
    entries = map(require_genes, archipelago.hall_of_fame.entries)
    return min(entries, key=lambda entry: (entry.fitness, entry.size, entry.key))


def plan(options: ReproductionOptions) -> list[Task]:
    """Return the tasks of the appendix: batches of runs."""
    return [task for cell, runs in _count_runs(options).items() for task in _batch(cell, runs)]


def _count_runs(options: ReproductionOptions) -> dict[Cell, int]:
    """Return the number of runs of every cell."""
    if options.quick:
        runs = min(options.runs, QUICK_RUNS)
        return {("s1", SOFT_VARIANCE, prune): runs for prune in QUICK_PROBABILITIES}
    counts = {(system, SOFT_VARIANCE, prune): options.runs for system in SYSTEMS for prune in PROBABILITIES}
    counts |= {("s2", STATED_VARIANCE, prune): options.runs for prune in PROBABILITIES}
    for variance in VARIANCES:
        for (system, prune), runs in SCANNED.items():
            counts.setdefault((system, variance, prune), min(options.runs, runs))
    return counts


def _batch(cell: Cell, runs: int) -> list[Task]:
    system, variance, prune = cell
    return [
        Task(
            f"appendix-a-{system}-{variance:g}-{prune:g}-{first}",
            run_searches,
            (system, variance, prune, first, min(_BATCH, runs - first)),
        )
        for first in range(0, runs, _BATCH)
    ]


def read_runs(
    results: Mapping[str, Document], options: ReproductionOptions
) -> dict[Cell, tuple[AppendixRun, ...]]:
    """Return the runs of every cell from the results of the tasks of `plan`."""
    return {
        cell: tuple(
            AppendixRun(
                each["seed"],
                each["size"],
                each["training"],
                *(inf if each[name] is None else each[name] for name in ("prediction", "simulation")),
            )
            for task in _batch(cell, runs)
            for each in results[task.key]["runs"]
        )
        for cell, runs in _count_runs(options).items()
    }


def _count(published: PublishedCount, runs: Sequence[AppendixRun]) -> int:
    return sum(map(EVENTS[published.event], runs))


def _count_unstable(runs: Sequence[AppendixRun]) -> int:
    return sum(run.unstable for run in runs)


def interval(count: int, runs: int) -> tuple[float, float]:
    """Return the exact binomial interval (Clopper and Pearson) of a proportion, with a confidence of 95 %."""
    found = stats.binomtest(count, runs).proportion_ci(_CONFIDENCE, method="exact")
    return float(found.low), float(found.high)


def expected_counts(count: int, runs: int) -> tuple[int, int]:
    """Return the central 95 % range of the count among 50 runs, given a count among the runs here.

    Published counts are random, too, so that they are not compared with the interval of the proportion.
    """
    low, high = _predict_counts(count, runs).ppf((0.5 - _CONFIDENCE / 2.0, 0.5 + _CONFIDENCE / 2.0))
    return int(low), int(high)


def _predict_counts(count: int, runs: int) -> Any:
    """Return the distribution of the count among 50 runs; the proportion has Jeffreys' prior."""
    return stats.betabinom(PUBLISHED_RUNS, count + 0.5, runs - count + 0.5)


def log_likelihood(runs: Mapping[tuple[str, float], Sequence[AppendixRun]]) -> float:
    """Return the logarithm of the probability of the published counts, given runs here.

    An event that occurs in ``k`` of ``n`` runs has a proportion with the posterior of Jeffreys' prior, and a
    published count among 50 runs then has a beta-binomial distribution. The probabilities of the counts are
    multiplied, although those of the same runs depend on each other.

    Parameters
    ----------
    runs : mapping
        Runs by system and pruning probability; counts of others are left out.
    """
    total = 0.0
    for published in PUBLISHED:
        seen = runs.get((published.system, published.prune))
        if seen:
            distribution = _predict_counts(_count(published, seen), len(seen))
            total += log(distribution.pmf(np.arange(published.least, published.most + 1)).sum())
    return total


@dataclass(frozen=True, slots=True)
class MeanDifference:
    """Row of Tukey's test: the means of two groups.

    Attributes
    ----------
    difference : float
        Mean of the second group minus that of the first.
    p : float
        Adjusted p value.
    """

    difference: float
    p: float

    @property
    def rejected(self) -> bool:
        """Whether the test rejects equal means."""
        return self.p < 1.0 - _CONFIDENCE


def compare_means(groups: Mapping[float, Sequence[float]]) -> dict[tuple[float, float], MeanDifference]:
    """Compare the means of all pairs of groups by Tukey's honestly significant difference.

    Parameters
    ----------
    groups : mapping
        Finite values of each group, at least two.
    """
    test, names = stats.tukey_hsd(*groups.values()), list(groups)
    return {
        (names[one], names[other]): MeanDifference(
            float(test.statistic[other, one]), float(test.pvalue[one, other])
        )
        for one, other in combinations(range(len(names)), 2)
    }


def summarise(results: Mapping[str, Document], options: ReproductionOptions) -> Section:
    """Return the section of the appendix from the results of the tasks of `plan`.

    Parameters
    ----------
    results : mapping
        Results by key.
    options : ReproductionOptions
        The options of the plan.
    """
    cells = read_runs(results, options)
    scan = _summarise_scan(cells)
    shown = {
        system: {
            prune: runs for (name, at, prune), runs in cells.items() if (name, at) == (system, SOFT_VARIANCE)
        }
        for system in SYSTEMS
    }
    shown = {system: groups for system, groups in shown.items() if groups}
    tests = {
        variance: compare_means(groups)
        for variance in dict.fromkeys((SOFT_VARIANCE, STATED_VARIANCE))
        if len(groups := _get_errors(cells, variance)) == len(PROBABILITIES)
    }
    tables = [_tabulate_counts(shown, scan), _tabulate_runs(shown), _tabulate_trends(shown)]
    figures = [
        SectionFigure(
            "figure-a7",
            "Figure A.7: PE and SE on the white record, the fraction of unstable models (with binomial 95 % "
            "intervals and the published counts), and the numbers of terms. Notches show the uncertainty of "
            "the medians.",
            partial(_draw_figure_a7, shown),
        )
    ]
    if tests:
        tables += [_tabulate_tukey(variance, test) for variance, test in tests.items()]
    if scan:
        tables.append(_tabulate_scan(scan))
        figures.append(
            SectionFigure(
                "appendix-a-scan",
                "Scan of the variance of the soft input: unstable models, numbers of terms, and the "
                "log-likelihood of the counts and sizes of the paper. The circle is the largest.",
                partial(_draw_scan_figure, scan),
            )
        )
    return Section(
        "Appendix A: influence of the pruning probability",
        _introduce(options, shown, scan, tests),
        tuple(tables),
        tuple(figures),
        _describe(cells, scan, tests),
    )


@dataclass(frozen=True, slots=True)
class ScanPoint:
    """Runs at one variance of the soft input.

    Attributes
    ----------
    variance : float
    runs : mapping
        Runs by system and pruning probability; equally many at every variance.
    likelihood : float
        See `log_likelihood`.
    """

    variance: float
    runs: Mapping[tuple[str, float], Sequence[AppendixRun]]
    likelihood: float


def _summarise_scan(cells: Mapping[Cell, Sequence[AppendixRun]]) -> list[ScanPoint]:
    """Return the points of the scan; none if a cell of it has no runs, as in the quick form."""
    points = []
    for variance in VARIANCES:
        runs = {
            (system, prune): cells[system, variance, prune][:number]
            for (system, prune), number in SCANNED.items()
            if (system, variance, prune) in cells
        }
        if len(runs) == len(SCANNED):
            points.append(ScanPoint(variance, runs, log_likelihood(runs)))
    return points


def _get_errors(cells: Mapping[Cell, Sequence[AppendixRun]], variance: float) -> dict[float, list[float]]:
    """Return the finite PE of S2 by pruning probability, of those with at least two."""
    found = {
        prune: [run.prediction for run in cells.get(("s2", variance, prune), ()) if isfinite(run.prediction)]
        for prune in PROBABILITIES
    }
    return {prune: errors for prune, errors in found.items() if len(errors) > 1}


def _introduce(
    options: ReproductionOptions,
    shown: Mapping[str, Mapping[float, Sequence[AppendixRun]]],
    scan: Sequence[ScanPoint],
    tests: Mapping[float, Tukey],
) -> tuple[str, ...]:
    number = max(len(runs) for groups in shown.values() for runs in groups.values())
    data = (
        "Systems S1 and S2 of equation (A.1) are identified on 500 samples of a soft input, with the "
        "settings of the presets paper-appendix and paper-appendix-s2, and validated on 500 samples of a "
        "white input. "
        f"There are {number} runs for each pruning probability (PRPB), each with other records. A run takes "
        "the model of least training error, as in the paper. PE is the MAPE of the one-step-ahead prediction "
        "on the white record, and SE that of the free run; the paper does not name the metric of its errors, "
        "and (7) is the one that it defines. A model is unstable if its free run leaves a bound of a million "
        "output ranges."
    )
    variance = (
        "The paper states the poles of the low-pass filter, but not its gain. The variance of the soft input "
        f"is {SOFT_VARIANCE:g} here, by a scan for the value that makes the counts and sizes of the paper "
        "most likely for S1 and S2 together."
    )
    paragraphs = [data, variance]
    if options.quick:
        paragraphs.append(
            "This is the short form: S1 only, few runs, two pruning probabilities, no scan. Its intervals "
            "are wide, so that it shows directions only."
        )
    if scan:
        paragraphs.append(_judge_scan(scan))
    if tests:
        paragraphs.append(_judge_errors(tests))
    return tuple(paragraphs)


def _judge_scan(scan: Sequence[ScanPoint]) -> str:
    """State which counts of the paper no variance of the scan meets together."""
    best = max(scan, key=lambda point: point.likelihood)
    met = {
        published: [
            point.variance
            for point in scan
            if (runs := point.runs.get((published.system, published.prune))) and _is_met(published, runs)
        ]
        for published in PUBLISHED
        if (published.system, published.prune) in SCANNED
    }
    common = [point for point in scan if all(point.variance in values for values in met.values())]
    parts = "; ".join(f"{_name(published)}: {_list_values(values)}" for published, values in met.items())
    verdict = "No variance meets all of them."
    if common:
        chances = ", ".join(f"{exp(point.likelihood - best.likelihood):.2g}" for point in common)
        verdict = (
            f"Each alone agrees at {_list_values([point.variance for point in common])}, where all together "
            f"are {chances} times as likely as at {best.variance:g}."
        )
    return (
        f"The scan has its largest likelihood at the variance {best.variance:g}. The published counts agree "
        f"with the runs here, at a confidence of 95 %, at these variances. {parts}. {verdict}"
    )


def _judge_errors(tests: Mapping[float, Tukey]) -> str:
    """State how many decisions of Table A.3 agree, and compare its largest difference, at every variance."""
    ends = 0.0, 1.0
    agreeing = {
        variance: sum(test[pair].rejected == rejected for pair, (_, rejected) in TABLE_A3.items())
        for variance, test in tests.items()
    }
    here = " and ".join(
        f"{test[ends].difference:.3g} at the variance {variance:g} ({agreeing[variance]} of {len(TABLE_A3)} "
        "decisions agree)"
        for variance, test in tests.items()
    )
    text = (
        f"The mean PE of S2 differs by {TABLE_A3[ends][0]:.4g} between PRPB 0 and 1 in Table A.3, and by "
        f"{here} here."
    )
    best = max(agreeing, key=lambda variance: agreeing[variance])
    if agreeing[best] > min(agreeing.values()) and best != SOFT_VARIANCE:
        text += (
            f" Table A.3 thus needs a variance near {best:g}, and the counts and sizes of S1 one near "
            f"{SOFT_VARIANCE:g}: no variance meets both."
        )
    return text


def _list_values(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in values) or "none"


def _name(published: PublishedCount) -> str:
    return f"{published.system.upper()}, PRPB {published.prune:g}, {published.event}"


def _is_met(published: PublishedCount, runs: Sequence[AppendixRun]) -> bool:
    """Return whether a published count lies in the range that the runs here make likely."""
    low, high = expected_counts(_count(published, runs), len(runs))
    return low <= published.most and published.least <= high


def _write_published(published: PublishedCount) -> str:
    if published.least == published.most:
        return f"{published.least} of {PUBLISHED_RUNS}"
    return f"at least {published.least} of {PUBLISHED_RUNS}"


def _tabulate_counts(
    shown: Mapping[str, Mapping[float, Sequence[AppendixRun]]], scan: Sequence[ScanPoint]
) -> ComparisonTable:
    rows = []
    for published in PUBLISHED:
        runs = shown.get(published.system, {}).get(published.prune)
        if not runs:
            continue
        count = _count(published, runs)
        low, high = interval(count, len(runs))
        here = f"{count} of {len(runs)} (95 %: {100 * low:.0f} to {100 * high:.0f} %)"
        rows.append((_name(published), _write_published(published), here, _explain(published, runs, scan)))
    return ComparisonTable("Counts and sizes in the text of Appendix A", tuple(rows))


def _explain(published: PublishedCount, runs: Sequence[AppendixRun], scan: Sequence[ScanPoint]) -> str:
    low, high = expected_counts(_count(published, runs), len(runs))
    found = f"{PUBLISHED_RUNS} runs like those here have {low} to {high} (95 %)"
    if _is_met(published, runs):
        return f"agrees: {found}"
    elsewhere = [
        point.variance
        for point in scan
        if (seen := point.runs.get((published.system, published.prune))) and _is_met(published, seen)
    ]
    where = f"; in the scan it agrees at the variance {_list_values(elsewhere)}" if elsewhere else ""
    return f"differs: {found}{where}"


def _tabulate_runs(shown: Mapping[str, Mapping[float, Sequence[AppendixRun]]]) -> ComparisonTable:
    rows = []
    for system, groups in shown.items():
        for prune, runs in groups.items():
            stated = any((each.system, each.prune) == (system, prune) for each in PUBLISHED)
            sizes = [run.size for run in runs]
            rows.append(
                (
                    f"{system.upper()}, {prune:g}",
                    f"{_count_unstable(runs)} of {len(runs)}",
                    f"{min(sizes)} to {max(sizes)}, median {np.median(sizes):g}",
                    _write_quartiles([run.prediction for run in runs]),
                    _write_quartiles([run.simulation for run in runs if not run.unstable]),
                    "the published numbers are in the first table"
                    if stated
                    else "published in Figure A.7 only",
                )
            )
    return ComparisonTable(
        "All runs: unstable models, terms, and quartiles of PE and of SE of the stable models in per cent",
        tuple(rows),
        ("system, PRPB", "unstable", "terms", "PE", "SE", WHY),
    )


def _write_quartiles(values: Iterable[float]) -> str:
    finite = [value for value in values if isfinite(value)]
    return " / ".join(f"{value:.3g}" for value in np.quantile(finite, (0.25, 0.5, 0.75))) if finite else "-"


def _tabulate_trends(shown: Mapping[str, Mapping[float, Sequence[AppendixRun]]]) -> ComparisonTable:
    """Compare the directions that the text of the paper states."""
    rows = []
    for system, groups in shown.items():
        name, ends = f"{system.upper()}, PRPB 0 to 1", (groups[0.0], groups[1.0])
        errors = [[run.prediction for run in runs if isfinite(run.prediction)] for runs in ends]
        shares = [100.0 * _count_unstable(runs) / len(runs) for runs in ends]
        sizes = [np.median([run.size for run in runs]) for runs in ends]
        spreads = [np.subtract(*np.quantile(each, (0.75, 0.25))) for each in errors]
        rows.append(_trend(f"{name}: unstable models", "fewer", shares, "%"))
        rows.append(_trend(f"{name}: median of the terms", "smaller", sizes))
        rows.append(_trend(f"{name}: interquartile range of PE", "smaller", spreads))
        if system == "s2":
            medians = [np.median(each) for each in errors]
            rows.append(_trend(f"{name}: median of PE", "smaller", medians))
    return ComparisonTable("Directions in the text of Appendix A", tuple(rows))


def _trend(name: str, published: str, ends: Sequence[np.floating | float], unit: str = "") -> tuple[str, ...]:
    before, after = ends
    agrees = "the same direction" if after < before else "the opposite direction or no change"
    return name, published, f"{before:.3g} to {after:.3g} {unit}".rstrip(), agrees


def _tabulate_tukey(variance: float, test: Tukey) -> ComparisonTable:
    rows = [
        (
            f"{one:.2f}, {other:.2f}",
            f"{published:.4f}",
            _write_decision(rejected),
            f"{test[one, other].difference:.4g}",
            f"{test[one, other].p:.4f}",
            _write_decision(test[one, other].rejected),
            "the same decision" if rejected == test[one, other].rejected else "another decision",
        )
        for (one, other), (published, rejected) in TABLE_A3.items()
    ]
    return ComparisonTable(
        f"Table A.3, Tukey's test on the PE of S2, at the variance {variance:g} of the soft input",
        tuple(rows),
        ("PRPB", "published difference", "published", "difference here", "p here", "here", WHY),
    )


def _write_decision(rejected: bool) -> str:
    return "different" if rejected else "not different"


def _tabulate_scan(scan: Sequence[ScanPoint]) -> ComparisonTable:
    best = max(point.likelihood for point in scan)
    rows = []
    for point in scan:
        sizes = [run.size for run in point.runs["s1", 1.0]]
        rows.append(
            (
                f"{point.variance:g}",
                *(f"{_count_unstable(point.runs[cell])} of {len(point.runs[cell])}" for cell in SCANNED),
                f"{min(sizes)} to {max(sizes)}, median {np.median(sizes):g}",
                f"{np.median([run.prediction for run in point.runs['s2', 0.0]]):.3g}",
                f"{point.likelihood:.1f}",
                "the most likely" if point.likelihood == best else "",
            )
        )
    return ComparisonTable(
        "Scan of the variance of the soft input (published: 20, 1 and 49 of 50; 5 to 8 terms, median 6)",
        tuple(rows),
        (
            "variance",
            *(f"unstable, {system.upper()}, PRPB {prune:g}" for system, prune in SCANNED),
            "terms, S1, PRPB 1",
            "median PE (%), S2, PRPB 0",
            "log-likelihood",
            WHY,
        ),
    )


def _draw_figure_a7(shown: Mapping[str, Mapping[float, Sequence[AppendixRun]]], theme: str) -> Figure:
    stated = {
        (each.system, each.prune): each.least / PUBLISHED_RUNS
        for each in PUBLISHED
        if each.event == "unstable"
    }
    panels = [
        (
            system.upper(),
            [
                MonteCarloGroup(
                    f"{prune:g}",
                    [run.prediction for run in runs],
                    [run.simulation for run in runs],
                    [run.size for run in runs],
                    float(np.mean([run.unstable for run in runs])),
                    interval(_count_unstable(runs), len(runs)),
                    stated.get((system, prune)),
                )
                for prune, runs in groups.items()
            ],
        )
        for system, groups in shown.items()
    ]
    return draw_groups(panels, "PRPB", theme)


def _draw_scan_figure(scan: Sequence[ScanPoint], theme: str) -> Figure:
    stated = {(each.system, each.prune): each.least for each in PUBLISHED if each.event == "unstable"}
    lines = []
    for system, prune in SCANNED:
        counts = [
            (_count_unstable(point.runs[system, prune]), len(point.runs[system, prune])) for point in scan
        ]
        lines.append(
            ScanLine(
                f"{system.upper()}, PRPB {prune:g}",
                [count / runs for count, runs in counts],
                [interval(count, runs) for count, runs in counts],
                stated[system, prune] / PUBLISHED_RUNS,
            )
        )
    sizes = [[run.size for run in point.runs["s1", 1.0]] for point in scan]
    return draw_scan(
        [point.variance for point in scan],
        lines,
        ("S1, PRPB 1", sizes, (5.0, 8.0)),
        [point.likelihood for point in scan],
        "variance of the soft input",
        theme,
    )


def _describe(
    cells: Mapping[Cell, Sequence[AppendixRun]],
    scan: Sequence[ScanPoint],
    tests: Mapping[float, Tukey],
) -> Document:
    """Return the numbers of the section as JSON values; an error that is not finite is null."""
    return {
        "cells": [
            {
                "system": system,
                "variance": variance,
                "prune": prune,
                "sizes": [run.size for run in runs],
                "unstable": _count_unstable(runs),
                "interval": interval(_count_unstable(runs), len(runs)),
                "prediction": [_finite(run.prediction) for run in runs],
                "simulation": [_finite(run.simulation) for run in runs],
            }
            for (system, variance, prune), runs in cells.items()
        ],
        "scan": [{"variance": point.variance, "log_likelihood": point.likelihood} for point in scan],
        "tukey": [
            {
                "variance": variance,
                "groups": list(pair),
                "difference": row.difference,
                "p": row.p,
                "rejected": row.rejected,
            }
            for variance, rows in tests.items()
            for pair, row in rows.items()
        ],
    }


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None
