"""Discovery of physics that is not in the catalogue, hidden in the built-in simulators.

    python -m lab.diagnosis.missing_terms [--simulator NAME ...] [--law NAME ...] [--seeds N] [--first SEED]
                                       [--strengths S ...]

Each law is one term in one equation, simulated by the midpoint rule at a tenth of the sampling time. The
noise is scaled so that the part of the law which the parameters do not absorb has the given strength, in
standard deviations of the noise. An answer is right if the diagnosis is "discovered" and the extended
equations have the error of the noise on a new record.
"""

import argparse
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from time import process_time

import numpy as np

import islands
from islands.diagnosis.calibration.levenberg_marquardt import calibrate
from islands.diagnosis.calibration.preparation import make_target
from islands.diagnosis.calibration.record_simulation import simulate_spec
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.result import Diagnosis
from islands.errors import RecordError
from islands.report.documents.extension import extended_json
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.specification.factory import make_simulator

STEPS = 10

#: Largest error of the extended equations on a new record, relative to the noise.
MAX_ERROR = 1.1

#: Derivatives of the states, given the states, the input and its rate.
Derivatives = Callable[[tuple[float, ...], float, float], tuple[float, ...]]

#: Value of a term, given the states, the input, its rate and the time.
Term = Callable[[tuple[float, ...], float, float, float], float]


