"""One blind trial: inject faults, diagnose the record, compare the names."""

from contextlib import suppress
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from islands.diagnosis.discovery.missing_terms import MISSING_TERM
from islands.diagnosis.inference.stepwise_search import MIN_GAIN
from islands.diagnosis.procedure import diagnose
from islands.effects import catalogue
from islands.effects.catalogue import CATALOGUE
from islands.effects.free_forms import FREE_FORMS
from islands.errors import RecordError
from islands.simulators.interface import Simulator
from lab.diagnosis.cases import CASES, SimulatedCase
from lab.diagnosis.injection.measurement import FaultyRecord, inject
from lab.diagnosis.injection.piezo import PIEZO
from lab.diagnosis.oracle import OracleScore, score_oracle

#: Stated tolerances of the piezo's parameters.
TOLERANCE = PIEZO.tolerance

#: Number of records that are drawn until a model can be identified on one.
MAX_DRAWS = 5

#: Families of causes that belong to a simulator and are not in the catalogue.
_FAMILIES = {
    "wrong-parameter": "scale",
    "input-offset": "baseline",
    "outflow-law": "shape",
    "state-clip": "shape",
}


@dataclass(frozen=True, slots=True)
class Trial:
    """Settings of a trial.

    Attributes
    ----------
    effects : tuple of str
        Names of the injected faults; empty for a clean record.
    seed : int
    noise : str
        Kind of the measurement noise.
    band : tuple of float or None
        Bounds of the misfit of each fault, in standard deviations of the noise.
    variant : bool
        Whether to inject forms that differ from the effects of the analysis.
    seconds : float or None
        Length of the record; None is the system's default.
    core : str
        Simulation under trial, an entry of `CASES`.
    oracle : bool
        Whether to fit the oracle too, which takes time.
    """

    effects: tuple[str, ...]
    seed: int
    noise: str = "white"
    band: tuple[float, float] | None = None
    variant: bool = False
    seconds: float | None = None
    core: str = "bouc-wen-piezo"
    oracle: bool = False


@dataclass(frozen=True, slots=True)
class TrialOutcome:
    """Result of a trial.

    Attributes
    ----------
    trial : Trial
    misfit : float
        Misfit caused by the injected faults, in standard deviations of the noise. For gains and parameters,
        only the part outside the tolerances.
    verdict : str
    named : tuple of str
        Named causes, the most important first, without noise findings and without model-form error.
    noise : tuple of str
        Findings on sampling and noise.
    equivalents : tuple of tuple of str
        Equivalent causes of each name.
    candidates : tuple of str
        The first three screened causes.
    confidence : float
        Confidence of the first name.
    gain_share : float or None
        Improvement of the error on the held-out samples relative to that of the oracle; None if no
        improvement is possible or the oracle was not fitted.
    least_gain : float or None
        Least gain of one of several faults next to the others, for the oracle; None if it is not known.
    form : bool
        Whether a model-form error was reported. For an identified model this is correct, and it is not a
        cause.
    """

    trial: Trial
    misfit: float
    verdict: str
    named: tuple[str, ...]
    noise: tuple[str, ...]
    equivalents: tuple[tuple[str, ...], ...]
    candidates: tuple[str, ...]
    confidence: float
    gain_share: float | None = None
    least_gain: float | None = None
    form: bool = False

    @property
    def noticed(self) -> bool:
        """Whether a discrepancy other than noise was found, named or not."""
        return bool(self.named) or self.verdict == "unknown"

    @property
    def first_right(self) -> bool:
        """Whether the first name is an injected fault."""
        return bool(self.named) and self.named[0] in self.trial.effects

    @property
    def one_right(self) -> bool:
        """Whether one of the names is an injected fault."""
        return bool({*self.named} & {*self.trial.effects})

    @property
    def wrong(self) -> set[str]:
        """Names that are not injected faults. Discovered terms and free forms are no names."""
        return {*self.named} - {*self.trial.effects, MISSING_TERM, *(form.cause for form in FREE_FORMS)}

    @property
    def exact(self) -> bool:
        """Whether the names are exactly the injected faults."""
        return sorted(self.named) == sorted(self.trial.effects)

    @property
    def within_sets(self) -> bool:
        """Whether there are as many names as faults, and each fault is a name or equivalent to one."""
        sets = [{name, *equal} for name, equal in zip(self.named, self.equivalents, strict=True)]
        orders = permutations(self.trial.effects)
        return len(sets) == len(self.trial.effects) and any(
            all(fault in found for fault, found in zip(order, sets, strict=True)) for order in orders
        )

    @property
    def identifiable(self) -> bool:
        """Whether each of several faults gains enough next to the others, as far as known."""
        return self.least_gain is None or self.least_gain > MIN_GAIN

    @property
    def within_set(self) -> bool:
        """Whether the first name or an equivalent cause is an injected fault."""
        return bool(self.named) and bool({self.named[0], *self.equivalents[0]} & set(self.trial.effects))

    @property
    def set_size(self) -> int:
        """Number of causes in the set of the first name, including itself."""
        return 1 + len(self.equivalents[0])

    @property
    def family_right(self) -> bool:
        """Whether the first name has the family of an injected fault."""
        return bool(self.named) and _get_family(self.named[0]) in {
            _get_family(name) for name in self.trial.effects
        }


def run_trial(trial: Trial) -> TrialOutcome:
    """Inject faults, diagnose the record and compare the names."""
    simulated = CASES[trial.core]
    faulty, simulator = _draw_record(trial, simulated)
    found = diagnose(faulty.record, simulator, simulated.tolerance, trial.seed)
    causes = [each for each in found.causes if each.name != catalogue.CORE_SHAPE]
    use_oracle = trial.oracle and trial.effects
    oracle = score_oracle(found, trial.effects, simulated.tolerance) if use_oracle else OracleScore()
    return TrialOutcome(
        trial,
        faulty.misfit,
        str(found.verdict),
        tuple(finding.name for finding in causes),
        tuple(finding.name for finding in found.noise),
        tuple(finding.equivalents for finding in causes),
        tuple(each.name for each in found.candidates if each.name != catalogue.CORE_SHAPE)[:3],
        causes[0].confidence if causes else 0.0,
        oracle.gain_share,
        oracle.least_gain,
        any(finding.name == catalogue.CORE_SHAPE for finding in found.effects),
    )


def _get_family(name: str) -> str:
    return CATALOGUE[name].family if name in CATALOGUE else _FAMILIES.get(name, name)


def _draw_record(trial: Trial, simulated: SimulatedCase) -> tuple[FaultyRecord, Simulator]:
    """Return a record with the faults, and the simulator to diagnose.

    A record on which no model can be identified has no simulation, so that another one is drawn.
    """
    for draw in range(MAX_DRAWS):
        seed = [trial.seed, *map(ord, "".join(trial.effects)), *([draw] if draw else [])]
        faulty = inject(
            trial.effects,
            np.random.default_rng(seed),
            trial.seconds,
            trial.noise,
            trial.band,
            trial.variant,
            simulated.system,
            simulated.perturbed,
            simulated.free,
        )
        with suppress(RecordError):
            return faulty, simulated.make(faulty)
    raise RecordError(f"no model can be identified on {MAX_DRAWS} records of {trial}")
