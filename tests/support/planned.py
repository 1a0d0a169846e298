"""Experiments with cheap simulations whose separations are known in closed form."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy

from islands.diagnosis.planning.cause import Cause, CauseScale
from islands.diagnosis.planning.channel_noise import ChannelNoise, NoiseOrigin
from islands.diagnosis.planning.experiment import Experiment
from islands.diagnosis.planning.experiment_setup import make_experiment
from islands.diagnosis.planning.pair_separation import CausePair
from islands.diagnosis.planning.response_dictionary import ResponseDictionary
from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect
from islands.records.dataset import Dataset
from islands.records.noise_model import NoiseModel
from islands.simulators.external import PythonFunctionSimulator
from islands.simulators.interface import Simulator

DT = 0.01


def amplify(u: Signal, _dt: float, k: float = 2.0) -> Signal:
    """Return the output of an amplifier, which has no dynamics."""
    return k * u


def amplifier() -> Simulator:
    return PythonFunctionSimulator(amplify, "amplifier", {})


def input_record(u: Signal, dt: float = DT) -> Dataset:
    """Return the record of an input that was not measured yet."""
    return Dataset(
        u=u,
        y=np.full(u.size, np.nan),
        dt=dt,
        input_names=("u_V",),
        input_units=("V",),
        output_name="y_um",
        output_unit="um",
    )


def wave(frequencies: tuple[float, ...], samples: int = 400, dt: float = DT) -> Signal:
    """Return sines of equal amplitude whose sum begins at zero."""
    t = dt * np.arange(samples)
    return np.sum([np.sin(2 * np.pi * frequency * t) for frequency in frequencies], axis=0)


def amplifier_experiment(
    u: Signal, noise_std: float = 0.2, prior_std: Mapping[str, float] | None = None
) -> Experiment:
    return make_experiment(input_record(u), amplifier(), noise_std, prior_std or {})[0]


def coloured_noise(innovation_std: float, *coefficients: float) -> ChannelNoise:
    """Return autoregressive noise."""
    return ChannelNoise(NoiseModel(np.array(coefficients), innovation_std**2, np.inf), NoiseOrigin.GIVEN)


def with_noise(experiment: Experiment, noise: ChannelNoise) -> Experiment:
    """Return an experiment with another noise of its output."""
    return replace(experiment, channels=(replace(experiment.channels[0], noise=noise),))


def noise_covariance(innovation_std: float, coefficients: Sequence[float], samples: int) -> Signal:
    """Return the covariance of a stationary autoregression, from its impulse response."""
    response = scipy.signal.lfilter(
        [innovation_std], np.append(1.0, -np.array(coefficients)), np.eye(1, 4096)[0]
    )
    lags = [response[: response.size - lag] @ response[lag:] for lag in range(samples)]
    covariance: Signal = scipy.linalg.toeplitz(lags)
    return covariance


def take_effects(*names: str) -> list[Effect]:
    return [CATALOGUE[name] for name in names]


def make_cause(experiment: Experiment, effect: str | Effect, misfit: float = 1.0) -> Cause:
    """Return a cause of a misfit, given in standard deviations of the noise."""
    chosen = CATALOGUE[effect] if isinstance(effect, str) else effect
    cause = CauseScale(ResponseDictionary(experiment), chosen).find_cause(misfit)
    assert cause is not None
    return cause


def make_pair(experiment: Experiment, one: str, other: str) -> CausePair:
    return CausePair(make_cause(experiment, one), make_cause(experiment, other))
