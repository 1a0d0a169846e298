"""The decisive experiment: what would tell apart two causes that a record cannot."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from islands.discrepancy.calibration.levenberg_marquardt import CalibrationResult
from islands.discrepancy.inference.screening import ScreenedEffect
from islands.discrepancy.simulators.extended import ExtendedSimulator

#: How many standard deviations apart two causes have to be for a choice at twenty to one, and how much faster
#: an excitation may get.
NEEDED, FASTER = 2.7, (2, 4, 8, 16)


def suggest_experiment(best: CalibrationResult, instead: Sequence[ScreenedEffect]) -> str:
    """Say what would tell a simulation from the nearest one with another cause.

    The same input is played faster, each simulation as it was fitted: what they differ by then, in noise.
    """
    sayings = []
    for rung in instead:
        ours = ", ".join(effect.name for effect in best.simulation.effects)
        here = _apart(best, rung.fit, 1)
        if here >= NEEDED:
            continue
        needs = next((times for times in FASTER if _apart(best, rung.fit, times) >= NEEDED), None)
        longer = (NEEDED / max(here, 1e-3)) ** 2
        advice = (
            f"play the same input {needs} times as fast, sampled as often for each swing"
            if needs is not None
            else f"a record {longer:.0f} times as long would do"
            if longer < 1000
            else "no faster input of this form tells them apart; measure between the two places instead"
        )
        sayings.append(
            f"{ours} or {rung.effect.name}: this record's signal-to-noise for telling them is {here:.1f}, it "
            f"takes {NEEDED}: {advice}"
        )
    return "; ".join(sayings)


def _apart(one: CalibrationResult, other: CalibrationResult, times: int) -> float:
    """Return how many standard deviations of noise two simulations are apart when all happens faster."""
    signals = [
        ExtendedSimulator(
            fit.simulation.simulator,
            fit.simulation.effects,
            replace(fit.simulation.context, dt=fit.simulation.context.dt / times),
        ).simulate(fit.values)
        for fit in (one, other)
    ]
    difference = one.noise.whiten(signals[0] - signals[1])
    return float(np.sqrt(np.sum(difference**2) / one.noise.variance))