@dataclass(frozen=True)
class Rig:
    """A system that a built-in simulator describes, with a term in one equation.

    Attributes
    ----------
    derivatives : callable
    output : callable
        Output, given the states and the input.
    initial : tuple of float
        States at the first sample.
    dt : float
        Sampling time in seconds.
    units : tuple of str
        Units of input and output.
    offset, size, slowest, fastest : float
        Mean of the input, amplitude of each of its twelve sines, and range of their frequencies in Hz.
    samples : int
    tolerance : mapping
        Tolerances of the parameters; the others are estimated.
    """

    derivatives: Derivatives
    output: Callable[[tuple[float, ...], float], float]
    initial: tuple[float, ...]
    dt: float
    units: tuple[str, str]
    offset: float
    size: float
    slowest: float
    fastest: float
    samples: int = 3000
    tolerance: Mapping[str, float] = field(default_factory=dict)

    def simulate(
        self, term: Term, place: int | None, rng: np.random.Generator, samples: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the input and the output without noise, each of shape (samples,).

        The term is added to the derivative of the state with the index ``place``; None for the output. Where
        the output diverges, another input is drawn.
        """
        while True:
            u, y = self._simulate_once(term, place, rng, samples)
            if np.isfinite(y).all():
                return u, y

    def _simulate_once(
        self, term: Term, place: int | None, rng: np.random.Generator, samples: int
    ) -> tuple[np.ndarray, np.ndarray]:
        time = self.dt * np.arange(samples)
        frequencies = rng.uniform(self.slowest, self.fastest, 12)
        phases = rng.uniform(0, 6.3, 12)
        u = self.size * np.sin(2 * np.pi * np.outer(time, frequencies) + phases).sum(axis=1)
        u = self.offset + u * np.minimum(1.0, time / (100.0 * self.dt))
        u = np.maximum(u, 0.0) if self.offset else u
        h = self.dt / STEPS
        fine = h * (0.5 + np.arange(samples * STEPS))
        pushed = np.interp(fine, time, u).tolist()
        slopes = np.repeat(np.diff(u, append=u[-1]) / self.dt, STEPS).tolist()

        def slope(states: tuple[float, ...], at: int) -> list[float]:
            found = list(self.derivatives(states, pushed[at], slopes[at]))
            if place is not None:
                found[place] += term(states, pushed[at], slopes[at], fine[at])
            return found

        states, y = self.initial, np.empty(samples)
        for k in range(samples * STEPS):
            if k % STEPS == 0:
                sample = k // STEPS
                y[sample] = self.output(states, u[sample])
                if place is None:
                    y[sample] += term(states, u[sample], slopes[k], time[sample])
            middle = tuple(x + h / 2 * d for x, d in zip(states, slope(states, k), strict=True))
            states = tuple(x + h * d for x, d in zip(states, slope(middle, k), strict=True))
        return u, y

    def make_record(
        self, u: np.ndarray, y: np.ndarray, sigma: float, rng: np.random.Generator
    ) -> islands.Dataset:
        """Return a record with white noise."""
        input_unit, output_unit = self.units
        return islands.Dataset(
            *(u, y + sigma * rng.standard_normal(y.size), self.dt, (f"u_{input_unit}",)),
            output_name=f"y_{output_unit}",
            input_units=(input_unit,),
            output_unit=output_unit,
        )


def _move_axis(s: tuple[float, ...], u: float, _w: float) -> tuple[float, ...]:
    return s[1], (u - 6.0 * s[1] - 4.0 * np.tanh(s[1] / 0.01)) / 2.0


def _fill_tanks(s: tuple[float, ...], u: float, _w: float) -> tuple[float, ...]:
    upper, lower = (0.05 * max(level, 0.0) ** 0.5 for level in s)
    return 0.04 * u - upper, upper - lower


def _turn_loop(s: tuple[float, ...], _u: float, w: float) -> tuple[float, ...]:
    return (0.89 * w - 0.0081 * abs(w) * s[0] - 0.0079 * w * abs(s[0]),)


#: Systems by the name of their simulator.
RIGS: Mapping[str, Rig] = {
    "second-order": Rig(
        lambda s, u, _w: (s[1], u - 2.0 * s[1] - 100.0 * s[0]),
        *(lambda s, _u: s[0], (0.0, 0.0), 0.01, ("N", "m"), 0.0, 12.0, 0.2, 3.0),
    ),
    "bouc-wen-piezo": Rig(
        _turn_loop,
        *(lambda s, u: 1.605 * u - s[0], (0.0,), 0.01, ("V", "um"), 0.0, 8.0, 0.1, 1.5),
        tolerance={"A": 0.02, "beta": 0.05, "gamma": 0.05, "dp": 0.01},
    ),
    "cascaded-tanks": Rig(
        _fill_tanks,
        *(lambda s, _u: s[1], (5.0, 5.0), 4.0, ("V", "V"), 3.0, 0.6, 3e-4, 5e-3),
    ),
    "rigid-axis": Rig(
        _move_axis,
        *(lambda s, _u: s[0], (0.0, 0.0), 0.01, ("N", "m"), 0.0, 10.0, 0.2, 2.0),
    ),
}

#: Terms by simulator and name, each with the index of the state in whose equation it is; None for the output.
LAWS: Mapping[str, Mapping[str, tuple[int | None, Term]]] = {
    "second-order": {
        "van der Pol": (1, lambda s, _u, _w, _t: -40.0 * s[0] ** 2 * s[1]),
        "tanh spring": (1, lambda s, _u, _w, _t: -20.0 * np.tanh(s[0] / 0.1)),
        "product": (1, lambda s, _u, _w, _t: -6.0 * s[0] * s[1]),
        "bilinear": (1, lambda s, u, _w, _t: -0.5 * s[0] * u),
        "fifth power": (1, lambda s, _u, _w, _t: -2000.0 * s[0] ** 5),
        "cubic damping": (1, lambda s, _u, _w, _t: -0.1 * s[1] ** 3),
        "position friction": (1, lambda s, _u, _w, _t: -10.0 * abs(s[0]) * np.tanh(s[1] / 0.01)),
        "one-sided spring": (1, lambda s, _u, _w, _t: -40.0 * max(s[0], 0.0)),
        "softening damper": (1, lambda s, _u, _w, _t: -3.0 * np.tanh(s[1] / 0.8)),
        "growing stiffness": (1, lambda s, _u, _w, t: -1.0 * t * s[0]),
        "input-dependent damping": (1, lambda s, u, _w, _t: -0.05 * u * s[1]),
        "Stribeck friction": (
            1,
            lambda s, _u, _w, _t: -6.0 * np.tanh(s[1] / 0.01) * np.exp(-((s[1] / 0.5) ** 2)),
        ),
    },
    "bouc-wen-piezo": {
        "product of position and velocity": (None, lambda _s, u, w, _t: 5e-4 * u * w),
        "position-dependent damping": (None, lambda _s, u, w, _t: -2e-5 * u * u * w),
        "saturating hysteresis": (None, lambda s, _u, _w, _t: 2.0 * np.tanh(s[0] / 5.0)),
        "voltage in the loop": (0, lambda _s, u, w, _t: 0.002 * abs(w) * u),
    },
    "cascaded-tanks": {
        "third-power outflow": (1, lambda s, _u, _w, _t: -2e-5 * s[1] ** 3),
        "pump curve": (0, lambda _s, u, _w, _t: -0.1 * np.tanh(u / 2.0)),
        "back pressure": (0, lambda s, u, _w, _t: -0.002 * u * s[0]),
    },
    "rigid-axis": {
        "position friction": (1, lambda s, _u, _w, _t: -4.0 * abs(s[0]) * np.tanh(s[1] / 0.01)),
        "tanh spring": (1, lambda s, _u, _w, _t: -10.0 * np.tanh(s[0] / 0.3)),
        "position-dependent drive": (1, lambda s, u, _w, _t: 0.2 * s[0] * u),
    },
}


def measure_misfit(name: str, record: islands.Dataset) -> float:
    """Return the RMS of the residual of a simulator that is calibrated to a record without noise."""
    rig = RIGS[name]
    simulator = make_simulator(name, record)
    simulation = ExtendedSimulator(simulator, (), make_context(record, simulator, record.samples))
    fit = calibrate(simulation, make_target(record, record.samples, rig.tolerance), simulation.nominal)
    return float(np.std(record.y - fit.output))


def run_trial(name: str, law: str, strength: float, seed: int) -> tuple[Diagnosis, float]:
    """Return the diagnosis of a record, and the error on a new one relative to the noise."""
    rig, (place, term) = RIGS[name], LAWS[name][law]
    rng = np.random.default_rng(seed)
    u, y = rig.simulate(term, place, rng, rig.samples)
    sigma = measure_misfit(name, rig.make_record(u, y, 0.0, rng)) / strength
    found = islands.diagnose(rig.make_record(u, y, sigma, rng), name, tolerance=rig.tolerance)
    other = rig.make_record(*rig.simulate(term, place, rng, rig.samples), sigma, rng)
    if found.gain is None:
        return found, float("nan")
    try:
        simulated = simulate_spec(json.loads(extended_json(found.best, found.record)), other)
    except RecordError:  # the extended simulation diverges on the new record
        return found, float("inf")
    return found, float(np.std(other.y - simulated)) / sigma


def main() -> None:
    """Print a line for each trial and the counts of each simulator and strength."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--simulator", choices=tuple(RIGS), nargs="+", default=list(RIGS))
    parser.add_argument("--law", nargs="+", help="names of laws; by default all")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--strengths", type=float, nargs="+", default=[0.5, 1.0, 3.0])
    asked = parser.parse_args()
    for name in asked.simulator:
        counts = {strength: [0] * 4 for strength in asked.strengths}
        for law in LAWS[name] if asked.law is None else [each for each in LAWS[name] if each in asked.law]:
            for strength in asked.strengths:
                for seed in range(asked.first, asked.first + asked.seeds):
                    began = process_time()
                    found, error = run_trial(name, law, strength, seed)
                    is_right = found.verdict == Verdict.DISCOVERED and error < MAX_ERROR
                    named = [each.name for each in found.effects if each.explained_fraction is not None]
                    is_misnamed = found.verdict == Verdict.NAMED and bool(named) and error >= MAX_ERROR
                    for index, counted in enumerate((True, is_right, is_misnamed, error < MAX_ERROR)):
                        counts[strength][index] += int(counted)
                    said = found.discovery.equations if found.discovery else ", ".join(named)
                    print(
                        f"{name}, {law}, {strength:g} sigma, seed {seed}: {found.verdict}: {said} "
                        f"(error {error:.2f} sigma, {process_time() - began:.1f} s)",
                        flush=True,
                    )
        for strength, (trials, right, misnamed, predicted) in counts.items():
            print(
                f"{name}, {strength:g} sigma: {right} of {trials} discovered, {predicted} predicted within "
                f"{MAX_ERROR}; {misnamed} named without a remainder by effects that do not predict"
            )


if __name__ == "__main__":
    main()
