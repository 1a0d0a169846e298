"""What the steps of a diagnosis have in common: effects, random generator, parallel map and progress."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from islands.effects.interface.effect import Effect
from islands.parallel import ParallelMap
from islands.progress import ProgressCallback, ignore_progress


@dataclass(frozen=True, slots=True, eq=False)
class DiagnosisRun:
    """A run of a diagnosis, or of the plan of an experiment.

    Attributes
    ----------
    effects : sequence of Effect
        Effects that are searched for.
    rng : numpy.random.Generator
        Random generator that all steps share; by default one with the seed 0.
    parallel_map : ParallelMap
        Calibrates and simulates; results do not depend on it.
    progress : ProgressCallback
    has_inner_terms_only : bool
        Whether terms are searched for in the equations of states only, and in the whole record: those at the
        output, and those that begin or end, have been searched for.
    """

    effects: Sequence[Effect] = ()
    rng: np.random.Generator = field(default_factory=partial(np.random.default_rng, 0))
    parallel_map: ParallelMap = map
    progress: ProgressCallback = ignore_progress
    has_inner_terms_only: bool = False

    def with_effects(self, effects: Sequence[Effect]) -> "DiagnosisRun":
        """Return the run with other effects to search for."""
        return replace(self, effects=effects)

    def without_effects(self, present: Sequence[Effect]) -> "DiagnosisRun":
        """Return the run without the effects that a simulation has already."""
        return replace(self, effects=[effect for effect in self.effects if effect not in present])
