"""A blind trial: hide, diagnose, compare."""

from dataclasses import dataclass

import numpy as np

from islands.discrepancy.diagnosis import diagnose
from islands.discrepancy.effects import CATALOGUE, model_form
from islands.performance.trials.cases import CORES
from islands.performance.trials.injection.measurement import inject
from islands.performance.trials.injection.piezo import PIEZO
from islands.performance.trials.oracle import share_of_gain

#: Tolerances that are stated of the piezo's parameters.
TOLERANCE = PIEZO.tolerance

#: Families of causes that belong to a simulation, and have no entry of their own in the catalogue.
_FAMILIES = {
    "wrong-parameter": "scale",
    "input-offset": "baseline",
    "outflow-law": "shape",
    "state-clip": "shape",
}


@dataclass(frozen=True, slots=True)
class Trial:
    """What is hidden, and in what.

    Attributes
    ----------
    effects : tuple of str
        Names; empty for a clean record.
    seed : int
    pole : float
        Of the noise's memory; 0 is white.
    band : tuple of float or None
        Of the misfit of each effect, in standard deviations of the noise.
    variant : bool
        In forms unlike those that the analysis extends by.
    seconds : float or None
        Length of the record; None is what its system usually has.
    core : str
        The simulation that is held against it, an entry of `CORES`.
    oracle : bool
        Who knows the names is asked as well: this takes time.
    """

    effects: tuple[str, ...]
    seed: int
    pole: float = 0.0
    band: tuple[float, float] | None = None
    variant: bool = False
    seconds: float | None = None
    core: str = "bouc-wen-piezo"
    oracle: bool = False


@dataclass(frozen=True, slots=True)
class TrialOutcome:
    """What came of a trial.

    Attributes
    ----------
    trial : Trial
    misfit : float
        Of what was hidden, in standard deviations of the noise; of gains and parameters what tolerances do
        not allow.
    verdict : str
    named : tuple of str
        Causes, the most important first; without those of the noise, and without the form of a model.
    noise : tuple of str
        What was said of sampling and noise.
    equivalents : tuple of tuple of str
        Of each name.
    candidates : tuple of str
        The first three causes of the ladder.
    confidence : float
        Of the first name.
    gain_share : float or None
        Error on the locked samples: by how much it is smaller, relative to an oracle's; None where there is
        nothing to gain, or no oracle was asked.
    form : bool
        The simulation's own form was said to be wrong: of an identified model that is true, and no cause.
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
    form: bool = False

    @property
    def noticed(self) -> bool:
        """Whether something beside the noise was found, with a name or without."""
        return bool(self.named) or self.verdict == "unknown"

    @property
    def first_right(self) -> bool:
        """Whether the first name is one of those hidden."""
        return bool(self.named) and self.named[0] in self.trial.effects

    @property
    def exact(self) -> bool:
        """Whether all that is hidden is named, and nothing else."""
        return sorted(self.named) == sorted(self.trial.effects)

    @property
    def within_set(self) -> bool:
        """Whether the first name, or one that cannot be told from it, is one of those hidden."""
        return bool(self.named) and bool({self.named[0], *self.equivalents[0]} & set(self.trial.effects))

    @property
    def set_size(self) -> int:
        """How many names are in the first name's set, itself included."""
        return 1 + len(self.equivalents[0])

    @property
    def family_right(self) -> bool:
        """Whether the first name is of the family of one of those hidden."""
        return bool(self.named) and _family(self.named[0]) in {_family(name) for name in self.trial.effects}


def run_trial(trial: Trial) -> TrialOutcome:
    """Hide, diagnose, compare."""
    simulated = CORES[trial.core]
    hiding = inject(
        trial.effects,
        np.random.default_rng([trial.seed, *map(ord, "".join(trial.effects))]),
        trial.seconds,
        trial.pole,
        trial.band,
        trial.variant,
        simulated.system,
        simulated.apart,
        simulated.free,
    )
    found = diagnose(hiding.record, simulated.made(hiding), simulated.tolerance, trial.seed)
    causes = [
        each
        for each in found.effects
        if each.explained_fraction is not None and each.name != model_form.CORE_SHAPE
    ]
    asked = trial.oracle and trial.effects
    return TrialOutcome(
        trial,
        hiding.misfit,
        str(found.verdict),
        tuple(finding.name for finding in causes),
        tuple(finding.name for finding in found.effects if finding.explained_fraction is None),
        tuple(finding.equivalents for finding in causes),
        tuple(each.name for each in found.candidates if each.name != model_form.CORE_SHAPE)[:3],
        causes[0].confidence if causes else 0.0,
        share_of_gain(found, trial.effects, simulated.tolerance) if asked else None,
        any(finding.name == model_form.CORE_SHAPE for finding in found.effects),
    )


def _family(name: str) -> str:
    return CATALOGUE[name].family if name in CATALOGUE else _FAMILIES.get(name, name)
