"""Contradictions in the texts about 270 results, of all kinds: summary, notebook, report, REST and page.

    python -m lab.searches.contradictions [--jobs 2] [--only law] [--every 5]

The results are fits of the records of the portfolio, of 24 laws with three levels of noise, of records with
gross errors, of short, drifting and extrapolating ones, of several outputs and of the measured records;
diagnoses of the portfolio, and of simulations with a known difference to their records. Each text is checked
against the tables of exclusive pairs of ``tests/support/statements.py``, and the text of the saved folder is
compared with that of the run. The goal is 0. Results are printed; the exit code is 1 if there is a
contradiction.
"""

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from time import perf_counter
from warnings import simplefilter

import pytest

import islands
from support.stated_results import list_texts, make_cases
from support.statements import find_contradictions


def check(name: str) -> tuple[str, float, dict[str, list[str]]]:
    """Return the name of a case, the time that it takes, and the contradictions by text.

    A case whose record is refused, or absent, is an entry ``refused``, which is no contradiction.
    """
    simplefilter("ignore", islands.ExtrapolationWarning)
    began = perf_counter()
    try:
        result = make_cases()[name]()
    except (islands.IslandsError, pytest.skip.Exception) as error:
        return name, perf_counter() - began, {"refused": [str(error)]}
    try:
        outputs = getattr(result, "output_names", ())
        found = {
            where: find_contradictions(text, outputs if outputs[1:] else ())
            for where, text in list_texts(name, result).items()
        }
    except AssertionError as error:
        found = {"folder": [str(error)]}
    return name, perf_counter() - began, {where: pairs for where, pairs in found.items() if pairs}


def main() -> int:
    """Check the cases and print the contradictions and their number."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", default="", help="cases whose name contains this text")
    parser.add_argument("--every", type=int, default=1, help="one of this number of cases")
    options = parser.parse_args()
    names = [name for name in make_cases() if options.only in name][:: options.every]
    checked = refused = contradictions = 0
    with ProcessPoolExecutor(options.jobs) as pool:
        for name, seconds, found in pool.map(check, names):
            listed = "; ".join(f"{where}: {pair}" for where, pairs in found.items() for pair in pairs)
            print(f"{name:50} {seconds:6.1f} s  {listed or 'consistent'}", flush=True)
            refused += "refused" in found
            checked += "refused" not in found
            contradictions += sum(len(pairs) for where, pairs in found.items() if where != "refused")
    print(f"{checked} results, {contradictions} contradictions; {refused} records refused or absent")
    return int(contradictions > 0)


if __name__ == "__main__":
    sys.exit(main())
