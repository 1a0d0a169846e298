"""Range of the magnitudes with which a search can calculate."""

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.records.dataset import Dataset

#: Largest magnitude of a sample. Squares of products of five factors, which are the largest regressors of the
#: libraries, remain finite.
LARGEST = 1e30

#: Smallest magnitude of a signal; the same squares remain normal numbers.
SMALLEST = 1e-30


def check_magnitudes(estimation: Dataset, validation: Dataset) -> None:
    """Refuse magnitudes with which floating-point numbers overflow or underflow.

    Parameters
    ----------
    estimation : Dataset
        Data from which parameters are estimated. No signal may be smaller than `SMALLEST` in all its samples,
        except for one that is zero.
    validation : Dataset
        Further data, in which a signal may be small, such as the end of a decay.

    Raises
    ------
    RecordError
        A sample is larger than `LARGEST`, a signal is smaller than `SMALLEST`, or the sampling time lies
        outside of both.
    """
    if not SMALLEST <= estimation.dt <= LARGEST:
        raise RecordError(
            f"the sampling time is {estimation.dt:.3g} s, and it must lie between {SMALLEST:g} s and "
            f"{LARGEST:g} s: correct the time of the record"
        )
    for record in (estimation, validation):
        names = (*record.input_names, record.output_name)
        for name, signal in zip(names, (*record.u.T, record.y), strict=True):
            largest = _largest_magnitude(signal)
            if largest > LARGEST:
                raise RecordError(
                    f"{name} has a value of magnitude {largest:.3g}, and the largest possible one is "
                    f"{LARGEST:g}: use another unit, or leave out the samples in which such a value marks a "
                    "missing measurement"
                )
            if record is estimation and 0.0 < largest < SMALLEST:
                raise RecordError(
                    f"{name} has no value of a magnitude above {largest:.3g} in the data for estimation, and "
                    f"{SMALLEST:g} is the smallest possible one: use another unit"
                )


def _largest_magnitude(signal: NDArray[np.float64]) -> float:
    present = signal[~np.isnan(signal)]
    return float(np.max(np.abs(present))) if present.size else 0.0
