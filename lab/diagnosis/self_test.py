"""Detection limits and false-alarm rate on a record, from surrogate data.

Surrogates are records that would be measured if the simulation were right, with the same inputs. Some are
clean, others have one effect injected at several strengths. Each of them is diagnosed like the record.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import inf

import numpy as np
import scipy

from islands.diagnosis.detectability import NOTHING, DetectionRate, Injection, SelfTest
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.procedure import diagnose
from islands.diagnosis.result import Diagnosis
from islands.parallel import ParallelMap
from islands.progress import ProgressCallback, ignore_progress
from islands.simulators.interface import Simulator
from lab.diagnosis.surrogates import SurrogateCase, Surrogates, injection_strengths, make_surrogates

#: Number of clean surrogates.
CLEAN_SURROGATES = 40

#: Label of a diagnosis that finds a discrepancy of unknown cause.
UNKNOWN = "unknown"

#: One minus the coverage of the confidence interval of a rate.
_SIGNIFICANCE = 0.05


@dataclass(frozen=True, slots=True)
class SurrogateOutcome:
    """Result of the diagnosis of a surrogate.

    Attributes
    ----------
    named : str
        Name of the first cause, "nothing" or "unknown".
    recognised : bool
        Whether the injected effect is among the named causes or their equivalents.
    score : float
        Score of the best candidate; minus infinity if there is none.
    """

    named: str
    recognised: bool
    score: float


def diagnose_surrogate(surrogates: Surrogates, case: SurrogateCase) -> SurrogateOutcome:
    """Draw a surrogate and diagnose it."""
    found = diagnose(surrogates.draw_record(case), surrogates.simulator, surrogates.prior_std, case.seed)
    # Coloured noise is no false alarm if the noise of the surrogates is coloured.
    named = [each for each in found.effects if each.name != "coloured-noise" or surrogates.noise.order == 0]
    # Findings of effects come before those of the noise, so that the first one is the cause of the misfit.
    names = {name for each in named for name in (each.name, *each.equivalents)}
    otherwise = UNKNOWN if found.verdict == Verdict.UNKNOWN else NOTHING
    return SurrogateOutcome(
        named[0].name if named else otherwise,
        case.injection is not None and case.injection.cause in names,
        _get_best_score(found),
    )


def self_test(
    diagnosis: Diagnosis,
    simulator: Simulator,
    tolerance: Mapping[str, float] | None = None,
    seed: int = 0,
    parallel_map: ParallelMap = map,
    effects: Sequence[str] | None = None,
    clean_surrogates: int = CLEAN_SURROGATES,
    progress: ProgressCallback = ignore_progress,
) -> SelfTest:
    """Estimate the detection limits and the false-alarm rate of the diagnosis of a record.

    Parameters
    ----------
    diagnosis : Diagnosis
        Diagnosis of the record.
    simulator, tolerance
        Simulator and tolerances of the diagnosis.
    seed : int
        Seed of the random generator.
    parallel_map : ParallelMap
        Diagnoses the surrogates, which are independent of each other.
    effects : sequence of str, optional
        Names of the effects that are injected; by default all that are applicable to the simulation.
    clean_surrogates : int
        Number of clean surrogates.
    progress : ProgressCallback
        Takes a message with the number of completed analyses and an upper bound of their total, and the ratio
        of both.
    """
    surrogates = make_surrogates(diagnosis, simulator, dict(tolerance or {}))
    strengths = {
        name: injection_strengths(surrogates, effect, _derive_rng(seed, name))
        for name, effect in surrogates.effects.items()
        if effects is None or name in effects
    }
    # All strengths of an effect have the same noise, so that nothing else differs.
    seeds = {name: int(_derive_rng(seed, name, 1).integers(2**32)) for name in strengths}
    # Bisection per effect: index of the largest strength known to be missed, and of the smallest recognised.
    brackets = {name: (-1, len(injections)) for name, injections in strengths.items()}
    confusion: Counter[tuple[str, str]] = Counter()
    clean_outcomes: list[SurrogateOutcome] = []
    cases = [
        SurrogateCase(None, int(_derive_rng(seed, NOTHING, turn).integers(2**32)))
        for turn in range(clean_surrogates)
    ]
    cases += _make_next_cases(strengths, brackets, seeds)
    ended = 0
    while cases:
        remaining = sum((high - low - 1).bit_length() for low, high in brackets.values())
        total = ended + remaining + sum(case.injection is None for case in cases)
        outcomes = parallel_map(partial(diagnose_surrogate, surrogates), cases)
        for case, outcome in zip(cases, outcomes, strict=True):
            ended += 1
            progress(f"{ended} of {total} analyses", ended / total)
            injection = case.injection
            confusion[injection.cause if injection else NOTHING, outcome.named] += 1
            if injection is None:
                clean_outcomes.append(outcome)
                continue
            index = strengths[injection.effect].index(injection)
            low, high = brackets[injection.effect]
            brackets[injection.effect] = (low, index) if outcome.recognised else (index, high)
        cases = _make_next_cases(strengths, brackets, seeds)
    best_score = _get_best_score(diagnosis)
    as_good = sum(outcome.score >= best_score for outcome in clean_outcomes)
    false_alarms = sum(outcome.named not in (NOTHING, UNKNOWN) for outcome in clean_outcomes)
    return SelfTest(
        {
            name: injections[high] if (high := brackets[name][1]) < len(injections) else None
            for name, injections in strengths.items()
        },
        estimate_rate(false_alarms, len(clean_outcomes)),
        (1 + as_good) / (1 + len(clean_outcomes)),
        dict(sorted(confusion.items())),
    )


def estimate_rate(count: int, of: int) -> DetectionRate:
    """Estimate a proportion and its confidence interval."""
    low = float(scipy.special.betaincinv(count, of - count + 1, _SIGNIFICANCE / 2)) if count else 0.0
    high = (
        float(scipy.special.betaincinv(count + 1, of - count, 1 - _SIGNIFICANCE / 2)) if count < of else 1.0
    )
    return DetectionRate(count / of if of else 0.0, (low, high), of)


def _derive_rng(seed: int, name: str, turn: int = 0) -> np.random.Generator:
    """Return a random generator for a name; its draws do not depend on which other effects are tested."""
    return np.random.default_rng([seed, turn, *map(ord, name)])


def _make_next_cases(
    strengths: Mapping[str, tuple[Injection, ...]],
    brackets: Mapping[str, tuple[int, int]],
    seeds: Mapping[str, int],
) -> list[SurrogateCase]:
    """Return the next case of every effect whose detection limit is not known yet."""
    return [
        SurrogateCase(strengths[name][(low + high) // 2], seeds[name])
        for name, (low, high) in brackets.items()
        if high - low > 1
    ]


def _get_best_score(diagnosis: Diagnosis) -> float:
    return max((candidate.score for candidate in diagnosis.candidates), default=-inf)
