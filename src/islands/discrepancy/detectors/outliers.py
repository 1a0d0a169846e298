"""Single samples far from their neighbours' errors."""

import numpy as np

from islands.discrepancy.calibration.noise_model import noise_of
from islands.discrepancy.inference.noise_detectors import Detection, Detector
from islands.discrepancy.interfaces.effect import Scene, Signal

#: Scaled median deviations beyond which a sample is none of the others, and the least number of them.
_FAR, _LEAST = 5.5, 3

#: A median absolute deviation of normal noise in standard deviations.
_MAD = 0.6745


def _detect(_y: Signal, residual: Signal, scene: Scene) -> Detection | None:
    left = noise_of(residual).whiten(residual)
    scale = float(np.median(np.abs(left - np.median(left)))) / _MAD
    if scale == 0.0:
        return None
    far = np.abs(left) / scale
    count = int(np.count_nonzero(far > _FAR))
    if count < _LEAST:
        return None
    usual = left[far <= _FAR]
    n = left.size
    gained = n * float(np.log(np.mean(left**2)) - np.log(np.mean(usual**2))) - 2 * count * float(np.log(n))
    size = float(np.median(np.abs(left[far > _FAR])))
    return Detection({"share": (count / n, ""), "size": (size, scene.output_unit)}, gained)


DETECTOR = Detector(
    "outliers",
    "data",
    _detect,
    "Hampel, The influence curve and its role in robust estimation, 1974",
    ("held-samples",),
)
