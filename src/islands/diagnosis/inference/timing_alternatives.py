"""Effects of time that need another behaviour of the input between samples than a simulation has.

A wrong behaviour and one effect imitate the right behaviour and another one: a hold is half a sample late,
and a linear input between samples has less of the fast parts than a band-limited one. A resonance that
restores them next to the one explains as much as a delay or a lag next to the other.
"""

from collections.abc import Sequence
from dataclasses import replace
from operator import itemgetter

from islands.diagnosis.calibration.intersample_selection import (
    MIN_IMPROVEMENT,
    list_other_holds,
)
from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.hypothesis import Alternatives, Hypothesis, remove_each, with_effect
from islands.diagnosis.inference.screening import ScreenedEffect, screen_effects, sort_screened
from islands.diagnosis.run import DiagnosisRun
from islands.effects.interface.effect import Effect
from islands.effects.timing import DELAY, RESONANCE, SENSOR_LAG
from islands.simulators.interface import Simulator

#: Effects that another behaviour of the input between samples imitates.
_EFFECTS = (DELAY, SENSOR_LAG, RESONANCE)


def add_timing_alternatives(
    alternatives: Alternatives, effect: Effect, larger: CalibrationResult, target: Target, run: DiagnosisRun
) -> Alternatives:
    """Return the alternatives to an effect with those that need another behaviour of the input.

    Parameters
    ----------
    alternatives : Alternatives
    effect : Effect
        If it is none of time, the alternatives are returned as they are.
    larger : CalibrationResult
        Fit with the effect.
    """
    if effect not in _EFFECTS:
        return alternatives
    without = alternatives.without
    others = [each for each in _screen(without, larger, target, run) if each.effect != effect]
    best: dict[str, ScreenedEffect] = {}
    for each in sort_screened([*alternatives.screened, *others], without.fit):
        best.setdefault(each.effect.name, each)
    return replace(alternatives, screened=list(best.values()))


def find_timing_simulator(hypothesis: Hypothesis, target: Target, run: DiagnosisRun) -> Simulator | None:
    """Return the simulator with another behaviour of the input that suits another effect of time better.

    Returns
    -------
    Simulator or None
        None if no effect that replaces one of the hypothesis explains the record better with it.
    """
    effects = [effect for effect in hypothesis.effects if effect in _EFFECTS]
    found = [
        (with_effect(without, each).cost, each.fit.simulation.simulator)
        for without in remove_each(hypothesis, effects, target, run.parallel_map)
        for each in _screen(without, hypothesis.fit, target, run)
    ]
    cost, simulator = min(found, key=itemgetter(0), default=(hypothesis.cost, None))
    return simulator if cost < hypothesis.cost - MIN_IMPROVEMENT else None


def _screen(
    without: Hypothesis, larger: CalibrationResult, target: Target, run: DiagnosisRun
) -> Sequence[ScreenedEffect]:
    """Screen effects of time with each other behaviour of the input between samples."""
    simulation = without.fit.simulation
    timing = [each for each in run.effects if each in _EFFECTS and each not in simulation.effects]
    screened: list[ScreenedEffect] = []
    for simulator in list_other_holds(simulation.simulator):
        base = calibrate(replace(simulation, simulator=simulator), target, without.fit.values)
        screened += screen_effects(base, target, run.with_effects(timing), larger)
    return screened
