"""One trial with an unusual cause: diagnose a record, and simulate another one with what was found."""

import traceback
from dataclasses import dataclass, replace

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.diagnosis.procedure import diagnose
from islands.diagnosis.result import Diagnosis
from islands.effects import catalogue
from islands.errors import IslandsError
from islands.facade.results.saved_simulation import SavedSimulation
from islands.records.dataset import Dataset
from islands.report.documents.extension import extended_document
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import LocalExtendedSpec
from lab.diagnosis.injection.excitation import Signal
from lab.diagnosis.injection.unusual.cause import UnusualCause
from lab.diagnosis.injection.unusual.integration import MACHINE_DT, PROCESS_DT
from lab.diagnosis.injection.unusual.misfit import compute_misfit
from lab.diagnosis.injection.unusual.table import UNUSUAL_CAUSES

#: Range of the misfit in standard deviations of the noise.
MISFIT = (5.0, 20.0)

#: Largest standard deviation of the noise relative to that of the output. A larger misfit has less noise.
MOST_NOISE = 0.04

#: Errors below this part of the noise, or of the range of the output, are none.
_NO_ERROR, _RESOLUTION = 0.05, 1e-6


@dataclass(frozen=True, slots=True)
class UnusualTrial:
    """Settings of a trial: the name of a cause in `UNUSUAL_CAUSES`, and a seed."""

    cause: str
    seed: int


@dataclass(frozen=True, slots=True)
class Claim:
    """A claimed cause.

    Attributes
    ----------
    name : str
    term : str
        Missing term with its equation; empty for an effect.
    confidence : float
    equivalents : tuple of str
    values : tuple of str
        Its parameters.
    loss : float or None
        Error of the extended simulation without this claim relative to that with it, on a fresh record
        without noise; the other parameters keep their values. Below one, the claim makes the record worse.
        None if there is no extension, or if it has no effect of this name.
    """

    name: str
    term: str
    confidence: float
    equivalents: tuple[str, ...] = ()
    values: tuple[str, ...] = ()
    loss: float | None = None


@dataclass(frozen=True, slots=True)
class FreshErrors:
    """Errors on a fresh record: the same plant with another input, other noise and other disturbances.

    Errors are against the output without noise, in standard deviations of the noise, or of the output if
    there is no noise. Initial states are fitted to the record.

    Attributes
    ----------
    base, extended : float
        RMS errors of the simulation and of the extended one on a record without noise. Infinite if it
        diverges.
    noisy_base, noisy_extended : float
        The same with initial states that are fitted to a record with noise.
    """

    base: float
    extended: float
    noisy_base: float
    noisy_extended: float

    @property
    def ratio(self) -> float:
        """Error of the extended simulation relative to that of the simulation, without noise."""
        return self.extended / self.base

    @property
    def is_worse(self) -> bool:
        """Whether the extension diverges or increases an error, without or with noise."""
        return self.extended > self.base or self.noisy_extended > self.noisy_base


@dataclass(frozen=True, slots=True)
class UnusualOutcome:
    """Result of a trial.

    Attributes
    ----------
    trial : UnusualTrial
    misfit : float
        Misfit of the best simulation in standard deviations of the noise; zero for a clean record.
    verdict : str
        Verdict, or ``error``.
    claims : tuple of Claim
    fresh : FreshErrors or None
        None if the diagnosis has no extension.
    findings : tuple of str
        Names of the properties of the noise, and descriptions of the findings about the record.
    is_refused : bool
        Whether the extended simulation is not offered. Its errors say whether the claims hold.
    error : str
        Traceback of an error that ended the diagnosis, or of a refusal; empty without one.
    """

    trial: UnusualTrial
    misfit: float
    verdict: str
    claims: tuple[Claim, ...] = ()
    fresh: FreshErrors | None = None
    findings: tuple[str, ...] = ()
    is_refused: bool = False
    error: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class UnusualRecord:
    """A record with noise, its output without noise, and the standard deviation of its noise."""

    record: Dataset
    clean: Signal
    sigma: float

    @property
    def without_noise(self) -> Dataset:
        """The record without noise."""
        return replace(self.record, y=self.clean)


def run_unusual_trial(trial: UnusualTrial) -> UnusualOutcome:
    """Diagnose a record with a cause, and simulate a fresh record with what was found.

    An error of any kind is a result: it is the outcome ``error``.
    """
    cause = UNUSUAL_CAUSES[trial.cause]
    measured, misfit = draw_record(cause, trial.seed)
    try:
        found = diagnose(measured.record, make_simulator(cause.simulation, measured.record), None, trial.seed)
        claims, fresh = list_claims(found), None
        if found.gain is not None:
            other, _ = draw_record(cause, trial.seed, number=1)
            fresh = _measure_fresh(found, other)
            claims = tuple(replace(each, loss=_measure_loss(each, found, other, fresh)) for each in claims)
        notes = tuple(each.name for each in found.noise)
        notes += tuple(each.description for each in found.record_findings)
        is_refused = found.refusal is not None
        return UnusualOutcome(trial, misfit, str(found.verdict), claims, fresh, notes, is_refused)
    except Exception:  # Any error is counted, with its traceback.
        return UnusualOutcome(trial, misfit, "error", error=traceback.format_exc(limit=-3))


