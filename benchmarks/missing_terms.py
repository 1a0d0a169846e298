"""Discovery of forces that are not in the catalogue, hidden in an oscillator.

    python benchmarks/missing_terms.py [--seeds N] [--first SEED] [--strengths S ...]

Each law is simulated by the midpoint rule at a tenth of the sampling time. The noise is scaled so that the
law changes the output by the given strength, in standard deviations of the noise. An answer is right if the
diagnosis is "discovered" and the extended equations have the error of the noise on a new record.
"""

import argparse
import json
from collections.abc import Callable
from time import process_time

import numpy as np

import islands
from islands.discrepancy.diagnosis_result import Diagnosis
from islands.discrepancy.inference.verdict import Verdict
from islands.io.simulator_spec.document import extended_json
from islands.io.simulator_spec.factory import simulate_spec
from islands.io.simulator_spec.ode_spec import OdeSpec

DT, STEPS, SAMPLES = 0.01, 10, 3000

#: Largest error of the extended equations on a new record, relative to the noise.
MAX_ERROR = 1.1

EQUATIONS = {
    "name": "oscillator",
    "input": "F",
    "output": "x",
    "equations": "dx/dt = v\ndv/dt = (F - c*v - k*x - force)/m\n",
    "parameters": {"m": {"value": 1.05}, "c": {"value": 1.8}, "k": {"value": 105.0}},
    "states": {"x": {"unit": "m"}, "v": {"unit": "m/s"}},
    "force": {"coordinate": "x", "rate": "v"},
}

Law = Callable[[float, float, float, float], float]

#: Forces that resist the motion, as functions of position, speed, input and time; "none" is a clean record.
LAWS: dict[str, Law] = {
    "none": lambda _x, _v, _u, _t: 0.0,
    "van der Pol": lambda x, v, _u, _t: 40.0 * x * x * v,
    "tanh spring": lambda x, _v, _u, _t: 20.0 * np.tanh(x / 0.1),
    "product": lambda x, v, _u, _t: 6.0 * x * v,
    "bilinear": lambda x, _v, u, _t: 0.5 * x * u,
    "fifth power": lambda x, _v, _u, _t: 2000.0 * x**5,
    "cubic damping": lambda _x, v, _u, _t: 0.1 * v**3,
    "position friction": lambda x, v, _u, _t: 10.0 * abs(x) * np.tanh(v / 0.01),
    "one-sided spring": lambda x, _v, _u, _t: 40.0 * max(x, 0.0),
    "softening damper": lambda _x, v, _u, _t: 3.0 * np.tanh(v / 0.8),
    "growing stiffness": lambda x, _v, _u, t: 1.0 * t * x,
    "input-dependent damping": lambda _x, v, u, _t: 0.05 * u * v,
    "sine of position": lambda x, _v, _u, _t: 10.0 * np.sin(x / 0.08),
}


def simulate(law: Law, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return the input and the output without noise, each of shape (samples,)."""
    time = DT * np.arange(SAMPLES)
    frequencies = rng.uniform(0.2, 3.0, 12)
    u = 12.0 * np.sin(2 * np.pi * np.outer(time, frequencies) + rng.uniform(0, 6.3, 12)).sum(axis=1)
    u *= np.minimum(1.0, time)
    h = DT / STEPS
    places = h * (0.5 + np.arange(SAMPLES * STEPS))
    x = v = 0.0
    y = np.empty(SAMPLES * STEPS)
    for k, (force, t) in enumerate(zip(np.interp(places, time, u).tolist(), places.tolist(), strict=True)):
        y[k] = x
        middle_x = x + h / 2 * v
        middle_v = v + h / 2 * (force - 2.0 * v - 100.0 * x - law(x, v, force, t))
        x, v = (
            x + h * middle_v,
            v + h * (force - 2.0 * middle_v - 100.0 * middle_x - law(middle_x, middle_v, force, t)),
        )
    return u, y[::STEPS]


def make_record(u: np.ndarray, y: np.ndarray, sigma: float, rng: np.random.Generator) -> islands.Dataset:
    noisy = y + sigma * rng.standard_normal(y.size)
    return islands.Dataset(u, noisy, DT, ("F_N",), output_name="x_m", input_units=("N",), output_unit="m")


def run_trial(law: Law, strength: float, seed: int) -> tuple[Diagnosis, float]:
    """Return the diagnosis of a record, and the error on a new one relative to the noise."""
    rng = np.random.default_rng(seed)
    u, y = simulate(law, rng)
    _, clean = simulate(LAWS["none"], np.random.default_rng(seed))
    misfit = float(np.std(y - clean))
    sigma = misfit / strength if misfit else 0.01 * float(np.std(y))
    found = islands.diagnose(
        make_record(u, y, sigma, rng), OdeSpec.model_validate({"kind": "ode", **EQUATIONS})
    )
    other = make_record(*simulate(law, rng), sigma, rng)
    if found.gain is None:
        return found, float("nan")
    simulated = simulate_spec(json.loads(extended_json(found.best, found.record)), other)
    return found, float(np.std(other.y - simulated)) / sigma


def main() -> None:
    """Print a line for each trial and the counts of each strength."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--strengths", type=float, nargs="+", default=[0.5, 1.0, 3.0])
    asked = parser.parse_args()
    counts = {strength: [0, 0, 0, 0] for strength in asked.strengths}
    for name, law in LAWS.items():
        for strength in asked.strengths if name != "none" else [0.0]:
            for seed in range(asked.first, asked.first + asked.seeds):
                began = process_time()
                found, error = run_trial(law, strength, seed)
                right = found.verdict == Verdict.DISCOVERED and error < MAX_ERROR
                named = [each.name for each in found.effects if each.explained_fraction is not None]
                is_misnamed = found.verdict == Verdict.NAMED and bool(named) and error >= MAX_ERROR
                if name != "none":
                    for index, value in enumerate((1, right, is_misnamed, error < MAX_ERROR)):
                        counts[strength][index] += value
                said = found.discovery.equations if found.discovery else ", ".join(named)
                print(
                    f"{name:24} {strength:3g} sigma, seed {seed}: {found.verdict}: {said} "
                    f"(error {error:.2f} sigma, {process_time() - began:.1f} s)",
                    flush=True,
                )
    for strength, (trials, right, misnamed, predicted) in counts.items():
        print(
            f"{strength:g} sigma: {right} of {trials} discovered, {predicted} predicted within {MAX_ERROR}; "
            f"{misnamed} named without a remainder by effects that do not predict"
        )


if __name__ == "__main__":
    main()
