"""Stop of a fit: a check ends it, with the models so far."""

import pytest

from islands import fit
from islands.progress import StoppedError
from islands.systems.catalogue import make_record


def stop_at(check):
    """Return a stop function that returns true from its n-th call on, and the list of its calls."""
    calls = []

    def stop():
        calls.append(None)
        return len(calls) >= check

    return stop, calls


@pytest.mark.ci
def test_stop_at_checks_spread_over_a_fit_returns_the_models_so_far():
    whole = make_record("bouc-wen-piezo", "authors", "estimation")
    record = type(whole)(whole.u[:400], whole.y[:400], whole.dt)

    def run(stop):
        return fit(record, library="polynomial", degree=1, lags=2, max_terms=3, average=1, stop=stop)

    never, calls = stop_at(10_000)
    complete = {model.model.size: model.equation for model in run(never).models}
    counts = []
    for check in (*range(1, len(calls), 9), len(calls)):
        stop, made = stop_at(check)
        try:
            found = run(stop)
        except StoppedError:
            counts.append(0)
        else:
            assert found.search_result.search.ended_by == "stopped"
            assert found.search_result.ensemble is None
            counts.append(len(found.models))
        assert len(made) <= check + 10  # no step begins after the stop
    assert counts == sorted(counts)
    assert counts[-1] == len(complete)
    assert counts[0] == 0
