"""The self-test: what the analysis could have shown on this very record, and how often it cries wolf.

Surrogates are drawn: what the record would be if the simulation were right, on its own inputs. Some are left
clean, into others each effect is put at several strengths, and all are diagnosed as the record was.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import inf

import numpy as np
from scipy.special import betaincinv

from islands.discrepancy.diagnosis import Diagnosis, diagnose
from islands.discrepancy.inference.verdict import Verdict
from islands.discrepancy.interfaces.parallel import ParallelMap
from islands.discrepancy.interfaces.simulator import Simulator
from islands.discrepancy.surrogates import (
    Injection,
    SurrogateCase,
    Surrogates,
    injection_strengths,
    make_surrogates,
)
from islands.evolution.progress import ProgressCallback, ignore_progress

#: Clean surrogates.
CLEAN = 40

#: What stands in the place of a name.
NOTHING, UNKNOWN = "nothing", "unknown"

#: What the bounds of a rate leave out, half of it on either side.
_OUTSIDE = 0.05


@dataclass(frozen=True, slots=True)
class SurrogateOutcome:
    """What the analysis said of a probe.

    Attributes
    ----------
    named : str
        The first name, "nothing" or "unknown".
    recognised : bool
        What was injected is among the names, or among those that cannot be told from them.
    score : float
        Of the best candidate.
    """

    named: str
    recognised: bool
    score: float


@dataclass(frozen=True, slots=True)
class DetectionRate:
    """A part of some surrogates, with Clopper and Pearson's 95 % interval."""

    value: float
    ci95: tuple[float, float]
    trials: int


@dataclass(frozen=True, slots=True, eq=False)
class SelfTest:
    """What the analysis can do on a record.

    Attributes
    ----------
    detection_limits : mapping of str to Injection or None
        The smallest injection of each effect that is named; None where none is.
    false_alarm_rate : DetectionRate
        Of clean surrogates that got a name.
    p_value : float
        How often chance alone makes a candidate as good as the record's best one.
    confusion : mapping of (str, str) to int
        ``(hidden, called)`` to how often.
    """

    detection_limits: Mapping[str, Injection | None]
    false_alarm_rate: DetectionRate
    p_value: float
    confusion: Mapping[tuple[str, str], int]


def diagnose_surrogate(source: Surrogates, probe: SurrogateCase) -> SurrogateOutcome:
    """Draw a surrogate and diagnose it."""
    found = diagnose(source.draw_record(probe), source.simulator, source.prior_std, probe.seed)
    # That the noise remembers is true of a surrogate whose noise does.
    named = [each for each in found.effects if each.name != "coloured-noise" or source.noise.order == 0]
    # Causes of a misfit stand before what is said of the noise.
    said = {name for each in named for name in (each.name, *each.equivalents)}
    otherwise = UNKNOWN if found.verdict == Verdict.UNKNOWN else NOTHING
    return SurrogateOutcome(
        named[0].name if named else otherwise,
        probe.injection is not None and probe.injection.cause in said,
        _best(found),
    )


def self_test(
    diagnosis: Diagnosis,
    simulator: Simulator,
    tolerance: Mapping[str, float] | None = None,
    seed: int = 0,
    run: ParallelMap = map,
    effects: Sequence[str] | None = None,
    clean: int = CLEAN,
    progress: ProgressCallback = ignore_progress,
) -> SelfTest:
    """Find out what an analysis of a record could have shown, and how often it names what is not there.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of the record.
    simulator, tolerance
        As the record was diagnosed.
    seed : int
        Of all that is drawn by lot.
    run : callable
        Carries out probes; they know nothing of each other.
    effects : sequence of str, optional
        Names of those to be put in; by default all that could enter the simulation.
    clean : int
        Surrogates that nothing is put into.
    progress : ProgressCallback
        Takes the number of completed analyses and an upper bound of their total.
    """
    source = make_surrogates(diagnosis, simulator, dict(tolerance or {}))
    ladders = {
        name: injection_strengths(source, effect, _lot(seed, name))
        for name, effect in source.effects.items()
        if effects is None or name in effects
    }
    # The same noise for all strengths of an effect: they differ by nothing else.
    seeds = {name: int(_lot(seed, name, 1).integers(2**32)) for name in ladders}
    # The last step that is known not to be named, and the first that is.
    between = {name: (-1, len(steps)) for name, steps in ladders.items()}
    confusion: Counter[tuple[str, str]] = Counter()
    cleans: list[SurrogateOutcome] = []
    asked = [SurrogateCase(None, int(_lot(seed, NOTHING, turn).integers(2**32))) for turn in range(clean)]
    asked += _middles(ladders, between, seeds)
    ended = 0
    while asked:
        left = sum((high - low - 1).bit_length() for low, high in between.values())
        most = ended + left + sum(probe.injection is None for probe in asked)
        for probe, answer in zip(asked, run(partial(diagnose_surrogate, source), asked), strict=True):
            ended += 1
            progress(f"{ended} of {most} analyses", ended / most)
            hidden = probe.injection
            confusion[hidden.cause if hidden else NOTHING, answer.named] += 1
            if hidden is None:
                cleans.append(answer)
                continue
            step = ladders[hidden.effect].index(hidden)
            low, high = between[hidden.effect]
            between[hidden.effect] = (low, step) if answer.recognised else (step, high)
        asked = _middles(ladders, between, seeds)
    as_good = sum(answer.score >= _best(diagnosis) for answer in cleans)
    return SelfTest(
        {
            name: steps[high] if (high := between[name][1]) < len(steps) else None
            for name, steps in ladders.items()
        },
        estimate_rate(sum(answer.named not in (NOTHING, UNKNOWN) for answer in cleans), len(cleans)),
        (1 + as_good) / (1 + len(cleans)),
        dict(sorted(confusion.items())),
    )


def estimate_rate(count: int, of: int) -> DetectionRate:
    """Return a rate with its bounds."""
    low = float(betaincinv(count, of - count + 1, _OUTSIDE / 2)) if count else 0.0
    high = float(betaincinv(count + 1, of - count, 1 - _OUTSIDE / 2)) if count < of else 1.0
    return DetectionRate(count / of if of else 0.0, (low, high), of)


def _middles(
    ladders: Mapping[str, tuple[Injection, ...]],
    between: Mapping[str, tuple[int, int]],
    seeds: Mapping[str, int],
) -> list[SurrogateCase]:
    """Return the next probe of every effect whose limit is not known yet."""
    return [
        SurrogateCase(ladders[name][(low + high) // 2], seeds[name])
        for name, (low, high) in between.items()
        if high - low > 1
    ]


def _lot(seed: int, name: str, turn: int = 0) -> np.random.Generator:
    # By name and not in turn: an effect's share of chance does not hang on which others are tested.
    return np.random.default_rng([seed, turn, *map(ord, name)])


def _best(diagnosis: Diagnosis) -> float:
    return max((candidate.score for candidate in diagnosis.candidates), default=-inf)
