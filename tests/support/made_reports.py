"""Benchmark reports with invented numbers that meet every target."""

from dataclasses import replace

from islands_measurements.speed.comparison import Comparison
from islands_measurements.speed.full_runs import Run
from islands_measurements.speed.machine import Machine
from islands_measurements.speed.report import BenchmarkReport
from islands_measurements.speed.scaling import Scaling, against_islands

KINDS = ("poly", "general", "gp")
POINTS = ((1.0, 2.0), (2.0, 3.0), (4.0, 5.0))


def comparison(**changes):
    fast = Comparison(
        numpy_ms=24.0,
        uncached_ms=0.3,
        cached_ms=0.1,
        numpy_simulation_ms=8.0,
        simulation_ms=0.08,
        c_simulation_ms=0.04,
        simulation_fraction_of_c=0.5,
        gram_ms=0.2,
        gram_flops=5e10,
    )
    return replace(fast, **changes)


def report(**changes):
    run = Run(125_000, 25_000, 10.0, 11.0, 8.0, {"inner_products_bytes": 1000})
    scalings = tuple(
        Scaling(name, name, "CPU time of an evaluation (ms)", {"nothing cached": POINTS})
        for name in ("samples", "terms", "tree_size")
    )
    islands = against_islands({1: (run,), 2: (run, run)})
    made = BenchmarkReport(
        quick=False,
        workload="ab" * 32,
        samples=100_000,
        individuals=30,
        kinds={kind: comparison() for kind in KINDS},
        peak_flops=1e11,
        runs={"n100000": run, "n10000": replace(run, cpu_s=5.0)},
        case1_wall_s=9.5,
        parallel_efficiency_2=0.97,
        scalings=(*scalings, islands),
        machine=Machine("a processor", 2, "Linux", "3.11", None, {"numpy": "2"}, 1.0),
    )
    return replace(made, **changes)
