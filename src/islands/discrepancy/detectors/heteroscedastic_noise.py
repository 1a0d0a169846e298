"""Noise that grows with the output: sigma (1 + k |y|)."""

import numpy as np

from islands.discrepancy.calibration.noise_model import noise_of
from islands.discrepancy.inference.noise_detectors import Detection, Detector
from islands.discrepancy.interfaces.effect import Scene, Signal

#: Strengths that are tried, relative to the largest output.
_STRENGTHS = np.concatenate([[0.0], np.geomspace(0.1, 30.0, 60)])


def _detect(y: Signal, residual: Signal, scene: Scene) -> Detection | None:
    noise = noise_of(residual)
    left = noise.whiten(residual)
    size = np.abs(y) / np.max(np.abs(y))
    n = left.size
    # A few outliers at large outputs would look the same: nobody weighs more than four deviations.
    scale = float(np.median(np.abs(left))) / 0.6745
    if scale == 0.0:  # most of it is no noise at all
        return None
    squares = np.minimum(left**2, (4 * scale * (1.0 + size)) ** 2)
    costs = [
        n * float(np.log(np.mean(squares / (1.0 + k * size) ** 2))) + 2 * float(np.sum(np.log1p(k * size)))
        for k in _STRENGTHS
    ]
    best = int(np.argmin(costs))
    gained = costs[0] - costs[best] - float(np.log(n))
    if gained <= 0.0:
        return None
    strength = float(_STRENGTHS[best]) / float(np.max(np.abs(y)))
    return Detection({"k": (strength, f"1/{scene.output_unit}")}, gained)


DETECTOR = Detector(
    "heteroscedastic-noise",
    "data",
    _detect,
    "Davidian and Carroll, Variance function estimation, 1987",
    ("held-samples", "outliers"),
)