def draw_record(cause: UnusualCause, seed: int, number: int = 0) -> tuple[UnusualRecord, float]:
    """Return a record of a plant and its misfit in standard deviations of the noise.

    Parameters
    ----------
    cause : UnusualCause
    seed : int
        Seed of the plant.
    number : int
        Number of the record; the first one determines the size of the noise.
    """
    places = [seed, *map(ord, cause.name)]
    first = cause.draw(np.random.default_rng(places), np.random.default_rng([*places, 0]))
    sigma, misfit = float(np.std(first.y)), 0.0
    if first.noise is None:
        error = compute_misfit(cause.simulation, first.u[:, 0], first.y)
        size = np.exp(np.random.default_rng([*places, 99]).uniform(*np.log(MISFIT)))
        sigma = min(error / float(size), MOST_NOISE * sigma)
        misfit = error / sigma
    elif np.any(first.noise):
        sigma = float(np.std(first.noise))
    rng = np.random.default_rng([*places, number])
    response = cause.draw(np.random.default_rng(places), rng) if number else first
    noise = sigma * np.random.default_rng([*places, number, 1]).standard_normal(response.y.size)
    noise = noise if response.noise is None else response.noise
    is_machine = cause.simulation == "second-order"
    names = (("F_N", "F2_N"), ("N", "N")) if is_machine else (("u_V", "T_K"), ("V", "K"))
    inputs = response.u.shape[1]
    record = Dataset(
        u=response.u,
        y=response.y + noise,
        dt=MACHINE_DT if is_machine else PROCESS_DT,
        input_names=names[0][:inputs],
        input_units=names[1][:inputs],
        output_name="x_m" if is_machine else "y_V",
        output_unit="m" if is_machine else "V",
    )
    return UnusualRecord(record, response.y, sigma), misfit


def list_claims(found: Diagnosis) -> tuple[Claim, ...]:
    """Return the claimed causes of a diagnosis without an error of the model's form."""
    return tuple(
        Claim(
            each.name,
            each.term,
            each.confidence,
            each.equivalents,
            tuple(f"{name} = {value.value:.5g}" for name, value in each.parameters.items()),
        )
        for each in found.causes
        if each.is_claimed and each.name != catalogue.CORE_SHAPE
    )


def _measure_fresh(found: Diagnosis, fresh: UnusualRecord) -> FreshErrors:
    """Return the errors of the simulation and of the extended one on a fresh record."""
    return FreshErrors(
        *(
            _measure(fit, found.record, record, fresh)
            for record in (fresh.without_noise, fresh.record)
            for fit in (found.base, found.best)
        )
    )


def _measure_loss(claim: Claim, found: Diagnosis, fresh: UnusualRecord, errors: FreshErrors) -> float | None:
    """Return the error without a claim relative to that with it."""
    simulation, values = found.best.simulation, found.best.values.copy()
    if claim.term:
        names = [parameter.name for parameter in simulation.parameters]
        values[names.index(claim.term.partition("*")[0])] = 0.0
    else:
        effects = [effect for effect in simulation.effects if effect.cause == claim.name]
        if not effects:
            return None
        part = simulation.get_slice(effects[0])
        values[part] = simulation.nominal[part]
    without = replace(found.best, values=values)
    return _measure(without, found.record, fresh.without_noise, fresh) / errors.extended


def _measure(fit: CalibrationResult, diagnosed: Dataset, record: Dataset, fresh: UnusualRecord) -> float:
    """Return the RMS error of a calibrated simulation on another record; infinite if it diverges.

    It is not below what the record resolves.
    """
    channels = [record.input_names.index(name) for name in diagnosed.input_names]
    record = replace(
        record,
        u=record.u[:, channels],
        input_names=diagnosed.input_names,
        input_units=diagnosed.input_units,
    )
    simulation = SavedSimulation(LocalExtendedSpec.model_validate(extended_document(fit, diagnosed)))
    try:
        y = simulation.simulate(record).y
    except IslandsError:  # It diverges with every initial state.
        return float("inf")
    error = float(np.sqrt(np.mean((y - fresh.clean) ** 2))) / fresh.sigma
    has_noise = not np.array_equal(fresh.record.y, fresh.clean)
    floor = max(_NO_ERROR * has_noise, _RESOLUTION * float(np.ptp(fresh.clean)) / fresh.sigma)
    return max(error, floor) if np.isfinite(error) else float("inf")
