"""Cost and benefit of Ray on two cores: efficiency, overhead, memory, recovery, cancellation.

    python -m lab.islands_on_ray.parallel [--json FILE]

Results are printed, not asserted; the machine must be idle otherwise. Two islands of the paper's case 1
without migration, so that their work does not depend on the engine: one alone, two in processes without Ray,
two on Ray.
"""

import argparse
import json
import multiprocessing
import os
import statistics
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from islands.evolution.archipelago import Island, empty_archipelago
from islands.evolution.engine import run_epoch
from islands.evolution.presets import PRESETS
from islands.evolution.problem import Problem
from islands.systems.catalogue import make_record
from islands_service.engines import ENGINES
from support.processes import actors, descendants, kill

#: Generations of an epoch, and number of epochs that are timed after the first two.
EPOCHS = {"0.1 s": (2, 40), "1 s": (22, 6), "10 s": (220, 2)}


def posed(every: int, epochs: int) -> Problem:
    settings = replace(
        PRESETS["paper-case1"],
        islands=2,
        topology="isolated",
        migrate_every=every,
        generations=every * (epochs + 1),
    )
    return Problem(make_record("bouc-wen-piezo", "authors", "estimation"), settings)


def never() -> bool:
    return False


def seconds(epochs) -> tuple[float, list[float]]:
    """Return the seconds from the end of the first epoch to the end, and between two epochs."""
    times = [time.perf_counter() for _ in epochs][1:]
    return times[-1] - times[0], [after - before for before, after in pairwise(times)]


def alone(problem: Problem, index: int) -> float:
    return seconds(_epochs(problem, empty_archipelago(2, 0).islands[index]))[0]


def _epochs(problem: Problem, island: Island):
    evolution = problem.open()
    while island.generation < problem.settings.generations:
        island = run_epoch(island, [], evolution, never).island
        yield island


def apart(problem: Problem) -> float:
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        pool.starmap(alone, [(posed(1, 1), island) for island in (0, 1)])
        return max(pool.starmap(alone, [(problem, island) for island in (0, 1)], chunksize=1))


def memory(pid: int) -> float:
    """Return the proportional set size of a process and its descendants in MB."""
    total = 0
    for each in (pid, *descendants(pid)):
        try:
            lines = Path(f"/proc/{each}/smaps_rollup").read_text().splitlines()
        except OSError:
            continue
        total += sum(int(line.split()[1]) for line in lines if line.startswith("Pss:"))
    return total / 1000


def killed(engine, problem: Problem) -> tuple[float, float]:
    """Return the seconds of a run without and with an island killed during an epoch."""
    took = []
    for disturbed in (False, True):
        began, lost = None, []
        for count, _ in enumerate(engine.run(problem, empty_archipelago(2, 0), never)):
            if count == 1:
                began = time.perf_counter()
            # By then a spare actor exists; the islands run on the first two actors.
            if disturbed and not lost and began and time.perf_counter() - began > 34.0:
                lost.append(sorted(actors())[0])
                kill(lost[0])
        took.append(time.perf_counter() - began)
    return took[0], took[1]


def cancelled(engine, problem: Problem, after: float) -> float:
    """Return the seconds from a stop request, ``after`` seconds into an epoch of ten, to the end."""
    requested = []

    def stop() -> bool:
        return bool(requested) and requested[0] < time.perf_counter()

    for count, _ in enumerate(engine.run(problem, empty_archipelago(2, 0), stop)):
        if count == 0:
            requested.append(time.perf_counter() + after)
    return time.perf_counter() - requested[0]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    found: dict[str, object] = {}
    began = time.perf_counter()
    with ENGINES["ray"](None, print) as engine:
        found["Ray up, s"] = time.perf_counter() - began
        for name, (every, epochs) in EPOCHS.items():
            problem = posed(every, epochs)
            evaluations = 500 * every * epochs
            single = statistics.fmean(evaluations / alone(problem, island) for island in (0, 1))
            pair = 2 * evaluations / apart(problem)
            spent, each = seconds(engine.run(problem, empty_archipelago(2, 0), never))
            on_ray = 2 * evaluations / spent
            found[name] = {
                "one alone, individuals/s": single,
                "two processes": pair,
                "two on Ray": on_ray,
                "efficiency against one alone": on_ray / (2 * single),
                "Ray's share": 1 - on_ray / pair,
                "epoch, s": statistics.median(each),
            }
            print(name, json.dumps(found[name]), flush=True)
        runs = engine.run(posed(22, 6), empty_archipelago(2, 0), never)
        for count, _ in enumerate(runs):
            if count == 3:
                found["memory of all processes, MB"] = memory(os.getpid())
                found["processes"] = len(descendants(os.getpid())) + 1
        undisturbed, disturbed = killed(engine, posed(22, 45))
        found["killed: seconds more"] = disturbed - undisturbed
        found["cancel, s"] = [cancelled(engine, posed(220, 2), 2.0 + 0.017 * attempt) for attempt in range(5)]
    print(json.dumps(found, indent=2))
    if given.json:
        given.json.write_text(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
