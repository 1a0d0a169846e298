"""Bursts of repeated values: samples that were lost, and the last one sent again."""

import numpy as np

from islands.discrepancy.inference.noise_detectors import Detection, Detector
from islands.discrepancy.interfaces.effect import Scene, Signal

#: Equal neighbours that make a burst, and bursts that are no chance.
_RUN, _BURSTS = 3, 2

#: Levels of a lattice repeat by themselves: so many samples a level are none.
_CROWDED = 3.0


def _detect(y: Signal, _residual: Signal, scene: Scene) -> Detection | None:
    if y.size >= _CROWDED * np.unique(y).size:
        return None
    same = np.concatenate([[False], np.diff(y) == 0.0, [False]])
    edges = np.flatnonzero(np.diff(same.astype(np.int8)))
    lengths = edges[1::2] - edges[::2] + 1
    bursts = lengths[lengths >= _RUN]
    if bursts.size < _BURSTS:
        return None
    share = float(np.sum(bursts - 1)) / y.size
    return Detection(
        {"share": (share, ""), "longest": (float(bursts.max()) * scene.dt, "s")},
        float(np.sum(bursts)) * float(np.log(y.size)),
    )


DETECTOR = Detector(
    "held-samples", "data", _detect, "Little and Rubin, Statistical Analysis with Missing Data"
)
