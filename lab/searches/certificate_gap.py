"""Print the gap of the certificate by number of terms and of nodes, for polynomial libraries.

The gap is the fraction by which another model could reduce the one-step-ahead error of the best model that
the search meets; 0 is a proof.

    python -m lab.searches.certificate_gap
"""

from time import perf_counter

import numpy as np

from islands.estimation.forward_selection import SelectionProblem, make_selection_problem
from islands.estimation.structure_selection.certificate import SubsetSearch
from islands.models.candidate_library import candidates
from islands.records.dataset import Dataset

#: Degree and lags of the libraries.
LIBRARIES = ((2, 4), (3, 3), (3, 4), (2, 11))

#: Nodes of a search.
NODES = (10_000, 100_000)

#: Numbers of terms.
SIZES = (3, 4, 5, 6, 8)


def make_record(excitation: str, samples: int = 1500) -> Dataset:
    """Simulate a law with a saturation, which no polynomial library contains, with 2 % noise."""
    generator = np.random.default_rng(0)
    time = np.arange(samples)
    inputs = {
        "white": generator.uniform(-1.0, 1.0, samples),
        "steps": np.repeat(generator.uniform(-1.0, 1.0, samples // 8 + 1), 8)[:samples]
        + 0.1 * generator.normal(size=samples),
        "sines": np.sin(0.05 * time) + 0.5 * np.sin(0.13 * time) + 0.3 * np.sin(0.31 * time),
    }
    u, y = inputs[excitation], np.zeros(samples)
    for k in range(3, samples):
        y[k] = 0.5 * y[k - 1] - 0.1 * y[k - 2] + 0.5 * u[k - 1] + 0.2 * u[k - 2] ** 2
        y[k] += 0.1 * u[k - 3] * u[k - 1] - 0.2 * y[k - 1] * u[k - 2] + 0.1 * np.tanh(3.0 * u[k - 2])
    return Dataset(u, y + 0.02 * y.std() * generator.normal(size=samples), 0.1)


def find_error(problem: SelectionProblem, structure: tuple) -> float:
    """Return the root mean square of the one-step-ahead residual of an unconstrained structure."""
    places = [at for at, item in enumerate(problem.free) if item.regressors[0] in structure]
    gram, products = problem.gram[np.ix_(places, places)], problem.gram[places, -1]
    explained = products @ np.linalg.solve(gram, products)
    return float(np.sqrt((problem.gram[-1, -1] - explained) / problem.rows))


def main() -> None:
    """Print one line for each excitation, library and number of nodes."""
    print("excitation candidates   nodes  seconds  " + "  ".join(f"{size} terms" for size in SIZES))
    for excitation in ("white", "steps", "sines"):
        record = make_record(excitation)
        for degree, lags in LIBRARIES:
            problem = make_selection_problem(candidates("polynomial", degree, lags, 1), record)
            assert isinstance(problem, SelectionProblem)
            for nodes in NODES:
                began = perf_counter()
                certificates = SubsetSearch(problem, max(SIZES)).certify(nodes)
                seconds = perf_counter() - began
                gaps = [
                    100.0 * certificates[size - 1].gap(find_error(problem, certificates[size - 1].structure))
                    for size in SIZES
                ]
                print(
                    f"{excitation:10} {len(problem.free):10} {nodes:7} {seconds:8.1f}  "
                    + "  ".join(f"{gap:5.1f} %" for gap in gaps),
                    flush=True,
                )


if __name__ == "__main__":
    main()
