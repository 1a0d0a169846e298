"""Fitness functions: each one is the error of a kind of simulation of the assessment."""

from islands.evolution.fitness import FITNESS_MODES, FITNESSES
from islands.validation.assessment import MODES

#: Samples between two starts of each kind of simulation, if those of a shooting interval are 70.
INTERVALS = {"one_step_ahead": 1, "multiple_shooting": 70, "free_run": None}


def test_fitness_simulates_as_the_assessment_of_its_mode() -> None:
    assert FITNESS_MODES.keys() == FITNESSES.keys()
    assert INTERVALS.keys() == set(MODES)
    for name, interval in FITNESSES.items():
        assert interval(70) == INTERVALS[FITNESS_MODES[name]], name
