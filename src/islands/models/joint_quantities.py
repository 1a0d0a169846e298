"""Modes and gains of linear systems of several outputs, with standard errors from an ensemble."""

from collections.abc import Sequence
from dataclasses import asdict
from math import inf, isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.models.coupled_latent import CoupledLatentModel
from islands.models.state_space import Quantity, StateSpace, list_modes, measure_mode
from islands.rounding import ROUNDING


def list_joint_quantities(
    model: CoupledLatentModel, members: Sequence[Sequence[float]]
) -> list[dict[str, Any]]:
    """Return the modes and the static gains of a model as JSON values.

    Modes that no input reaches, or no output shows, are left out: an amplitude does not respond to small
    deviations from rest.

    Parameters
    ----------
    model : CoupledLatentModel
        All outputs share the states, or their poles.
    members : sequence of sequence of float
        Parameters from the distribution of the estimate; without any, standard errors are unknown.

    Returns
    -------
    list of dict
        Fields of `Quantity`, with the number of the output of a gain and with the standard error; null if it
        is unknown. The modes come first, slowest first.
    """
    if not model.shares_states:
        return _list_separate(model)
    systems = [system for system in (_linearise(model.with_parameters(each)) for each in members) if system]
    centre = model.linearise()
    if not centre.dt:
        return []
    poles = _list_visible(centre)
    modes = [each for pole in poles for each in measure_mode(pole, centre.step)]
    drawn = [_match_modes(system, poles, [each.name for each in modes]) for system in systems]
    deviations = _measure_spread([each.value for each in modes], [each for each in drawn if each is not None])
    found = [_write(each, None, error) for each, error in zip(modes, deviations, strict=True)]
    gains = centre.static_gain
    spread = _measure_spread(gains, [system.static_gain for system in systems])
    for output, row in enumerate(gains.tolist(), start=1):
        for place, gain in enumerate(row, start=1):
            quantity = Quantity("static gain", gain, input=place)
            found.append(_write(quantity, output, float(spread[output - 1, place - 1])))
    return found


def _list_separate(model: CoupledLatentModel) -> list[dict[str, Any]]:
    """Return the modes of the first output, which are those of all, and the other quantities of each."""
    found = [
        {**each, "output": output}
        for output, single in enumerate(model.models, start=1)
        for each in single.list_quantities()
    ]
    modes = [{**each, "output": None} for each in found if each["input"] is None and each["output"] == 1]
    return [*modes, *(each for each in found if each["input"] is not None)]


def _linearise(model: CoupledLatentModel) -> StateSpace | None:
    system = model.linearise()
    return system if system.is_stable else None


def _list_visible(system: StateSpace) -> list[complex]:
    """Return the modes of which some input has an effect on some output, slowest first."""
    poles, vectors = np.linalg.eig(system.A)
    reached = np.linalg.lstsq(vectors, system.B.astype(np.complex128), rcond=None)[0]
    sizes = np.linalg.norm(system.C @ vectors, axis=0) * np.linalg.norm(reached, axis=1)
    kept = poles[sizes > ROUNDING * sizes.max(initial=0.0)]
    return sorted(list_modes(kept), key=lambda pole: abs(np.log(pole)) if pole else inf)


def _match_modes(
    system: StateSpace, poles: Sequence[complex], names: Sequence[str]
) -> NDArray[np.float64] | None:
    """Return the values of the nearest modes; None if a resonance became two time constants."""
    left, ordered = list_modes(system.poles), []
    for pole in poles:
        nearest = min(left, key=lambda each: abs(each - pole))
        left.remove(nearest)
        ordered.append(nearest)
    found = [each for pole in ordered for each in measure_mode(pole, system.step)]
    return np.array([each.value for each in found]) if [each.name for each in found] == names else None


def _measure_spread(
    centre: NDArray[np.float64] | Sequence[float], members: Sequence[NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Return the root mean square of the deviations of the members; NaN without any."""
    if not members:
        return np.full(np.shape(centre), np.nan)
    found: NDArray[np.float64] = np.sqrt(np.mean((np.array(members) - np.array(centre)) ** 2, axis=0))
    return found


def _write(quantity: Quantity, output: int | None, error: float) -> dict[str, Any]:
    value = quantity.value if isfinite(quantity.value) else None
    known = error if isfinite(error) else None
    return {**asdict(quantity), "value": value, "output": output, "standard_error": known}
