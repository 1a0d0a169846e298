"""Models with named parameters as simulations of a diagnosis."""

import numpy as np

from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.specification.factory import make_model_simulator
from support.latent_systems import make_model, spring_record


def test_a_state_space_at_rest_follows_its_input_from_the_first_sample():
    record = spring_record(100, start=(0.0, 0.0))
    simulator = make_model_simulator(make_model(memory=45), "spring", record)
    alone = ExtendedSimulator(simulator, (), make_context(record, simulator, record.samples))
    np.testing.assert_allclose(alone.simulate(alone.nominal), record.y, rtol=1e-12)
