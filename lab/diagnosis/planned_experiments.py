"""Experiments of the benchmarks of plans: noise that is measured first, and records with hidden causes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from islands.diagnosis.planning.experiment import Experiment, make_model
from islands.diagnosis.planning.experiment_setup import make_experiment
from islands.diagnosis.procedure import diagnose
from islands.effects.interface.effect import Effect
from islands.records.dataset import Dataset
from islands.simulators.specification.factory import make_simulator
from islands.systems.signals import sines
from lab.diagnosis.injection.noise import NOISES

ROOT = Path(__file__).resolve().parents[2]

#: Seeds of the record that coloured noise is measured in.
MEASURED = 59


@dataclass(frozen=True)
class Planned:
    """An experiment and the causes that are hidden in its records.

    Attributes
    ----------
    spec : str
        Simulation.
    u : ndarray, shape (samples,)
    dt : float
    noise : float
        Noise relative to the standard deviation of the output.
    causes : tuple of str
    """

    spec: str
    u: np.ndarray
    dt: float
    noise: float
    causes: tuple[str, ...]


EXPERIMENTS = {
    "dc-motor": Planned(
        f"ode:{ROOT}/examples/simulations/dc-motor.toml",
        sines(0.001, 2.0, (3.0, 1.0), (2.0, 7.3)),
        0.001,
        0.01,
        ("delay", "coulomb-friction", "cubic-stiffness"),
    ),
    "second-order": Planned(
        f"ode:{ROOT}/examples/simulations/second-order.toml",
        sines(0.01, 16.0, (20.0, 12.0), (0.31, 1.37)),
        0.01,
        0.02,
        ("backlash", "dead-zone", "sensor-lag"),
    ),
    "bouc-wen-piezo": Planned(
        "bouc-wen-piezo",
        sines(0.005, 8.0, (60.0, 20.0), (0.5, 1.7)) + 75.0,
        0.005,
        0.003,
        ("exponential-creep", "delay", "linear-drift"),
    ),
}


@dataclass(frozen=True)
class NoisePlans:
    """Plans of one experiment for noise that was measured in a record without a cause.

    Attributes
    ----------
    planned : Planned
    kind : str
        Kind of the noise.
    size : float
        Standard deviation of the noise.
    clean : ndarray, shape (samples,)
        Noise-free output without a cause.
    experiments : mapping
        The experiment by the noise of the plan: with the noise model of the record, and with white noise of
        the same standard deviation.
    effects : tuple of Effect
    """

    planned: Planned
    kind: str
    size: float
    clean: np.ndarray
    experiments: Mapping[str, Experiment]
    effects: tuple[Effect, ...]

    def diagnose(self, effect: Effect, values: Sequence[float], seeds: Sequence[int]) -> list[set[str]]:
        """Return the first cause of each diagnosis and its equivalents, for records with an effect."""
        model = make_model(self.experiments["white"], effect)
        y = model.output.simulate(model.insert(effect, values))
        listed = []
        for seed in seeds:
            noise = self.size * NOISES[self.kind](np.random.default_rng([seed, 61]), self.clean)
            record = Dataset(u=self.planned.u, y=y + noise, dt=self.planned.dt)
            diagnosis = diagnose(record, make_simulator(self.planned.spec, record))
            first = next((each for each in diagnosis.effects if each.family != "data"), None)
            listed.append(set() if first is None else {first.name, *first.equivalents})
        return listed


def make_plans(planned: Planned, kind: str) -> NoisePlans:
    """Measure noise in one record without a cause, and make the experiments of its plans."""
    record = Dataset(u=planned.u, y=np.full(planned.u.size, np.nan), dt=planned.dt)
    simulator = make_simulator(planned.spec, record)
    prior_std = simulator.tolerances
    simulation = make_model(make_experiment(record, simulator, 1.0, prior_std)[0]).output
    clean = simulation.simulate(simulation.nominal)
    size = planned.noise * float(np.std(clean))
    experiments = {}
    noise_std = size
    if kind != "white":
        noise = size * NOISES[kind](np.random.default_rng(MEASURED), clean)
        measured = replace(record, y=clean + noise)
        experiments["measured"], _ = make_experiment(measured, simulator, None, prior_std)
        noise_std = experiments["measured"].noise.std
    experiments["white"], effects = make_experiment(record, simulator, noise_std, prior_std)
    return NoisePlans(planned, kind, size, clean, experiments, tuple(effects))
