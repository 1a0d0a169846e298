"""Recordings of an oscillator from different initial states, with an effect that a simulation may lack."""

from dataclasses import replace

import numpy as np
import scipy

from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.context import ForceCoordinate, SimulationContext
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.intersample import ResampledSimulator
from support.built_in_simulators import make_oscillator

DT = 0.01

#: Standard deviation of the noise.
SIGMA = 2e-4

#: Position and rate at the first sample of each recording.
STATES = ((0.05, 0.0), (-0.04, 0.3), (0.02, -0.5))


def oscillator_recordings(
    seed: int, lengths: tuple[int, ...] = (400, 300, 300), effect: str = "", value: float = 0.0
) -> tuple[Dataset, ...]:
    """Simulate ``0.5 x'' + 4 x' + 200 x + effect = u``, and add white noise."""
    rng = np.random.default_rng(seed)
    added = (CATALOGUE[effect],) if effect else ()
    coordinate = ForceCoordinate("m", 0.3, 1.0, "N", 60.0, is_dissipative=True, friction_smoothing=0.02)
    recordings = []
    for (position, rate), samples in zip(STATES, lengths, strict=False):
        u = scipy.signal.lfilter([0.05], [1.0, -0.95], rng.standard_normal(samples + 200))[200:]
        u *= 20.0 / np.std(u)
        oscillator = make_oscillator(0.5, 4.0, 200.0, position, rate)
        simulator = ResampledSimulator(oscillator, oversampling=8)
        context = SimulationContext(u, DT, {}, {}, 60.0, 0.3, "N", "m", samples * DT)
        simulation = ExtendedSimulator(simulator, added, replace(context, force_coordinate=coordinate))
        values = simulation.nominal
        if added:
            values[-1] = value
        recordings.append(
            Dataset(
                u=u,
                y=simulation.simulate(values) + SIGMA * rng.standard_normal(samples),
                dt=DT,
                input_names=("u_N",),
                input_units=("N",),
                output_name="y_m",
                output_unit="m",
            )
        )
    return tuple(recordings)
