"""Regularity of time stamps: rate, jitter, gaps, repeated stamps and stamps that go back."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

#: Numbers of rows of each kind, and of missing samples, of a uniform record.
NO_BREAKS = {"gaps": 0, "missing": 0, "repeated": 0, "backward": 0}

#: Step, relative to the usual one, from which on samples are missing.
_GAP = 1.5


@dataclass(frozen=True, slots=True)
class TimeStamps:
    """Regularity of time stamps.

    Attributes
    ----------
    dt : float
        Median of the positive steps, in seconds.
    jitter : float
        Root mean square deviation of the steps from ``dt`` without those at gaps, relative to ``dt``.
    gaps, repeated, backward : tuple of int
        Samples before which samples are missing, that repeat a stamp, and whose stamp is earlier than the
        one before.
    missing : int
        Number of samples that are missing in the gaps, if all samples were ``dt`` apart.
    """

    dt: float
    jitter: float
    gaps: tuple[int, ...]
    repeated: tuple[int, ...]
    backward: tuple[int, ...]
    missing: int

    @property
    def breaks(self) -> tuple[int, ...]:
        """Samples that do not follow the one before by about one step."""
        return tuple(sorted({*self.gaps, *self.repeated, *self.backward}))

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of rows of each kind, and of missing samples."""
        return {
            "gaps": len(self.gaps),
            "missing": self.missing,
            "repeated": len(self.repeated),
            "backward": len(self.backward),
        }


def describe_stamps(stamps: NDArray[np.float64]) -> TimeStamps | None:
    """Return the regularity of time stamps in seconds; None if no stamp is later than the one before.

    Parameters
    ----------
    stamps : ndarray, shape (samples,)
        Finite time stamps.
    """
    steps = np.diff(stamps)
    forward = steps[steps > 0.0]
    if not forward.size:
        return None
    dt = float(np.median(forward))
    is_gap = steps > _GAP * dt
    usual = steps[(steps > 0.0) & ~is_gap]
    deviation = float(np.sqrt(np.mean((usual / dt - 1.0) ** 2))) if usual.size else 0.0
    return TimeStamps(
        dt,
        deviation,
        _find(is_gap),
        _find(steps == 0.0),
        _find(steps < 0.0),
        int(np.sum(np.round(steps[is_gap] / dt) - 1.0)),
    )


def _find(condition: NDArray[np.bool_]) -> tuple[int, ...]:
    """Return the samples after the steps of a condition."""
    return tuple(int(step) + 1 for step in np.flatnonzero(condition))
