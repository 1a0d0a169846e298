"""Errors and standard errors of linear identification on random plants.

    python -m lab.linear.trials [--first 0] [--plants 40] [--max-order 12]

A line for each plant: the order, the error of the free run on a fresh record without noise, relative to that
of an output-error fit that begins at the truth, and the largest standard score of its quantities. Results are
printed, not asserted.
"""

import argparse
import time

import numpy as np

from islands.estimation.linear.identify import identify_linear
from islands.estimation.linear.model import LinearModel
from islands.models.state_space import list_modes, measure_mode
from lab.linear.oracle import fit_from_truth
from lab.linear.plants import Trial, make_trial


def measure_error(model: LinearModel, trial: Trial) -> float:
    """Return the error of the free run on the fresh record in percent of its spread."""
    simulated = model.simulate(trial.fresh_u)[:, 0]
    # The offset of the sensor is no part of the law, and is known from the samples at rest.
    error = simulated - simulated[:40].mean() - trial.fresh_y
    return float(100.0 * np.sqrt(np.mean(error**2)) / trial.fresh_y.std())


def score(model: LinearModel, trial: Trial) -> list[float]:
    """Return the deviations from the truth in standard errors, of a model with as many modes of each kind."""
    kinds = ("time constant", "frequency", "damping ratio", "static gain")
    true: dict[str, list[float]] = {kind: [] for kind in kinds} | {"static gain": trial.plant.gains.tolist()}
    for pole in list_modes(trial.plant.poles):
        for quantity in measure_mode(pole, 1.0):
            true[quantity.name].append(quantity.value)
    found: dict[str, list[tuple[float, float]]] = {kind: [] for kind in kinds}
    for quantity, error in zip(model.quantities[0], model.errors[0], strict=True):
        if quantity.name in found:
            found[quantity.name].append((quantity.value, error))
    if any(len(found[kind]) != len(true[kind]) for kind in kinds):
        return []
    # A damping ratio has the place of its frequency.
    order = {kind: np.argsort([value for value, _ in found[kind]]) for kind in kinds}
    places = {kind: np.argsort(true[kind]) for kind in kinds}
    for each in (order, places):
        each["damping ratio"] = each["frequency"]
        each["static gain"] = np.arange(len(true["static gain"]))
    return [
        (found[kind][one][0] - true[kind][other]) / found[kind][one][1]
        for kind in kinds
        for one, other in zip(order[kind], places[kind], strict=True)
    ]


def main() -> None:
    """Measure a range of plants and print the shares."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--plants", type=int, default=40)
    parser.add_argument("--max-order", type=int, default=12)
    options = parser.parse_args()
    ratios: list[float] = []
    scores: list[float] = []
    orders: list[bool] = []
    seconds: list[float] = []
    for seed in range(options.first, options.first + options.plants):
        trial = make_trial(seed)
        begin = time.process_time()
        model = identify_linear(trial.u, trial.y, max_order=options.max_order)
        seconds.append(time.process_time() - begin)
        oracle = fit_from_truth(trial)
        pair = measure_error(model, trial), measure_error(oracle, trial)
        own = score(model, trial)
        ratios.append(pair[0] / pair[1])
        scores += own
        orders.append(model.order == len(trial.plant.poles))
        print(
            f"{seed:4d} {trial.excitation:11s} {trial.noise:8s} n {len(trial.y)} "
            f"order {model.order} of {len(trial.plant.poles)}, delays {model.delays[0].tolist()} of "
            f"{trial.plant.delays.tolist()}, error {pair[0]:.3f} % / {pair[1]:.3f} % = {ratios[-1]:.2f}, "
            f"worst score {max(map(abs, own), default=np.nan):.1f}, {seconds[-1]:.1f} s",
            flush=True,
        )
    print(
        f"within 1.10: {np.mean(np.array(ratios) <= 1.1):.3f}, median {np.median(ratios):.3f}; right order "
        f"{np.mean(orders):.3f}; scores within 1.96: {np.mean(np.abs(scores) <= 1.96):.3f} of {len(scores)}; "
        f"{np.mean(seconds):.1f} s of CPU"
    )


if __name__ == "__main__":
    main()
