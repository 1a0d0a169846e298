"""Result of a benchmark, its JSON document, and the goals of the design."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from lab.speed.comparison import Comparison
from lab.speed.full_runs import Run
from lab.speed.machine import Machine
from lab.speed.scaling import Scaling, line_through

#: Individuals per second and core of the authors' toolbox, mean over an evolved run on the same record: 19 to
#: 32 were measured together with the first design of these kernels. It is not measured here.
AUTHORS_PER_SECOND = 32.0

#: A cost counts as linear if a line explains this fraction of its variance.
LINEAR = 0.98


@dataclass(frozen=True, slots=True)
class BenchmarkReport:
    """All results of a benchmark.

    Attributes
    ----------
    quick : bool
        Whether there were fewer individuals and generations and no full run of the paper's case 1.
    workload : str
        SHA-256 of the individuals' text; two reports are comparable if it is equal.
    samples, individuals : int
        Samples of the record, and individuals of every kind.
    kinds : mapping of str to Comparison
        For ``poly``, ``general`` and ``gp``.
    peak_flops : float or None
        Multiplications and additions per second of one core, unfused; None if there is no compiler.
    runs : mapping of str to Run
        One island of 250, on ``n100000`` and ``n10000`` samples.
    case1_wall_s : float or None
        Time of two islands of 250 over 500 generations in two processes, including their start; None if
        not measured.
    parallel_efficiency_2 : float
        Individuals per second of two simultaneous processes, divided by twice that of one process.
    scalings : tuple of Scaling
    machine : Machine
    """

    quick: bool
    workload: str
    samples: int
    individuals: int
    kinds: Mapping[str, Comparison]
    peak_flops: float | None
    runs: Mapping[str, Run]
    case1_wall_s: float | None
    parallel_efficiency_2: float
    scalings: tuple[Scaling, ...]
    machine: Machine

    def amortised_ms(self, kind: str) -> float:
        """Return the CPU time in milliseconds of an evaluation with the cache of a search.

        For ``gp`` it is the mean per new structure of a real search. The other two kinds come from no search;
        for them all inner products are cached.
        """
        return self.runs["n100000"].amortised_ms if kind == "gp" else self.kinds[kind].cached_ms

    def uncached_ratio(self, kind: str) -> float:
        """Return the time of plain numpy divided by that of the kernels with an empty cache."""
        return self.kinds[kind].numpy_ms / self.kinds[kind].uncached_ms

    def amortised_ratio(self, kind: str) -> float:
        """Return the time of plain numpy divided by that of the kernels, amortised over a search."""
        return self.kinds[kind].numpy_ms / self.amortised_ms(kind)

    def gram_fraction_of_peak(self, kind: str) -> float | None:
        """Return the fraction of the peak that the Gram matrix reaches, including the columns."""
        return None if self.peak_flops is None else self.kinds[kind].gram_flops / self.peak_flops


@dataclass(frozen=True, slots=True)
class Goal:
    """Goal with its measured value.

    Attributes
    ----------
    text, wanted, measured : str
    met : bool or None
        None if it was not measured.
    """

    text: str
    wanted: str
    measured: str
    met: bool | None


def to_document(report: BenchmarkReport) -> dict[str, Any]:
    """Return a report as a JSON document.

    A ratio or fraction that is a single number belongs to ``gp``, the individuals of a real search; ``kinds``
    contains those of all three kinds. Values that need a compiler are null if there is none.
    """
    kinds = report.kinds
    return {
        "quick": report.quick,
        "workload_sha256": report.workload,
        "samples": report.samples,
        "individuals": report.individuals,
        "evaluation_ratio_numpy_uncached": report.uncached_ratio("gp"),
        "evaluation_ratio_numpy_amortised": report.amortised_ratio("gp"),
        "simulation_fraction_of_c": kinds["gp"].simulation_fraction_of_c,
        "gram_fraction_of_peak": report.gram_fraction_of_peak("gp"),
        "evaluations_per_second_per_core": {name: run.per_cpu_second for name, run in report.runs.items()},
        "case1_wall_s": report.case1_wall_s,
        "parallel_efficiency_2": report.parallel_efficiency_2,
        "numpy_ms": {kind: each.numpy_ms for kind, each in kinds.items()},
        "uncached_ms": {kind: each.uncached_ms for kind, each in kinds.items()},
        "amortised_ms": {kind: report.amortised_ms(kind) for kind in kinds},
        "kinds": {
            kind: {
                "evaluation_ratio_numpy_uncached": report.uncached_ratio(kind),
                "evaluation_ratio_numpy_amortised": report.amortised_ratio(kind),
                "gram_fraction_of_peak": report.gram_fraction_of_peak(kind),
                **asdict(each),
            }
            for kind, each in kinds.items()
        },
        "peak_flops": report.peak_flops,
        "runs": {name: asdict(run) for name, run in report.runs.items()},
        "caches": {
            name: {"duplicate_share": run.duplicates / run.evaluations, **run.caches}
            for name, run in report.runs.items()
        },
        "scaling": {
            scaling.name: {
                "x": scaling.x_label,
                "y": scaling.y_label,
                "curves": {
                    name: {"points": points, "line": asdict(line_through(points))}
                    for name, points in scaling.curves.items()
                },
            }
            for scaling in report.scalings
        },
        "machine": asdict(report.machine),
    }


def check_goals(report: BenchmarkReport) -> tuple[Goal, ...]:
    """Return every goal of the design with its measured value."""
    kinds = report.kinds
    rows = [
        _at_least(
            f"one evaluation, nothing cached, over numpy: {kind}", least, report.uncached_ratio(kind), "x"
        )
        for kind, least in (("poly", 60.0), ("gp", 60.0), ("general", 45.0))
    ]
    rows.append(
        _at_least("amortised over a search, over numpy: gp", 120.0, report.amortised_ratio("gp"), "x")
    )
    rows += [
        _at_least(
            f"simulation, share of compiled C's speed: {kind}", least, kinds[kind].simulation_fraction_of_c
        )
        for kind, least in (("poly", 0.4), ("general", 0.3))
    ]
    case1 = report.case1_wall_s
    rows.append(
        Goal(
            "the paper's case 1, 250 000 offspring, 2 free cores",
            "<= 20 s",
            "not measured" if case1 is None else f"{case1:.1f} s",
            None if case1 is None else case1 <= 20.0,
        )
    )
    rows.append(
        _at_least(
            f"individuals/s and core, {AUTHORS_PER_SECOND:g}/s of the authors' toolbox elsewhere x 200",
            200.0 * AUTHORS_PER_SECOND,
            report.runs["n100000"].per_cpu_second,
            "/s",
        )
    )
    rows.append(_at_least("second island on a second core", 1.9, 2.0 * report.parallel_efficiency_2, "x"))
    for scaling in report.scalings:
        if scaling.name in {"samples", "terms"}:
            rows += [
                _at_least(
                    f"cost against {scaling.name} is a line, R²: {name}", LINEAR, line_through(points).r2
                )
                for name, points in scaling.curves.items()
            ]
    return tuple(rows)


def _at_least(text: str, least: float, measured: float | None, unit: str = "") -> Goal:
    if measured is None:
        return Goal(text, f">= {least:g}{unit}", "no C compiler", None)
    return Goal(text, f">= {least:g}{unit}", f"{measured:.4g}{unit}", measured >= least)
