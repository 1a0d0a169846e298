"""pyoperon: symbolic regression of the output, or of its change, on past outputs and on inputs."""

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np
from pyoperon.sklearn import SymbolicRegressor

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lab.published_sets.peers.child import Array, Candidate, PeerRecording, PeerTask, Simulate

#: Length of the expressions, and number of lags, of the candidates.
_CANDIDATES = ((15, 2), (15, 4), (30, 2), (30, 4), (15, 8), (30, 8))

#: Rows of a search, at most, taken at equal distances.
_ROWS = 2000

#: Output, in standard deviations, beyond which a free run has diverged.
_MOST = 1e6


def list_candidates(task: "PeerTask") -> list["Candidate"]:
    """Return lengths, lags, and whether the change of the output is predicted."""
    return [
        {"length": length, "lags": lags, "change": is_change}
        for length, lags in _CANDIDATES
        for is_change in (False, True)
        if lags <= task.known
    ]


def fit(recordings: "Sequence[PeerRecording]", candidate: "Candidate", task: "PeerTask") -> "Simulate":
    """Search the expression with the least error of one step."""
    lags = candidate["lags"]
    parts = [task.make_rows(each, lags) for each in recordings]
    rows, y = (np.vstack([part[place] for part in parts]) for place in (0, 1))
    step = -(-len(y) // _ROWS)
    rows, target = rows[::step], y[::step, 0]
    if candidate["change"]:
        target = target - rows[:, 0]
    spread = target.std()
    regressor = SymbolicRegressor(
        allowed_symbols="add,sub,mul,aq,constant,variable",
        optimizer_iterations=5,
        max_length=candidate["length"],
        max_evaluations=100_000,
        model_selection_criterion="mean_squared_error",
        random_state=1,
    )
    regressor.fit(rows, target / spread)
    names = [f"x[{place}]" for place in range(rows.shape[1])]
    text = regressor.get_model_string(regressor.model_, 17, names)
    # The package evaluates tables; a free run needs a row at a time.
    expression = eval(f"lambda x: {text.replace('^', '**')}", {"sqrt": sqrt})

    def predict(u: "Array", y: "Array") -> "Array":
        simulated = np.full((len(u), 1), np.nan)
        simulated[:lags] = y
        for k in range(lags, len(u)):
            past, inputs = simulated[k - lags : k][::-1], u[k - lags : k + 1][::-1]
            row = np.concatenate([past.ravel(), inputs.ravel()]).tolist()
            value = spread * expression(row) + candidate["change"] * row[0]
            if not abs(value) < _MOST:
                break
            simulated[k] = value
        return simulated

    return task.run_freely(predict, lags)
