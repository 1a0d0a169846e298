"""The catalogue's effects on sampling and noise: a line here puts one into the analysis and the guide."""

from collections.abc import Mapping

from islands.discrepancy.detectors import (
    coloured_noise,
    held_samples,
    heteroscedastic_noise,
    outliers,
    quantisation,
)
from islands.discrepancy.inference.noise_detectors import Detector

DETECTORS: Mapping[str, Detector] = {
    module.DETECTOR.name: module.DETECTOR
    for module in (quantisation, held_samples, outliers, heteroscedastic_noise, coloured_noise)
}
