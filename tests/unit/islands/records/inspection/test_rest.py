import pytest

from islands.records.inspection.rest import check_rest
from support.known_records import hysteresis, lag, measure, steps


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_output_of_a_hysteresis_rests_with_its_input(noise):
    for seed in range(3):
        u = steps(3000, seed)
        fact = check_rest(measure(u, hysteresis(u), noise, seed))
        assert fact.value is True
        assert fact.confidence > 0.9


@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize("constant", [5.0, 20.0, 100.0])
def test_output_of_a_lag_moves_on_while_its_input_rests(constant, noise):
    for seed in range(3):
        u = steps(3000, seed)
        fact = check_rest(measure(u, lag(u, constant), noise, seed))
        assert fact.value is False
        assert fact.confidence > 0.9
