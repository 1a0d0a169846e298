"""Linear simulations without a direct term."""

from dataclasses import replace

import numpy as np

from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.linear import LinearSimulator
from islands.simulators.specification.description import describe_extension
from support.noise_records import make_noisy_record

LINEAR = LinearSimulator(np.array([0.0, 0.06, 0.04]), np.array([1.5, -0.6]), 1.0, 0.0, 0, "V")


def simulate(simulator: LinearSimulator) -> np.ndarray:
    record = make_noisy_record("white", 0)
    simulation = ExtendedSimulator(simulator, (), make_context(record, simulator, 1500))
    return simulation.simulate(simulation.nominal)


def test_simulation_without_a_direct_term_is_one_whose_direct_term_is_zero() -> None:
    held = replace(LINEAR, has_direct_term=False)
    assert [each.name for each in LINEAR.parameters] == ["b0", *(each.name for each in held.parameters)]
    np.testing.assert_array_equal(simulate(held), simulate(LINEAR))


def test_specification_without_a_direct_term_has_a_zero() -> None:
    held = replace(LINEAR, has_direct_term=False)
    values = np.array([each.nominal for each in held.parameters])
    spec = describe_extension(held, values, ("u_V",), "y_V")
    assert spec.numerator == (0.0, 0.06, 0.04)  # type: ignore[union-attr]
    assert spec.denominator == (1.5, -0.6)  # type: ignore[union-attr]
