"""jax-sysid: a linear state space and neural networks in both equations, Adam, then L-BFGS, of the free run.

The equations, penalties and numbers of iterations are those of its documentation, with the present input in
the output equation as well.
"""

from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jax_sysid.models import Model

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lab.published_sets.peers.child import Array, Candidate, PeerRecording, PeerTask, Simulate

#: Neurons of each network.
_UNITS = 8

#: Samples on which a candidate is fitted, at most: an iteration takes microseconds for each.
_SAMPLES = 10_000

#: Iterations of Adam, and evaluations of L-BFGS.
_ADAM, _LBFGS = 1000, 1000

#: Part of the CPU seconds after which the last fit ends.
_PART = 0.9

#: Parameters of a candidate that has been fitted, and CPU seconds for each sample and iteration.
_fitted: dict[str, tuple[Any, float]] = {}


def list_candidates(_task: "PeerTask") -> list["Candidate"]:
    """Return numbers of states, with several initial values of the parameters."""
    return [{"states": states, "seed": seed} for seed in range(3) for states in (4, 2, 6, 8)]


def fit(recordings: "Sequence[PeerRecording]", candidate: "Candidate", task: "PeerTask") -> "Simulate":
    """Fit a candidate; a second time from the parameters of the first, as long as the limit allows."""
    key, states = str(candidate), candidate["states"]
    inputs, outputs = recordings[0].u.shape[1], recordings[0].y.shape[1]
    model = Model(states, outputs, inputs, state_fcn=jax.jit(_update), output_fcn=jax.jit(_output))
    model.loss(rho_x0=1e-4, rho_th=1e-4)
    if key in _fitted:
        parameters, cost = _fitted[key]
        left = task.seconds_left - (1.0 - _PART) * task.limit
        # Adam first: the first step of L-BFGS alone is often too long, and ends it.
        adam = lbfgs = min(_ADAM, int(left / cost / _count(recordings) / 2))
    else:
        parameters = _draw_parameters(states, outputs, inputs, candidate["seed"])
        recordings, adam, lbfgs = _shorten(recordings), _ADAM, _LBFGS
    model.init(params=parameters)
    model.optimization(adam_epochs=adam, lbfgs_epochs=lbfgs, iprint=-1)
    before = task.seconds_left
    if lbfgs > 0:
        model.fit([each.y for each in recordings], [each.u for each in recordings])
    if key not in _fitted:
        _fitted[key] = model.params, (before - task.seconds_left) / (_ADAM + _LBFGS) / _count(recordings)

    def simulate(u: "Array", y: "Array") -> "Array":
        x0 = model.learn_x0(u[: len(y)], y, RTS_epochs=10, LBFGS_refinement=True, verbosity=False)
        return np.array(model.predict(x0, u)[0])

    return simulate


def _count(recordings: "Sequence[PeerRecording]") -> int:
    """Return the number of samples."""
    return sum(len(each.u) for each in recordings)


def _shorten(recordings: "Sequence[PeerRecording]") -> "list[PeerRecording]":
    """Return the first samples of the recordings."""
    most = _SAMPLES // len(recordings)
    return [type(each)(each.u[:most], each.y[:most]) for each in recordings]


def _draw_parameters(states: int, outputs: int, inputs: int, seed: int) -> list["Array"]:
    draw = np.random.default_rng(seed).standard_normal
    return [
        0.5 * np.eye(states),
        0.1 * draw((states, inputs)),
        0.1 * draw((outputs, states)),
        np.zeros((outputs, inputs)),
        *(0.1 * draw((_UNITS, states)), 0.5 * draw((_UNITS, inputs)), np.zeros(_UNITS)),
        *(0.5 * draw((states, _UNITS)), np.zeros(states)),
        *(0.5 * draw((_UNITS, states)), 0.5 * draw((_UNITS, inputs)), np.zeros(_UNITS)),
        *(0.5 * draw((outputs, _UNITS)), np.zeros(outputs)),
    ]


def _update(x: Any, u: Any, params: Any) -> Any:
    """Return the next states."""
    a, b, _, _, w1, w2, b1, w3, b2, *_ = params
    return a @ x + b @ u + w3 @ _sigmoid(w1 @ x + w2 @ u + b1) + b2


def _output(x: Any, u: Any, params: Any) -> Any:
    """Return the outputs."""
    _, _, c, d, _, _, _, _, _, w4, w5, b3, w6, b4 = params
    return c @ x + d @ u + w6 @ _sigmoid(w4 @ x + w5 @ u + b3) + b4


def _sigmoid(x: Any) -> Any:
    return 1.0 / (1.0 + jnp.exp(-x))
