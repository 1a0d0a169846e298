"""Gross errors of an output: how many are found, and how many physical events are taken for one.

    python -m lab.inspection.excursions [--count N] [--first SEED]

The records of `tests/support/measured_events.py`: gross errors of three kinds in ten kinds of signals, and
ten kinds of physical events.
"""

import argparse

import numpy as np

from islands.records.inspection.gross_errors import find_gross_errors
from support.measured_events import ERRORS, EVENTS, SIGNALS


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20, help="records of each kind")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    asked = parser.parse_args()
    seeds = range(asked.first, asked.first + asked.count)
    whole = np.zeros(3, dtype=int)
    for name, make in SIGNALS.items():
        for kind, add in ERRORS.items():
            counts = np.zeros(3, dtype=int)
            for seed in seeds:
                rng = np.random.default_rng([seed, *map(ord, name + kind)])
                u, y = make(rng)
                wrong, places = add(y, rng)
                found = set(find_gross_errors(wrong, u[:, None]).samples.tolist())
                counts += len(found & set(places)), len(places), len(found - set(places))
            whole += counts
            print(f"{name:30}{kind:18}{counts[0]:5} of {counts[1]:4} found, {counts[2]} others")
    print(f"all: {whole[0]} of {whole[1]} gross errors found, {whole[2]} other samples")
    for name, make in (*SIGNALS.items(), *EVENTS.items()):
        records = samples = 0
        for seed in seeds:
            u, y = make(np.random.default_rng([seed, *map(ord, name)]))
            found = find_gross_errors(y, u[:, None]).samples.size
            records, samples = records + (found > 0), samples + found
        print(f"{name:30}{records:5} of {len(seeds)} records with deleted samples ({samples})", flush=True)


if __name__ == "__main__":
    main()
