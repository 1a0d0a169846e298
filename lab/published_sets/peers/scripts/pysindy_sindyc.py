"""pysindy: SINDYc in discrete time, with lagged outputs as states, present and lagged inputs as controls."""

from typing import TYPE_CHECKING

import numpy as np
import pysindy

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lab.published_sets.peers.child import Array, Candidate, PeerRecording, PeerTask, Simulate

#: Degree and number of lags of the candidates.
_CANDIDATES = ((1, 2), (2, 2), (3, 2), (1, 4), (2, 4), (3, 3), (1, 10), (2, 6), (3, 4))

#: Smallest coefficients, of inputs and outputs with a standard deviation of 1.
_THRESHOLDS = (0.0, 0.001, 0.01, 0.05)

#: Output, in standard deviations, beyond which a free run has diverged.
_MOST = 1e6


def list_candidates(task: "PeerTask") -> list["Candidate"]:
    """Return degrees, lags and thresholds."""
    return [
        {"degree": degree, "lags": lags, "threshold": threshold}
        for degree, lags in _CANDIDATES
        for threshold in _THRESHOLDS
        if lags <= task.known
    ]


def fit(recordings: "Sequence[PeerRecording]", candidate: "Candidate", task: "PeerTask") -> "Simulate":
    """Fit the next states, of which the first ones are the outputs."""
    lags, outputs = candidate["lags"], recordings[0].y.shape[1]
    count = lags * outputs
    parts = [task.make_rows(each, lags) for each in recordings]
    model = pysindy.DiscreteSINDy(
        optimizer=pysindy.STLSQ(threshold=candidate["threshold"], alpha=1e-6),
        feature_library=pysindy.PolynomialLibrary(degree=candidate["degree"]),
    )
    model.fit(
        [rows[:, :count] for rows, _ in parts],
        t=1,
        x_next=[np.hstack([y, rows[:, : count - outputs]]) for rows, y in parts],
        u=[rows[:, count:] for rows, _ in parts],
    )
    return task.run_freely(_compile(model, lags, outputs), lags)


def _compile(model: pysindy.DiscreteSINDy, lags: int, outputs: int) -> "Simulate":
    """Return a simulation of the outputs; that of the package takes a millisecond for each sample."""
    coefficients = model.coefficients()[:outputs]
    is_used = coefficients.any(axis=0)
    powers, coefficients = model.feature_library.powers_[is_used], coefficients[:, is_used]
    # Places of the factors of each monomial; those after the last factor are that of a constant 1.
    places = np.full((len(powers), max(1, powers.sum(axis=1).max(initial=0))), powers.shape[1])
    for row, each in zip(places, powers, strict=True):
        row[: each.sum()] = np.repeat(np.arange(len(each)), each)

    def predict(u: "Array", y: "Array") -> "Array":
        simulated = np.full((len(u), outputs), np.nan)
        simulated[:lags] = y
        for k in range(lags, len(u)):
            past, inputs = simulated[k - lags : k][::-1], u[k - lags : k + 1][::-1]
            features = np.concatenate([past.ravel(), inputs.ravel(), [1.0]])
            simulated[k] = coefficients @ features[places].prod(axis=1)
            if not np.abs(simulated[k]).max() < _MOST:
                break
        return simulated

    return predict
