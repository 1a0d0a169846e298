"""Diagnosis: what a simulation gets wrong, its cause, the simulation with it, and what that is worth."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from islands.data.dataset import Dataset
from islands.discrepancy.calibration import Calibrated, Target, calibrate
from islands.discrepancy.core import Core
from islands.discrepancy.decision import (
    TEMPER,
    Finding,
    Value,
    Verdict,
    confirmed,
    decided,
    findings,
    reference,
    share,
)
from islands.discrepancy.detectors import DETECTORS
from islands.discrepancy.effect import Effect, Scene, Signal, Site
from islands.discrepancy.effects import CATALOGUE
from islands.discrepancy.effects.wrong_parameter import plain, wrong_parameter
from islands.discrepancy.experiment import decisive
from islands.discrepancy.extended import Extended
from islands.discrepancy.gain import Gain, gain_of
from islands.discrepancy.ladder import Rung, ladder
from islands.discrepancy.reference import explainable
from islands.discrepancy.remainder import remainder
from islands.discrepancy.search import LEAST, Tell, explained
from islands.errors import RecordError, SettingsError

#: Part of the record that nothing but the gain ever sees: its end.
LOCKED = 0.25

#: The fewest samples that are worth an analysis.
FEWEST = 400

#: Part of a residual's mean square that a flexible reference would not explain by chance.
NOTICEABLE = 0.05


@dataclass(frozen=True, slots=True)
class Candidate:
    """A rung of the first ladder: one effect beside the simulation alone."""

    name: str
    score: float
    eta: float


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """What was found.

    Attributes
    ----------
    verdict : Verdict
    effects : tuple of Finding
        The most important first; empty for "nothing" and "unknown".
    candidates : tuple of Candidate
        All effects beside the simulation, the best first.
    gain : Gain or None
        On data that nothing else has seen; None where nothing was added to the simulation.
    remainder : mapping of str to float
        Maps in which what is left is no chance, with their distance in standard deviations.
    decisive_experiment : str
        What would tell apart what this record cannot; "" where there is nothing to tell apart.
    record : Dataset
    fitted : int
        Samples, from the first on, that estimation has seen; the rest is locked.
    base, best : Calibrated
        The simulation calibrated without the effects, and with them.
    noise_floor : float
        RMSE that no simulation is expected to be below: an upper bound.
    as_given : float
        RMSE of the simulation with its nominal values over the locked samples.
    """

    verdict: Verdict
    effects: tuple[Finding, ...]
    candidates: tuple[Candidate, ...]
    gain: Gain | None
    remainder: Mapping[str, float]
    decisive_experiment: str
    record: Dataset
    fitted: int
    base: Calibrated
    best: Calibrated
    noise_floor: float
    as_given: float


def _silent(_line: str) -> None:
    pass


def diagnose(
    record: Dataset,
    core: Core,
    tolerance: Mapping[str, float] | None = None,
    seed: int = 0,
    tell: Tell = _silent,
) -> Diagnosis:
    """Find out what a simulation gets wrong about a record.

    Parameters
    ----------
    record : Dataset
        Its first input drives the simulation; further ones are channels that may couple in.
    core : Core
        The simulation.
    tolerance : mapping, optional
        Relative standard deviations of the simulation's parameters about their nominal values. Who is not
        named is free, and what another value of it mends is no discrepancy.
    seed : int
        Of all that is drawn by lot.
    tell : callable
        Told what is being done.

    Raises
    ------
    RecordError
        The record is too short, has gaps or a signal that does not move, or the simulation diverges on it.
    SettingsError
        A tolerance is not positive, or of a parameter that the simulation does not have.
    """
    known = _checked(tolerance or {}, core)
    fitted = _fitted(record)
    scene = _scene(record, core, fitted)
    rng = np.random.default_rng(seed)
    simulation = Extended(core, (), scene)
    target = Target(record.y, np.arange(record.samples) < fitted, None, known)
    tell("calibrating the simulation")
    base = calibrate(simulation, target, simulation.nominal)
    effects = effects_for(core, scene, known)
    tell(f"looking for each of {len(effects)} effects")
    rungs = ladder(base, target, effects)
    memory = (rungs[0].fit if rungs and rungs[0].gained(base) > LEAST else base).noise
    if memory.order:
        # Once more, with what the noise remembers taken out: plain least squares would fit that as well.
        tell("the noise remembers: once more with that taken out")
        target = replace(target, noise=memory)
        base = calibrate(simulation, target, base.values)
        rungs = ladder(base, target, effects)
    found = confirmed(explained(base, rungs, target, effects, tell), base, target, fitted, rng)
    tell("what is left over")
    residual = (record.y - found.fit.output)[:fitted]
    seen = found.fit.output[:fitted]
    left = explainable(residual, scene.u[:fitted], seen, rng)
    maps = remainder(residual, seen, scene, rng)
    floor = max(found.fit.mean_square - left, 0.0)
    remains = bool(maps) or left > NOTICEABLE * found.fit.mean_square
    verdict = decided(share(reference(found, base, target), found.fit, floor), bool(found.effects), remains)
    named: tuple[Finding, ...] = ()
    instead: tuple[Rung, ...] = ()
    if verdict in (Verdict.NAMED, Verdict.REMAINDER):
        tell("what else could be the cause")
        named, instead = findings(found, base, rungs, target, effects, floor)
    noise = _noise(record.y[:fitted], residual, scene) if verdict != Verdict.UNKNOWN else ()
    given = simulation.simulate(simulation.nominal)
    locked = slice(fitted, record.samples)
    best = found.fit if named else base
    return Diagnosis(
        Verdict.NAMED if noise and verdict == Verdict.NOTHING else verdict,
        (*named, *noise),
        tuple(Candidate(plain(r.effect.name), r.gained(base), share(base, r.fit, floor)) for r in rungs),
        gain_of(record, base.output, best.output, locked, floor**0.5, rng) if named else None,
        maps,
        decisive(found.fit, instead),
        record,
        fitted,
        base,
        best,
        floor**0.5,
        float(np.sqrt(np.mean((record.y - given)[locked] ** 2))),
    )


def effects_for(core: Core, scene: Scene, tolerance: Mapping[str, float]) -> list[Effect]:
    """Return the effects that can enter a simulation and that a record could show."""
    trusted = {parameter.name for parameter in core.parameters} <= tolerance.keys()
    effects = [
        effect
        for effect in CATALOGUE.values()
        if effect.site in core.sites
        and (effect.site != Site.CORE or effect.name in core.understood)
        and (trusted or not effect.gain)
        and effect.applies(scene)
    ]
    return effects + [wrong_parameter(each) for each in core.parameters if each.name in tolerance]


def _checked(tolerance: Mapping[str, float], core: Core) -> Mapping[str, float]:
    names = [parameter.name for parameter in core.parameters]
    for name, value in tolerance.items():
        if name not in names:
            raise SettingsError(f"{core.name} has no parameter {name!r}: it has {', '.join(names) or 'none'}")
        if not 0.0 < value < 1.0:
            raise SettingsError(f"the tolerance of {name} is a part of its value, like 0.02; got {value:g}")
    return dict(tolerance)


def _fitted(record: Dataset) -> int:
    """Return how many samples estimation sees, once it is known that the record can be used."""
    if record.samples < FEWEST:
        raise RecordError(
            f"the record has {record.samples} samples, and a diagnosis takes {FEWEST} at least: give a "
            "longer one"
        )
    if len(record.segments) > 1:
        raise RecordError("the record is several recordings: diagnose one after the other")
    if np.isnan(record.y).any():
        raise RecordError("the measured output has gaps: repair them, or select rows without any")
    fitted = int((1.0 - LOCKED) * record.samples)
    for name, signal in zip((*record.input_names, record.output_name), (*record.u.T, record.y), strict=True):
        if np.ptp(signal[:fitted]) == 0.0:
            raise RecordError(f"column {name} is constant: a diagnosis needs signals that move")
    for name, signal in zip(record.input_names[1:], record.u.T[1:], strict=True):
        if np.array_equal(signal, record.u[:, 0]):
            raise RecordError(f"channel {name} is the input itself: leave it out")
    return fitted


def _scene(record: Dataset, core: Core, fitted: int) -> Scene:
    names, units = record.input_names, record.input_units
    scene = Scene(
        u=np.ascontiguousarray(record.u[:, 0]),
        dt=record.dt,
        channels={
            name: np.ascontiguousarray(record.u[:, place]) for place, name in enumerate(names) if place
        },
        units=dict(zip(names[1:], units[1:], strict=True)),
        input_peak=float(np.max(np.abs(record.u[:, 0]))),
        output_peak=1.0,
        input_unit=units[0] or "1",
        output_unit=record.output_unit or "1",
        fitted=fitted * record.dt,
    )
    simulation = Extended(core, (), scene)
    nominal = simulation.simulate(simulation.nominal)
    if not np.isfinite(nominal).all():
        raise RecordError(
            f"the simulation {core.name} diverges on this input: check its parameters, its units and the "
            "sampling time"
        )
    return replace(scene, output_peak=float(np.max(np.abs(nominal))) or 1.0)


def _noise(y: Signal, residual: Signal, scene: Scene) -> tuple[Finding, ...]:
    """Name what sampling and noise have done, the crudest first: what it explains is not blamed on others."""
    found: list[Finding] = []
    for detector in DETECTORS.values():
        if any(each.name in detector.excluded_by for each in found):
            continue
        detection = detector.detect(y, residual, scene)
        if detection is not None and detection.gained > LEAST:
            values = {name: Value(value, unit, None) for name, (value, unit) in detection.parameters.items()}
            sure = 1.0 / (1.0 + float(np.exp(-detection.gained / (2 * TEMPER))))
            found.append(Finding(detector.name, detector.family, sure, (), values, detection.gained, None))
    return tuple(found)
