"""Blind trials with an identified model, which has a model-form error in addition to the injected effect.

The model is identified on the record with the injected effect.
"""

import pytest

from lab.diagnosis.trial import Trial, TrialOutcome, run_trial

#: Duration of a record at the nightly level, in seconds.
SECONDS = 15.0

#: Duration of a short record, in seconds.
SHORT = 6.0

pytestmark = pytest.mark.nightly


def run(*effects: str, seed: int, seconds: float, band: tuple[float, float] | None = None) -> TrialOutcome:
    return run_trial(Trial(effects, seed, band=band, seconds=seconds, core="narx"))


@pytest.mark.parametrize("seconds", [SHORT, SECONDS])
def test_clean_record_only_yields_the_model_form_error(seconds: float) -> None:
    found = run(seed=802, seconds=seconds)
    assert found.verdict == "named"
    assert found.form
    assert not found.named
    assert not found.noticed


@pytest.mark.parametrize("name", ["coulomb-friction", "offset"])
def test_injected_effect_is_separated_from_the_model_form_error(name: str) -> None:
    found = run(name, seed=803, seconds=SECONDS, band=(1.0, 4.0))
    assert found.verdict in ("named", "named with remainder")
    assert found.first_right, (found.named, found.candidates)
    assert found.form
    assert len(found.named) == 1
