"""Number of islands that one coordinator can schedule, measured with epochs of almost no work.

    python -m lab.islands_on_ray.coordinator [--json FILE]

Results are printed, not asserted. The model seconds = a + b n is fitted to the time of an epoch of n islands.
Without computation, b is the cost of an island for the coordinator, the actors and the communication. The CPU
time of the coordinator's process is its share of this cost: the limit if every island has a separate core.
"""

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from islands.evolution.archipelago import empty_archipelago
from islands.evolution.presets import PRESETS
from islands.evolution.problem import Problem
from islands.evolution.settings import Settings
from islands.records.dataset import Dataset
from islands_service.engines import ENGINES

ISLANDS = (2, 10, 30, 100, 300, 1000)

#: Number of timed epochs, after the first one.
TIMED = 10


def never() -> bool:
    return False


def tiny(islands: int, topology: str, population: int) -> Problem:
    rng = np.random.default_rng(0)
    record = Dataset(rng.normal(size=200), rng.normal(size=200), 0.1)
    settings = Settings(
        population=population,
        generations=TIMED + 1,
        max_terms=2,
        initial_terms=(1, 2),
        max_height=1,
        initial_height=1,
        shifts=(1,),
        shooting=20,
        islands=islands,
        topology=topology,
        migrate_every=1,
    )
    return Problem(record, settings)


def epoch(engine, problem: Problem) -> tuple[float, float]:
    """Return the seconds of an epoch and the CPU seconds of the coordinator in it."""
    wall, cpu = [], []
    for _ in engine.run(problem, empty_archipelago(problem.settings.islands, 0), never):
        wall.append(time.perf_counter())
        cpu.append(time.process_time())
    return (wall[-1] - wall[1]) / TIMED, (cpu[-1] - cpu[1]) / TIMED


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    found = {}
    with ENGINES["ray"](None, print) as engine:
        for topology in ("ring", "torus"):
            points = []
            for islands in ISLANDS:
                wall, cpu = epoch(engine, tiny(islands, topology, 8))
                points.append((islands, wall, cpu))
                print(
                    f"{topology:6s} {islands:5d} islands: {1e3 * wall:.1f} ms an epoch, "
                    f"{islands / wall:.0f} epochs of islands/s, {1e6 * cpu / islands:.0f} us of its CPU each",
                    flush=True,
                )
            n, wall, cpu = np.array(points).T
            # Relative errors, so that a thousand islands do not outweigh ten.
            design = np.column_stack([np.ones_like(n), n])
            (a, b), (c, d) = (
                np.linalg.lstsq(design / y[:, None], np.ones_like(y), rcond=None)[0] for y in (wall, cpu)
            )
            found[topology] = {
                "points": points,
                "epoch, s": [a, b],
                "coordinator's CPU, s": [c, d],
                "epoch at which 10 000 islands saturate it, s": c + 1e4 * d,
                "islands at epochs of 1 s": (1 - c) / d,
            }
            print(
                f"{topology}: an epoch takes {1e3 * a:.1f} ms + {1e6 * b:.0f} us n; its coordinator "
                f"{1e3 * c:.1f} ms + {1e6 * d:.0f} us n; 10 000 islands saturate it at epochs of "
                f"{c + 1e4 * d:.1f} s"
            )
        real = replace(
            PRESETS["paper-case1"], islands=2, migrate_every=1, generations=TIMED + 1, topology="ring"
        )
        rng = np.random.default_rng(0)
        record = Dataset(np.cumsum(rng.normal(size=2000)), np.cumsum(rng.normal(size=2000)), 0.1)
        wall, cpu = epoch(engine, Problem(record, real))
        found["500 individuals each"] = {"coordinator's CPU an island, s": cpu / 2, "epoch, s": wall}
        print(f"500 individuals each: coordinator's CPU {1e3 * cpu / 2:.1f} ms an island and epoch")
    if given.json:
        given.json.write_text(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
