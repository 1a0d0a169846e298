"""Something is hidden in data, and an identified model is held against it: its own form is wrong as well.

The model is identified on the record that something is hidden in.
"""

import pytest

from islands.trials.trial import Outcome, Trial, carried_out

#: Seconds of a record.
SECONDS = 15.0


def outcome(*effects: str, seed: int, band: tuple[float, float] | None = None) -> Outcome:
    return carried_out(Trial(effects, seed, band=band, seconds=SECONDS, core="narx"))


def test_on_a_clean_record_the_model_s_form_is_wrong_and_nothing_else() -> None:
    found = outcome(seed=802)
    assert found.verdict == "named"
    assert found.form
    assert not found.named
    assert not found.noticed


@pytest.mark.parametrize("name", ["offset", "coulomb-friction"])
def test_what_is_hidden_is_told_from_the_model_s_form(name: str) -> None:
    found = outcome(name, seed=803, band=(1.0, 4.0))
    assert found.verdict in ("named", "named with remainder")
    assert found.first_right, (found.named, found.candidates)
    assert found.form
    assert len(found.named) == 1
