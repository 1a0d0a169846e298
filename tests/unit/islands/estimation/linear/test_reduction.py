import numpy as np
import pytest
from scipy.signal import lfilter

from islands.estimation.linear.noise import WHITE
from islands.estimation.linear.numerators import find_residues, map_numerators
from islands.estimation.linear.reduction import reduce_model, sample_fit, sample_high_order
from islands.estimation.linear.regression import make_structure, minimise, project
from islands.estimation.linear.sections import Signals, find_poles, pair_poles
from islands.estimation.linear.starts import fit_high_order

RATES = np.array([-0.05 + 0.0j, -0.02 + 0.3j, -0.02 - 0.3j])


@pytest.fixture(scope="module")
def record():
    """Signals of a system of order 3 without zeros and with a dead time of 4 samples, and its sections."""
    random = np.random.default_rng(1)
    u, parts = random.normal(size=2000), pair_poles(np.exp(RATES))
    residues = find_residues(find_poles(parts)[None], 0)
    numerators = map_numerators(residues, [part.size for part in parts], None)[0, :, 0]
    y = np.zeros(2000)
    for part, own in zip(parts, np.split(numerators, [parts[0].size]), strict=True):
        polynomial = own if own.size == 1 else [own.sum(), -own[1]]
        y += lfilter(np.r_[np.zeros(5), polynomial], np.r_[1.0, part], u)
    y = y / y.std() + random.normal(0.0, 0.01, 2000)
    return Signals(u[None], y[None], np.array([2000])), tuple(parts)


def take_true(found):
    return next(each for each in found if each.poles.size == 3 and not each.zeros.any())


def test_a_model_of_more_parameters_leads_to_the_poles_the_dead_time_and_its_deviance(record):
    signals, parts = record
    rich = (*parts, np.array([-0.5]))
    # It begins a sample early.
    structure = make_structure(rich, 0, np.array([[3]]), np.array([[False]]), (WHITE,), signals.first)
    fit = minimise(signals, project(signals, structure), 30)
    found = take_true(reduce_model(sample_fit(fit), [3]))
    assert found.delays.tolist() == [[4]]
    np.testing.assert_allclose(np.sort_complex(found.poles), np.sort_complex(RATES), rtol=0.05)
    # The parameters that are left out cost about 1 each, as they are not in the system.
    assert 0.0 < found.loss < 30.0


def test_a_high_order_model_leads_to_the_poles(record):
    signals, _ = record
    response = sample_high_order(signals, fit_high_order(signals, 20))
    found = take_true(reduce_model(response, [3]))
    np.testing.assert_allclose(np.sort_complex(found.poles), np.sort_complex(RATES), rtol=0.1)


def test_an_input_that_does_not_move_has_no_response():
    signals = Signals(np.ones((1, 300)), np.zeros((1, 300)), np.array([300]))
    structure = make_structure(
        (np.array([-0.9]),), 0, np.array([[0]]), np.array([[False]]), (WHITE,), signals.first
    )
    assert list(reduce_model(sample_fit(project(signals, structure)), [1, 2])) == []


def test_a_bound_leaves_out_transfer_functions_that_cost_more(record):
    signals, _ = record
    response = sample_high_order(signals, fit_high_order(signals, 20))
    every = [(each.loss + 7.0 * each.size, each) for each in reduce_model(response, [2, 3, 4, 5])]
    least = min(cost for cost, _ in every)
    left = [
        each.loss + 7.0 * each.size for each in reduce_model(response, [2, 3, 4, 5], bound=(7.0, least + 1.0))
    ]
    assert len(left) < len(every)
    assert min(left) == pytest.approx(least, rel=1e-6)
