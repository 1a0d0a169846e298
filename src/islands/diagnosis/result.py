"""Result of a diagnosis."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.diagnosis.discovery.effect_shape import EffectShape
from islands.diagnosis.discovery.missing_terms import Discovery
from islands.diagnosis.gross_errors.record_finding import RecordFinding
from islands.diagnosis.inference.exchanged_parts import ExchangedParts
from islands.diagnosis.inference.extension_trial import ExtensionTrial
from islands.diagnosis.inference.finding import Finding, Value
from islands.diagnosis.inference.holdout import HoldoutGain
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.planning.next_experiment import NextExperiment
from islands.effects.interface.context import Signal
from islands.records.dataset import Dataset


@dataclass(frozen=True, slots=True)
class Candidate:
    """A screened effect: the simulation extended by this effect alone.

    Attributes
    ----------
    name : str
    score : float
        Score gain in minus twice the log-likelihood, less the BIC penalty.
    explained_fraction : float
        Fraction of the explainable misfit that the effect explains.
    place : str
        State or parameter that it acts on; empty if it is another kind of effect.
    """

    name: str
    score: float
    explained_fraction: float
    place: str = ""


@dataclass(frozen=True, slots=True)
class NoiseClaim:
    """What would have to be noise if the best simulation were right.

    Attributes
    ----------
    rms : float
        RMS of the residual over the samples used for estimation.
    correlation_time : float
        Lag in seconds at which its autocorrelation has fallen to 1/e; 0 if it is white.
    noise_level : float or None
        Standard deviation of the noise of the output that the user has stated.
    """

    rms: float
    correlation_time: float
    noise_level: float | None


@dataclass(frozen=True, slots=True)
class CalibratedValue:
    """A parameter of the simulation.

    Attributes
    ----------
    name : str
    before : float or None
        Value before the calibration: the given one, or an estimate. None of equations that take the place of
        a linear simulation.
    alone : float or None
        Value calibrated without effects; None if the simulation without them has no such parameter.
    estimate : Value
        Value of the best simulation, with its interval.
    """

    name: str
    before: float | None
    alone: float | None
    estimate: Value


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """Result of a diagnosis.

    Attributes
    ----------
    verdict : Verdict
    effects : tuple of Finding
        The named causes, the most important first, then the properties of the noise. "nothing" and
        "noise" have properties of the noise only, and "unknown" and "stopped" have none.
    candidates : tuple of Candidate
        All screened effects, the best first.
    gain : HoldoutGain or None
        Errors over the hold-out part; None if no effect was added to the simulation.
    residual_structure : mapping of str to float
        Maps in which the residual is not random, with their distance in standard deviations.
    next_experiment : NextExperiment or None
        Experiment that separates the named causes from their equivalents; None if there are none.
    record : Dataset
        The record without the channels that were left out.
    estimation_samples : int
        Number of samples, from the first on, that are used for estimation; the rest is the hold-out part.
    base, best : CalibrationResult
        The simulation calibrated without the effects, and with them.
    noise_floor : float
        Expected lower bound on the RMSE of any simulation.
    is_noise_floor_measured : bool
        Whether the noise floor is measured from repeated periods; otherwise it is an upper bound from a
        flexible reference model.
    nominal_rmse : float
        RMSE of the simulation at its nominal values over the hold-out part.
    record_findings : tuple of RecordFinding
        Channels that were left out, and other findings about the record.
    discovery : Discovery or None
        Equations with missing terms. They are the cause if the verdict is "discovered", and equivalent to the
        named cause otherwise. None if there are none.
    shape : EffectShape or None
        Curve of a single named effect next to the free curve in its place; None if it has none.
    noise_claim : NoiseClaim or None
        Size and correlation time of the residual; None if there is a gross error.
    trial : ExtensionTrial or None
        Trial of the extended simulation beyond the record; None if no effect was added to it.
    exchange : ExchangedParts or None
        The extended simulation fitted to the hold-out recordings; None if there are none.
    values : tuple of CalibratedValue
        Parameters of the simulation, without initial states; empty after a gross error.
    is_time_left_out : bool
        Whether the output of ``best`` has no functions of time in recordings that are held out, since these
        contradict them.
    left_out : tuple of str
        Steps that a stopped diagnosis has left out; empty for a complete one.
    not_computed : mapping
        Steps that failed, each with the reason. The findings are those of the steps before them.
    """

    verdict: Verdict
    effects: tuple[Finding, ...]
    candidates: tuple[Candidate, ...]
    gain: HoldoutGain | None
    residual_structure: Mapping[str, float]
    next_experiment: NextExperiment | None
    record: Dataset = field(repr=False)
    estimation_samples: int
    base: CalibrationResult = field(repr=False)
    best: CalibrationResult = field(repr=False)
    noise_floor: float
    is_noise_floor_measured: bool
    nominal_rmse: float
    record_findings: tuple[RecordFinding, ...] = ()
    discovery: Discovery | None = None
    shape: EffectShape | None = None
    noise_claim: NoiseClaim | None = None
    trial: ExtensionTrial | None = None
    exchange: ExchangedParts | None = None
    values: tuple[CalibratedValue, ...] = ()
    is_time_left_out: bool = False
    left_out: tuple[str, ...] = ()
    not_computed: Mapping[str, str] = field(default_factory=dict)

    @property
    def causes(self) -> tuple[Finding, ...]:
        """The named causes, the most important first."""
        return tuple(each for each in self.effects if each.explained_fraction is not None)

    @property
    def claimed_names(self) -> tuple[str, ...]:
        """Names of the causes that are claimed; several missing terms have one."""
        return tuple(dict.fromkeys(each.name for each in self.causes if each.is_claimed))

    @property
    def refusal(self) -> str | None:
        """Why the extended simulation is not offered, as a sentence; None if it is, or if there is none."""
        return None if self.trial is None else self.trial.refusal

    @property
    def noise(self) -> tuple[Finding, ...]:
        """The properties of the noise. They are no discrepancy, as the verdicts "nothing" and "noise" say."""
        return tuple(each for each in self.effects if each.explained_fraction is None)

    @property
    def simulated_outputs(self) -> dict[str, Signal]:
        """Outputs by name: of the calibrated simulation, and of the extended or corrected one, if any."""
        outputs = {"simulated": self.base.output}
        if self.best is not self.base:
            after = "corrected" if self.verdict == Verdict.GROSS_ERROR else "extended"
            outputs[after] = self.best.output
        return outputs

    @property
    def held_out_part(self) -> str:
        """Name of the hold-out part in a sentence."""
        if not self.record.held_out:
            return "the last quarter of the record"
        count = len(self.record[self.estimation_samples :].rows_by_recording)
        return "the validation recording" if count == 1 else f"the {count} validation recordings"
