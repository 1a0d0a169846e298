"""SysIdentPy: polynomial NARX by FROLS, whose number of terms has the least BIC; parameters by least squares.

It has no fit to several recordings: they are joined, which makes some rows of each joint wrong.
"""

from typing import TYPE_CHECKING

import numpy as np
from sysidentpy.basis_function import Polynomial
from sysidentpy.model_structure_selection import FROLS
from sysidentpy.parameter_estimation import LeastSquares

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lab.published_sets.peers.child import Array, Candidate, PeerRecording, PeerTask, Simulate

#: Degree and largest lag of the candidates.
_CANDIDATES = ((2, 2), (3, 2), (2, 3), (2, 4), (3, 3), (2, 6), (3, 4), (2, 8), (2, 10), (2, 15), (2, 20))

#: Terms of a model, at most.
_TERMS = 30


def list_candidates(task: "PeerTask") -> list["Candidate"]:
    """Return degrees and lags."""
    return [{"degree": degree, "lags": lags} for degree, lags in _CANDIDATES if lags <= task.known]


def fit(recordings: "Sequence[PeerRecording]", candidate: "Candidate", task: "PeerTask") -> "Simulate":
    """Select terms of the outputs ``y(k-1), ..., y(k-lags)`` and the inputs ``u(k), ..., u(k-lags+1)``."""
    lags = candidate["lags"]
    u = np.vstack([_advance(each.u) for each in recordings])
    y = np.vstack([each.y for each in recordings])
    model = FROLS(
        ylag=lags,
        xlag=lags if u.shape[1] == 1 else [list(range(1, lags + 1))] * u.shape[1],
        order_selection=True,
        info_criteria="bic",
        n_info_values=_TERMS,
        estimator=LeastSquares(),
        basis_function=Polynomial(degree=candidate["degree"]),
    )
    model.fit(X=u, y=y)
    return task.run_freely(lambda u, y: model.predict(X=_advance(u), y=y), model.max_lag)


def _advance(u: "Array") -> "Array":
    """Return the inputs one sample early: the first lag of an input is 1."""
    return np.vstack([u[1:], u[-1:]])
