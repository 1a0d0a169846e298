"""Names are withdrawn if the hold-out part contradicts them."""

import numpy as np
import pytest
from scipy.signal import lfilter

import islands
from islands.diagnosis.inference.verdict import Verdict
from islands.effects.catalogue import CATALOGUE
from support.simulated_records import recorded


@pytest.mark.ci
def test_names_are_withdrawn_that_slow_noise_hides_in_the_rmse() -> None:
    """The effect is missing in the hold-out part, where the names increase the innovations."""
    rng = np.random.default_rng(0)
    u = lfilter([1.0], [1.0, -0.6], rng.standard_normal(2000))
    u /= np.std(u)
    theirs = lfilter([0.3], [1.0, -0.7], u)
    noise = lfilter([1.0], [1.0, -0.97], rng.standard_normal(2000))
    noise *= np.std(theirs) / np.std(noise)
    law = 0.3 * np.abs(theirs) * theirs
    record = recorded(u, theirs + noise + np.where(np.arange(2000) < 1500, law, 0.0))
    few = [CATALOGUE[name] for name in ("sensor-gain", "cubic-stiffness", "viscous", "quadratic-drag")]
    options = {"columns": {"theirs": theirs}, "effects": few}
    found = islands.diagnose(record, "column:theirs", **options)
    assert found.verdict == Verdict.UNKNOWN
    everywhere = islands.diagnose(recorded(u, theirs + noise + law), "column:theirs", **options)
    assert everywhere.verdict not in (Verdict.UNKNOWN, Verdict.NOTHING)
