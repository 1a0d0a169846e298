"""Something is hidden in data, and an identified model is held against it: its own form is wrong as well.

The model is identified on the record that something is hidden in.
"""

import pytest

from islands.performance.trials.trial import Trial, TrialOutcome, run_trial

#: Seconds of a record at the nightly level, and of a short one.
SECONDS, SHORT = 15.0, 6.0

ci, nightly = pytest.mark.ci, pytest.mark.nightly


def outcome(
    *effects: str, seed: int, seconds: float, band: tuple[float, float] | None = None
) -> TrialOutcome:
    return run_trial(Trial(effects, seed, band=band, seconds=seconds, core="narx"))


@pytest.mark.parametrize("seconds", [pytest.param(SHORT, marks=ci), pytest.param(SECONDS, marks=nightly)])
def test_on_a_clean_record_the_model_s_form_is_wrong_and_nothing_else(seconds: float) -> None:
    found = outcome(seed=802, seconds=seconds)
    assert found.verdict == "named"
    assert found.form
    assert not found.named
    assert not found.noticed


@pytest.mark.parametrize(
    ("name", "seconds"),
    [
        pytest.param("coulomb-friction", SHORT, marks=ci),
        pytest.param("coulomb-friction", SECONDS, marks=nightly),
        pytest.param("offset", SECONDS, marks=nightly),
    ],
)
def test_a_hidden_effect_is_told_from_the_model_s_form(name: str, seconds: float) -> None:
    found = outcome(name, seed=803, seconds=seconds, band=(1.0, 4.0))
    assert found.verdict in ("named", "named with remainder")
    assert found.first_right, (found.named, found.candidates)
    assert found.form
    assert len(found.named) == 1
