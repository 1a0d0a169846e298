"""Trials of the kinds of records: dead times, and kinds whose models may be the best.

Small models of the library of every kind are compared in free run on held-out parts of the estimation data.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import inf, isfinite
from types import MappingProxyType

import numpy as np

from islands.facade.trials.held_out_error import hold_out, measure_library
from islands.facade.trials.library import TrialLibrary
from islands.models.latent import LatentModel
from islands.models.protocol import DynamicModel
from islands.progress import Steps
from islands.records.channel_names import parse_channel_name
from islands.records.dataset import Dataset
from islands.records.inspection.dead_time import estimate_dead_times
from islands.rounding import RESOLUTION

#: Kinds up to this factor of the least error are compared with larger models.
PROMISING = 3.0

#: Name of the step that estimates dead times.
DEAD_TIMES = "preset auto: dead times"

#: Smallest dead time in samples that is tried. Lags of the library cover shorter ones.
_LEAST_DELAY = 2


@dataclass(frozen=True, slots=True)
class KindTrials:
    """Result of the trials of the kinds on the estimation data.

    Attributes
    ----------
    delays : tuple of int
        Dead time of each input in samples of the record; empty if there is none.
    errors : mapping
        Free-run error of the small models of each kind, as a fraction of the output range; infinite if no
        model could be simulated.
    """

    delays: tuple[int, ...]
    errors: Mapping[str, float]

    @property
    def promising(self) -> tuple[str, ...]:
        """Kinds whose error is at most three times the least, in the order of preference."""
        least = min(self.errors.values())
        return tuple(kind for kind, error in self.errors.items() if error <= PROMISING * least)


def try_kinds(
    record: Dataset,
    libraries: Mapping[str, TrialLibrary],
    delays: Sequence[Sequence[int]] | None,
    steps: Steps,
) -> KindTrials:
    """Compare small models of every kind, with the dead times of the least error.

    Parameters
    ----------
    record : Dataset
        Estimation data without missing values, whose output is not constant.
    libraries : mapping
        Library and constraints of each kind that may be chosen, the simplest first.
    delays : sequence of sequence of int or None
        Dead times that are tried; by default none, and those of the response to each input.
    steps : Steps
    """
    splits = hold_out(record)

    def summarise(parts: Sequence[float]) -> float:
        error = (sum(part**2 for part in parts) / len(parts)) ** 0.5 / record.output_range
        return float(max(error, RESOLUTION)) if isfinite(error) else inf

    def measure(kind: str, delays: Sequence[int]) -> float:
        steps(f"preset auto: trial of {kind}", None)
        return summarise(measure_library(splits, libraries[kind].with_delays(delays), steps))

    if delays is None:
        steps(DEAD_TIMES, None)
        delays = (), steps.attempt(DEAD_TIMES, partial(_estimate_delays, record)) or ()
    tried = []
    for late in dict.fromkeys(tuple(each) if any(each) else () for each in delays):
        errors = {kind: measure(kind, late) for kind in libraries}
        tried.append(KindTrials(late, MappingProxyType(errors)))
    return min(tried, key=lambda each: min(each.errors.values()))


def find_delays(linear: DynamicModel) -> tuple[int, ...]:
    """Return by how many samples the response of a linear model to each input is late.

    Lags of the library cover a short dead time, which counts as 0.
    """
    assert isinstance(linear, LatentModel)
    # The output reads an input through D without the sample that a state takes.
    late = np.array(linear.delays) - (linear.layout.split(linear.theta)["D"].ravel() != 0.0)
    return tuple(int(delay) if delay >= _LEAST_DELAY else 0 for delay in late)


def _estimate_delays(record: Dataset) -> tuple[int, ...]:
    """Return by how many samples the response to each input is late; 0 where it is not known to be.

    These are the first samples in which a response is improbable. A later one has lags of the library.
    """
    late = []
    for name, fact in zip(record.input_names, estimate_dead_times(record, range(record.inputs)), strict=True):
        is_late = fact.interval is not None and not parse_channel_name(name).at_once
        delay = int(fact.interval[0]) - 1 if is_late and fact.interval else 0
        late.append(delay if delay >= _LEAST_DELAY else 0)
    return tuple(late)


def percent(error: float) -> str:
    """Return an error as a percentage, for a sentence. Rounding errors are not distinguished."""
    if error <= RESOLUTION:
        return f"less than {100.0 * RESOLUTION:g} %"
    return f"{100.0 * error:.3g} %" if isfinite(error) else "no finite error"
