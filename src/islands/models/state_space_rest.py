"""Rest of a state space with static units at constant inputs, and its linear system there."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.models.state_space import StateSpace

#: Newton steps that find the states at rest, and the step that ends them.
_REST_STEPS, _STILL = 50, 1e-12


class Linearised(NamedTuple):
    """A state space at given states and inputs.

    Attributes
    ----------
    after : ndarray, shape (states,)
        Next states.
    arguments, values, slopes : ndarray, shape (units,)
        Arguments of the units, their values and their slopes.
    system : StateSpace
        System of small deviations.
    """

    after: NDArray[np.float64]
    arguments: NDArray[np.float64]
    values: NDArray[np.float64]
    slopes: NDArray[np.float64]
    system: StateSpace


def linearise(
    of: Mapping[str, NDArray[np.float64]],
    codes: NDArray[np.int64],
    x: NDArray[np.float64],
    u: NDArray[np.float64],
) -> Linearised:
    """Linearise a state space.

    Parameters
    ----------
    of : mapping
        Blocks of the parameters, as ``LatentModel.matrices``.
    codes : ndarray of int64, shape (units,)
    x : ndarray, shape (states,)
    u : ndarray, shape (inputs,)
    """
    # A command that does not simulate loads no kernels.
    from islands.kernels.state_space import evaluate_unit  # noqa: PLC0415

    arguments = of["W"] @ x + of["V"] @ u + of["s"]
    pairs = [evaluate_unit(code, s) for code, s in zip(codes, arguments, strict=True)]
    values, slopes = np.array(pairs).reshape(-1, 2).T
    on_states, on_output = of["E"] * slopes, of["F"] * slopes
    system = StateSpace(
        A=of["A"] + on_states @ of["W"],
        B=of["B"] + on_states @ of["V"],
        C=(of["C"] + on_output @ of["W"])[None],
        D=(of["D"] + on_output @ of["V"])[None],
    )
    after = of["A"] @ x + of["B"] @ u + of["E"] @ values + of["o"]
    return Linearised(after, arguments, values, slopes, system)


def find_rest(
    of: Mapping[str, NDArray[np.float64]],
    codes: NDArray[np.int64],
    u: NDArray[np.float64],
    start: NDArray[np.float64],
) -> NDArray[np.float64] | None:
    """Find states at rest at constant inputs by Newton steps; None if there are none near the start.

    Parameters
    ----------
    of, codes
        As of `linearise`.
    u : ndarray, shape (inputs,)
    start : ndarray, shape (states,)
    """
    x = start
    for _ in range(_REST_STEPS):
        at = linearise(of, codes, x, u)
        try:
            step = np.linalg.solve(np.eye(len(x)) - at.system.A, at.after - x)
        except np.linalg.LinAlgError:
            return None
        x = x + step
        if not np.isfinite(x).all():
            return None
        if np.abs(step).max(initial=0.0) <= _STILL * np.abs(x).max(initial=1.0):
            return x
    return None
