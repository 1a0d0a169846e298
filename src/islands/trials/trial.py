"""A blind trial: hide, diagnose, compare."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from islands.discrepancy.cores.bouc_wen_piezo import BoucWenPiezoCore
from islands.discrepancy.diagnosis import diagnose
from islands.discrepancy.effects import CATALOGUE
from islands.trials.hide.records import SPREAD, hide

#: Tolerances that are stated: twice the spread of the truth.
TOLERANCE = {name: 2 * spread for name, spread in SPREAD.items()}


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
    seconds : float
    """

    effects: tuple[str, ...]
    seed: int
    pole: float = 0.0
    band: tuple[float, float] | None = None
    variant: bool = False
    seconds: float = 60.0


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a trial.

    Attributes
    ----------
    trial : Trial
    misfit : float
        Of what was hidden, in standard deviations of the noise.
    verdict : str
    named : tuple of str
        Causes, the most important first; without those of the noise.
    noise : tuple of str
        What was said of sampling and noise.
    equivalents : tuple of tuple of str
        Of each name.
    candidates : tuple of str
        The first three of the ladder.
    confidence : float
        Of the first name.
    """

    trial: Trial
    misfit: float
    verdict: str
    named: tuple[str, ...]
    noise: tuple[str, ...]
    equivalents: tuple[tuple[str, ...], ...]
    candidates: tuple[str, ...]
    confidence: float

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
    def family_right(self) -> bool:
        """Whether the first name is of the family of one of those hidden."""
        return bool(self.named) and _family(self.named[0]) in {_family(name) for name in self.trial.effects}


def carried_out(trial: Trial) -> Outcome:
    """Hide, diagnose, compare."""
    hiding = hide(
        trial.effects,
        np.random.default_rng([trial.seed, *map(ord, "".join(trial.effects))]),
        trial.seconds,
        trial.pole,
        trial.band,
        trial.variant,
    )
    found = diagnose(hiding.record, BoucWenPiezoCore(), TOLERANCE, trial.seed)
    causes = [finding for finding in found.effects if finding.eta is not None]
    return Outcome(
        trial,
        hiding.misfit,
        str(found.verdict),
        tuple(finding.name for finding in causes),
        tuple(finding.name for finding in found.effects if finding.eta is None),
        tuple(finding.equivalents for finding in causes),
        tuple(candidate.name for candidate in found.candidates[:3]),
        causes[0].confidence if causes else 0.0,
    )


def _family(name: str) -> str:
    return CATALOGUE[name].family if name in CATALOGUE else "scale" if name == "wrong-parameter" else name


def one_of_each(seed: int, names: Sequence[str], band: tuple[float, float], pole: float = 0.0) -> list[Trial]:
    """Return a trial of every effect, its misfit within a band."""
    return [Trial((name,), seed, pole, band) for name in names]
