"""Target of a calibration: the measured output, its weighting and the prior of the parameters."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from islands.diagnosis.calibration.resolution import is_unresolved
from islands.effects.interface.context import Signal, SimulationContext
from islands.records.noise_model import NoiseModel
from islands.records.segments import delay_samples, find_bounds, map_segments


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """Measured output, and the weighting under which a simulation is compared with it.

    Attributes
    ----------
    y : ndarray, shape (samples,)
        The measured output; NaN if it is missing.
    estimation_part : ndarray of bool, shape (samples,)
        Samples used for estimation; none of them is missing.
    noise : NoiseModel or None
        Noise model that whitens residuals; None to leave them unweighted.
    prior_std : mapping
        Relative standard deviations of the simulator's parameters about their nominal values. Parameters that
        are not in it are free.
    effective_samples : float or None
        Effective sample size of the estimation part if the residual is model error; None if it is noise,
        white or coloured.
    segments : tuple of int
        Lengths in samples of the recordings, cut at the gaps of the output; empty for a single recording.
    has_feedback : bool
        Whether the input contains the noise that the output has in the same sample.
    fitted : int
        Number of samples before the hold-out part, missing ones included.
    resolution : float
        Resolution of the output; 0 for none.
    """

    y: Signal
    estimation_part: NDArray[np.bool_]
    noise: NoiseModel | None
    prior_std: Mapping[str, float]
    effective_samples: float | None = None
    segments: tuple[int, ...] = ()
    has_feedback: bool = False
    fitted: int = field(kw_only=True)
    resolution: float = 0.0

    @property
    def fitted_segments(self) -> tuple[int, ...]:
        """Number of samples of every segment that are used for estimation, without zeros."""
        counts = (
            int(np.count_nonzero(self.estimation_part[first:last]))
            for first, last in find_bounds(self.segments, self.y.size)
        )
        return tuple(count for count in counts if count)

    @property
    def prior_weight(self) -> float:
        """Weight of a squared prior deviation relative to a squared residual of unit variance.

        A residual of which neighbouring samples are alike has less information than it has samples.
        """
        if self.effective_samples is None:
            return 1.0
        return float(np.count_nonzero(self.estimation_part)) / self.effective_samples

    def select(self, signal: Signal) -> Signal:
        """Return the whitened signal over the estimation part."""
        whitened = signal if self.noise is None else self.noise.whiten(signal, self.segments)
        return whitened[self.estimation_part]

    def read_before_noise(self, context: SimulationContext) -> SimulationContext:
        """Return a context in which each sample of the input is independent of the noise of its sample.

        With feedback, the input is that of the sample before. A residual depends on the other by itself.
        """
        if not self.has_feedback:
            return context
        return replace(context, u=map_segments(partial(delay_samples, lag=1), context.u, context.segments))

    def residual(self, simulated: Signal) -> Signal:
        """Return the whitened residual over the estimation part."""
        return self.select(self.y - simulated)

    def is_matched(self, simulated: Signal) -> bool:
        """Return whether a signal is the output of the estimation part, as far as its resolution shows."""
        return is_unresolved((self.y - simulated)[self.estimation_part], self.resolution)
