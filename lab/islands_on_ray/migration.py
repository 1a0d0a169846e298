"""Effect of migration on the error at an equal number of evaluations, over topologies and seeds.

    python -m lab.islands_on_ray.migration [--preset paper-case1] [--seeds 10] [--json FILE]

Results are printed, not asserted; the figures are in lab/notes/islands-on-ray.md. The error is the
RMSE of multiple shooting on the estimation data, which evolution minimises, for the best model of any size
and of at most six terms.
"""

import argparse
import json
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path

import numpy as np

from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import SerialEngine
from islands.evolution.presets import PRESETS
from islands.evolution.problem import make_problem
from islands.systems.catalogue import make_record

#: Total number of individuals, and generations, by preset. Case 1 has the number of evaluations of the paper.
BUDGETS = {"paper-case1": (500, 500), "hysteresis": (300, 80)}

WAYS = {
    "one island": {"islands": 1},
    "isolated": {"topology": "isolated"},
    "ring": {"topology": "ring"},
    "bidirectional ring": {"topology": "bidirectional-ring"},
    "fully connected": {"topology": "fully-connected"},
    "ring, every 5": {"topology": "ring", "migrate_every": 5},
    "ring, every 20": {"topology": "ring", "migrate_every": 20},
    "ring, 3 migrants": {"topology": "ring", "migrants": 3},
    "ring, front": {"topology": "ring", "emigrants": "front"},
    "ring, random": {"topology": "ring", "emigrants": "random"},
    "ring, every 50": {"topology": "ring", "migrate_every": 50},
    "fully connected, every 50": {"topology": "fully-connected", "migrate_every": 50},
}


def error(preset: str, islands: int, samples: int, way: str, seed: int) -> tuple[float, float]:
    everybody, generations = BUDGETS[preset]
    changes = {"islands": islands, **WAYS[way]}
    settings = replace(PRESETS[preset], generations=generations, **changes)
    settings = replace(settings, population=everybody // settings.islands)
    posed = make_problem(make_record("bouc-wen-piezo", "authors", "estimation")[:samples], settings)
    *_, last = SerialEngine().run(posed, empty_archipelago(settings.islands, seed), lambda: False)
    best = last.archipelago.hall_of_fame.best()
    found = [min(entry.fitness for size, entry in best.items() if size <= most) ** 0.5 for most in (6, 99)]
    return found[1], found[0]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--preset", choices=BUDGETS, default="paper-case1")
    parser.add_argument("--islands", type=int, default=8)
    parser.add_argument("--samples", type=int, default=20_000)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS))
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    found: dict[str, dict[int, tuple[float, float]]] = {way: {} for way in given.ways}
    with ProcessPoolExecutor(2) as processes:
        jobs = {
            processes.submit(error, given.preset, given.islands, given.samples, way, seed): (way, seed)
            for seed in range(given.seeds)
            for way in given.ways
        }
        for count, job in enumerate(as_completed(jobs), start=1):
            way, seed = jobs[job]
            found[way][seed] = job.result()
            print(f"{count}/{len(jobs)} {way}, seed {seed}: RMSE {found[way][seed][0]:.5g}", flush=True)
    for way, runs in found.items():
        for place, what in enumerate(("any size", "<= 6 terms")):
            values = np.array([runs[seed][place] for seed in sorted(runs)])
            low, middle, high = np.quantile(values, [0.25, 0.5, 0.75])
            print(
                f"{way:25s} {what:10s} median {middle:.5g}, quartiles {low:.5g} to {high:.5g}, "
                f"worst {values.max():.5g}, mean of log10 {np.log10(values).mean():.3f}"
            )
    if given.json:
        given.json.write_text(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
