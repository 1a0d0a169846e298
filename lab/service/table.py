"""Measured figures of the service and their targets, as a table and as JSON."""

import argparse
import json
import os
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Figure:
    """Figure that was measured several times.

    Attributes
    ----------
    goal : float or None
        Target of the median.
    most : bool
        Whether the target is an upper limit; otherwise it is a lower limit.
    """

    name: str
    unit: str
    goal: float | None
    values: tuple[float, ...]
    most: bool = True

    @property
    def median(self) -> float:
        return statistics.median(self.values)

    @property
    def kept(self) -> bool:
        if self.goal is None:
            return True
        return self.median <= self.goal if self.most else self.median >= self.goal

    def row(self) -> str:
        sign = "<=" if self.most else ">="
        goal = "" if self.goal is None else f"{sign} {self.goal:g}"
        spread = f"{min(self.values):.4g} to {max(self.values):.4g}"
        mark = "" if self.goal is None else "kept" if self.kept else "MISSED"
        return (
            f"{self.name:52s} {self.median:9.4g} {self.unit:4s} {goal:>9s} {mark:7s} "
            f"{spread} ({len(self.values)}x)"
        )


def percentile(values: Sequence[float], share: float) -> float:
    """Return the smallest value that is not exceeded by the given fraction of the values."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def run(measures: Mapping[str, Callable[[int], Sequence[Figure]]], description: str | None) -> int:
    """Run the measurements given on the command line, all by default, and show their figures."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("measures", nargs="*", help=f"Some of: {', '.join(measures)}.")
    parser.add_argument(
        "--repeat", type=int, default=5, help="Number of repetitions; median and range are shown."
    )
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    if unknown := set(given.measures) - set(measures):
        parser.error(f"there is no measurement {', '.join(sorted(unknown))}: take {', '.join(measures)}")
    figures: list[Figure] = []
    for name in given.measures or measures:
        for figure in measures[name](given.repeat):
            figures.append(figure)
            print(figure.row(), flush=True)
    load = os.getloadavg()
    print(f"load of the machine at the end: {load[0]:.1f}, {load[1]:.1f}, {load[2]:.1f}")
    if given.json:
        found = [{**asdict(each), "median": each.median, "kept": each.kept} for each in figures]
        given.json.write_text(json.dumps({"load": load, "figures": found}, indent=2))
    return 0
