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
from islands.diagnosis.inference.screening import ScreenedEffect, screen_effects
from islands.diagnosis.inference.strategies import SearchOutcome
from islands.diagnosis.run import DiagnosisRun
from islands.effects.timing import DELAY, RESONANCE, SENSOR_LAG
from islands.simulators.interface import Simulator

#: Effects that another behaviour of the input between samples imitates.
_EFFECTS = (DELAY, SENSOR_LAG, RESONANCE)


def add_timing_alternatives(outcome: SearchOutcome, run: DiagnosisRun) -> SearchOutcome:
    """Return an outcome with the alternatives to its effects of time that need another behaviour."""
    base, hypothesis, target = outcome.base, outcome.hypothesis, outcome.target
    effects = [effect for effect in hypothesis.effects if effect in _EFFECTS]
    bare = Hypothesis(base, base.score, ())
    single = len(hypothesis.effects) == 1
    removed = [bare] * len(effects) if single else remove_each(hypothesis, effects, target, run.parallel_map)
    found = {}
    for effect, without in zip(effects, removed, strict=True):
        screened = [each for each in _screen(without, hypothesis.fit, target, run) if each.effect != effect]
        found[effect.name] = Alternatives(without, screened)
    return replace(outcome, timing_alternatives=found)


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
