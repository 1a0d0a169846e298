"""Experiment design: an experiment that discriminates between causes that the record cannot distinguish."""

from collections.abc import Sequence
from dataclasses import replace
from math import ceil

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.diagnosis.inference.screening import ScreenedEffect
from islands.simulators.extended import ExtendedSimulator

#: Distance of two simulations in standard deviations of the noise that gives odds of twenty to one.
REQUIRED_DISTANCE = 2.7

#: Factors by which the excitation may be faster; the first sufficient one is suggested.
SPEED_FACTORS = (2, 4, 8, 16)


def suggest_experiment(best: CalibrationResult, alternatives: Sequence[ScreenedEffect]) -> str:
    """Suggest an experiment that discriminates between a simulation and its alternatives.

    Each fitted simulation is driven by the same input at higher speeds, and the difference of the outputs is
    compared with the noise.

    Returns
    -------
    str
        One suggestion for each alternative that the record does not distinguish, separated by semicolons;
        empty if it distinguishes all of them.
    """
    suggestions = []
    for alternative in alternatives:
        names = ", ".join(effect.name for effect in best.simulation.effects)
        distance = _compute_distance(best, alternative.fit, 1)
        if distance >= REQUIRED_DISTANCE:
            continue
        speed = next(
            (
                factor
                for factor in SPEED_FACTORS
                if _compute_distance(best, alternative.fit, factor) >= REQUIRED_DISTANCE
            ),
            None,
        )
        length = (REQUIRED_DISTANCE / max(distance, 1e-3)) ** 2
        advice = (
            f"play the same input {speed} times as fast, sampled as often per period"
            if speed is not None
            else f"a record {ceil(length)} times as long is enough"
            if length < 1000
            else "no faster input of this form distinguishes them; measure a signal between the places where "
            "they act instead"
        )
        suggestions.append(
            f"{names} or {alternative.effect.name}: this record separates them by {distance:.1f} standard "
            f"deviations of the noise, and {REQUIRED_DISTANCE} are needed: {advice}"
        )
    return "; ".join(suggestions)


def _compute_distance(one: CalibrationResult, other: CalibrationResult, speed: int) -> float:
    """Return the distance of two simulations at a higher speed, in standard deviations of the noise."""
    outputs = [
        ExtendedSimulator(
            fit.simulation.simulator,
            fit.simulation.effects,
            replace(fit.simulation.context, dt=fit.simulation.context.dt / speed),
        ).simulate(fit.values)
        for fit in (one, other)
    ]
    difference = one.noise.whiten(outputs[0] - outputs[1], one.simulation.context.segments)
    return float(np.sqrt(np.sum(difference**2) / one.noise.variance))
