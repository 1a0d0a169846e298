"""Changes at an instant: where they may lie, and how they set in."""

from collections.abc import Mapping

import numpy as np
import scipy

from islands.discrepancy.interfaces.effect import Scene, Signal

#: Instants that a search begins from, and parts of the fitted record that are left free at its ends: what
#: changes there can be told from nothing by a few samples alone.
INSTANTS, MARGIN = 27, 0.06


def instants(scene: Scene) -> tuple[float, ...]:
    """Return times that a search for a change begins from, in seconds."""
    first, last = bounds(scene)
    return tuple(float(time) for time in np.linspace(first, last, INSTANTS))


def bounds(scene: Scene) -> tuple[float, float]:
    """Return the first and the last time at which a change may be looked for."""
    return MARGIN * scene.fitted, (1.0 - MARGIN) * scene.fitted


def after(scene: Scene, instant: float) -> Signal:
    """Return 0 before an instant and 1 behind it, within a few samples: a jump would have no derivative."""
    out: Signal = scipy.special.expit((scene.time - instant) / (2 * scene.dt))
    return out


def gain_over_time(own: Mapping[str, float], scene: Scene) -> Signal | float:
    """Return the factor of a gain that steps or ages, for a core that understands both; 1 if it does not."""
    gain: Signal | float = 1.0
    if "gain-step" in own:
        gain = gain * (1.0 + own["gain-step"] * after(scene, own["gain-step instant"]))
    if "ageing" in own:
        gain = gain * (1.0 + own["ageing"] * scene.time / scene.duration)
    return gain
