"""The output lies on a lattice: the converter's or the file's resolution."""

import numpy as np

from islands.discrepancy.inference.noise_detectors import Detection, Detector
from islands.discrepancy.interfaces.effect import Scene, Signal

#: A lattice is coarse enough to matter where its step is this part of what is left, and known as one where
#: there are this many samples for each of its levels.
_COARSE, _CROWDED = 0.5, 3.0


def _detect(y: Signal, residual: Signal, scene: Scene) -> Detection | None:
    levels = np.unique(y)
    if levels.size < 3 or y.size < _CROWDED * levels.size:
        return None
    step = float(np.min(np.diff(levels)))
    places = (y - levels[0]) / step
    off = float(np.max(np.abs(places - np.round(places))))
    if off > 1e-3 or step < _COARSE * float(np.std(residual)):
        return None
    return Detection({"step": (step, scene.output_unit)}, float(y.size))


DETECTOR = Detector("quantisation", "data", _detect, "Widrow and Kollar, Quantization Noise, section 1")
