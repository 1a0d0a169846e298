"""Estimation by the error of the free run, where it is better than least squares."""

import numpy as np
import pytest

import islands
from islands.records.dataset import Dataset

#: Law of a drive with dry friction, in the order of its terms.
FRICTION = {"y(k-1)": 0.98, "u1(k-1)": 0.1, "sign(y(k-1))": -0.03}

SETTINGS = {"library": "friction", "lags": 2, "degree": 2, "average": 1, "certificate": 0, "max_terms": 6}


def drive(seed, output_noise=0.0, equation_noise=0.0, samples=1500):
    rng = np.random.default_rng(seed)
    u, y = np.repeat(rng.uniform(-1.0, 1.0, samples // 15), 15), np.zeros(samples)
    for k in range(1, samples):
        parts = FRICTION.values()
        terms = y[k - 1], u[k - 1], np.sign(y[k - 1])
        y[k] = np.dot(list(parts), terms) + equation_noise * rng.standard_normal()
    return Dataset(u, y + output_noise * rng.standard_normal(samples), 0.01)


@pytest.mark.ci
def test_noise_of_the_measured_output_adds_no_terms():
    exact = 0
    for seed in range(10):
        record, clean = drive(seed, output_noise=0.03), drive(seed + 100)
        best, biased = (
            islands.fit(record, **SETTINGS, **choice).best for choice in ({}, {"estimator": "least-squares"})
        )
        exact += best.model.parameter_names == tuple(FRICTION)
        errors = [each.simulate(clean).mean_squared_error for each in (best, biased)]
        assert errors[0] < 0.25 * errors[1]
    assert exact >= 8


def test_a_stop_leaves_the_refinement_out():
    stages = []

    def stop():
        return "estimation by the error of the free run" in stages

    record = drive(0, output_noise=0.03, samples=300)
    found = islands.fit(record, **SETTINGS, progress=lambda stage, _: stages.append(stage), stop=stop)
    assert "estimation by the error of the free run" in found.left_out
    assert found.best.model.parameters
