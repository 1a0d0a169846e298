"""Noise that remembers, where the best simulation leaves nothing else."""

import numpy as np

from islands.discrepancy.calibration.noise_model import noise_of
from islands.discrepancy.inference.noise_detectors import Detection, Detector
from islands.discrepancy.interfaces.effect import Scene, Signal


def _detect(_y: Signal, residual: Signal, _scene: Scene) -> Detection | None:
    noise = noise_of(residual)
    if noise.order == 0:
        return None
    white = residual.size * float(np.log(np.mean(residual**2)))
    gained = white - noise.minus_twice_log_likelihood
    pole = float(np.max(np.abs(np.roots(np.concatenate([[1.0], -noise.coefficients])))))
    return Detection({"pole": (pole, ""), "order": (float(noise.order), "")}, gained)


DETECTOR = Detector(
    "coloured-noise", "data", _detect, "Ljung, System Identification, 2nd ed., section 4", ("held-samples",)
)
