"""fastcan: polynomial NARX with terms by `make_narx`, and parameters by the error of the free run."""

from typing import TYPE_CHECKING

import numpy as np
from fastcan.narx import make_narx

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lab.published_sets.peers.child import Candidate, PeerRecording, PeerTask, Simulate

#: Degree, largest delay and number of terms of the candidates.
_CANDIDATES = (
    *((3, 2, 10), (2, 4, 10), (3, 4, 10), (2, 2, 5), (3, 2, 5), (2, 4, 5), (3, 4, 20), (2, 8, 10)),
    *((2, 8, 15), (3, 6, 15), (3, 6, 25), (2, 10, 25)),
)


def list_candidates(task: "PeerTask") -> list["Candidate"]:
    """Return degrees, delays and numbers of terms."""
    return [
        {"degree": degree, "delay": delay, "terms": terms}
        for degree, delay, terms in _CANDIDATES
        if delay <= task.known
    ]


def fit(recordings: "Sequence[PeerRecording]", candidate: "Candidate", task: "PeerTask") -> "Simulate":
    """Select the terms, and fit the parameters from those of the prediction of one step."""
    u, y = (np.vstack([getattr(each, name) for each in recordings]) for name in "uy")
    sizes = [len(each.u) for each in recordings]
    narx = make_narx(
        u,
        y,
        n_terms_to_select=candidate["terms"],
        max_delay=candidate["delay"],
        poly_degree=candidate["degree"],
        session_sizes=sizes,
        refine_drop=1,
        refine_max_iter=10,
        refine_verbose=0,
        verbose=0,
    )
    narx.fit(u, y, coef_init="one_step_ahead", session_sizes=sizes, max_nfev=50)
    return task.run_freely(narx.predict, narx.max_delay_)
