"""A sine of a frequency of its own is added."""

import numpy as np

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site


def _form(y: Signal, values: Signal, scene: Scene) -> Signal:
    angle = 2 * np.pi * values[2] * scene.time
    return y + values[0] * np.cos(angle) + values[1] * np.sin(angle)


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (
        Parameter("cosine", scene.output_unit, 0.0, 0.005 * scene.output_peak),
        Parameter("sine", scene.output_unit, 0.0, 0.005 * scene.output_peak),
        Parameter("frequency", "Hz", 0.0, 0.1 / scene.fitted, 2.0 / scene.fitted, 0.499 / scene.dt),
    )


def _grid(scene: Scene, residual: Signal) -> tuple[tuple[float, ...], ...]:
    # The strongest line of what is left, between the samples of its spectrum.
    fitted = int(scene.fitted / scene.dt)
    seen = residual[:fitted] * np.hanning(fitted)
    spectrum = np.abs(np.fft.rfft(seen, 4 * fitted))
    frequencies = np.fft.rfftfreq(4 * fitted, scene.dt)
    spectrum[frequencies < 2.0 / scene.fitted] = 0.0
    strongest = float(frequencies[np.argmax(spectrum)])
    angle = 2 * np.pi * strongest * scene.time[:fitted]
    waves = np.column_stack([np.cos(angle), np.sin(angle)])
    cosine, sine = np.linalg.lstsq(waves, residual[:fitted], rcond=None)[0]
    return ((float(cosine), float(sine), strongest),)


EFFECT = Effect(
    name="periodic-disturbance",
    family="disturbance",
    site=Site.OUTPUT,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Stoica and Moses, Spectral Analysis of Signals, section 4",
    linear=2,
    searched=2,
)
