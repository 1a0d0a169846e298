"""Settings: validation and derived values."""

import pytest

from islands.errors import SettingsError
from islands.evolution.settings import FITNESS_MODES, FITNESSES, Settings
from islands.validation.assessment import MODES

#: Samples between two starts of each kind of simulation, if those of a shooting interval are 70.
INTERVALS = {"one_step_ahead": 1, "multiple_shooting": 70, "free_run": None}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"population": 0}, "population is an integer of at least 1, got 0"),
        ({"population": -3}, "population is an integer of at least 1, got -3"),
        ({"max_terms": 0}, "max_terms is an integer of at least 1, got 0"),
        ({"shooting": 0}, "shooting is an integer of at least 1, got 0"),
        ({"generations": -1}, "generations is an integer of at least 0, got -1"),
        ({"max_height": -1}, "max_height is an integer of at least 0, got -1"),
        ({"tournament": 0}, "tournament is an integer of at least 1, got 0"),
        *(
            ({name: value}, f"{name} is a number from 0 to 1, got {value}")
            for name in ("elite", "crossover", "mutation", "prune", "high_level", "outer", "from_library")
            for value in (-0.1, 1.1, float("nan"))
        ),
        ({"tolerance": -1e-9}, "tolerance is a number of at least 0, got -1e-09"),
        ({"tolerance": float("nan")}, "tolerance is a number of at least 0, got nan"),
        ({"initial_terms": (0, 3)}, r"initial_terms \(0, 3\) lie between 1 and max_terms 10"),
        ({"initial_terms": (4, 3)}, r"initial_terms \(4, 3\) lie between 1 and max_terms 10"),
        ({"initial_terms": (1, 11)}, r"initial_terms \(1, 11\) lie between 1 and max_terms 10"),
        ({"max_terms": 4}, r"initial_terms \(1, 10\) lie between 1 and max_terms 4"),
        ({"initial_height": -1}, "initial_height is an integer of at least 0, got -1"),
        ({"initial_height": 6}, "initial_height 6 is larger than max_height 5"),
        ({"max_height": 2}, "initial_height 3 is larger than max_height 2"),
        ({"structure": "tree"}, "unknown structure of narx models 'tree': take one of free, phi, increment"),
        ({"constraints": "physics"}, "unknown constraints 'physics': take one of none, hysteresis"),
        ({"fitness": "bic"}, "fitness is one of shooting, one-step, free-run, got 'bic'"),
        ({"primitives": ("mul", "gamma")}, "unknown primitive 'gamma': take one of mul, sub"),
        ({"shifts": (1, 0)}, "shifts is a list of integers of at least 1, got 0"),
        ({"shifts": (), "primitives": ()}, "give at least one of them"),
        ({"library": "fourier"}, "library is one of phi-polynomial, polynomial, .* got 'fourier'"),
        ({"islands": 0}, "islands is an integer from 1 to 10000, got 0"),
        ({"islands": 10_001}, "islands is an integer from 1 to 10000, got 10001"),
        ({"max_evaluations": -1}, "max_evaluations is an integer of at least 0, got -1"),
        ({"target_error": -0.1}, "target_error is a number of at least 0, got -0.1"),
        ({"target_error": float("nan")}, "target_error is a number of at least 0, got nan"),
        ({"emigrants": "anyone"}, "emigrants is one of best, random, front, got 'anyone'"),
        ({"replaced": "best"}, "replaced is one of worst, random, got 'best'"),
        ({"characters": ("plain", "lazy")}, "unknown character 'lazy': take one of plain, explorer"),
        ({"migrate_every": 0}, "migrate_every is at least 1, got 0"),
        ({"migrate_every": "5,100:0"}, "migrate_every is at least 1, got '5,100:0'"),
        ({"migrate_every": "often"}, "cannot read migrate_every 'often'"),
        ({"migrate_every": 7.0}, "migrate_every is an integer or a text, got 7.0"),
        ({"migrate_every": 10**9}, "cannot read migrate_every 1000000000"),
        ({"migrants": "1,20:"}, "cannot read migrants '1,20:'"),
        ({"migrants": -1}, "cannot read migrants -1"),
        ({"migrants": "1,20:2,20:3"}, "migrants '1,20:2,20:3': its generations ascend"),
        ({"topology": "mesh"}, "unknown topology 'mesh': take one of isolated, ring"),
        ({"topology": "ring:2", "islands": 4}, "topology 'ring:2': a degree"),
        ({"topology": "ring:", "islands": 4}, "topology 'ring:': a degree from 1 to 99"),
        ({"topology": "random-regular:100", "islands": 400}, "a degree from 1 to 99"),
        ({"topology": "random-regular:6", "islands": 10_000}, "more than 50000 edges: take a smaller"),
        ({"topology": "1234567890>1", "islands": 4}, "cannot read the edge '1234567890>1'"),
        ({"topology": "random-regular:4", "islands": 4}, "takes more than 4 islands, got 4"),
        ({"topology": "0>1,1>2", "islands": 2}, "the edge 1>2 does not join two of the islands 0 to 1"),
        ({"topology": "fully-connected", "islands": 1001}, "at most 1000 islands are fully connected"),
    ],
)
def test_invalid_value_raises_settings_error_with_its_name(changes, message):
    with pytest.raises(SettingsError, match=message):
        Settings(**changes)


@pytest.mark.parametrize(
    "changes",
    [
        {"generations": 0},
        {"population": 1, "elite": 0.0},
        {"max_height": 0, "initial_height": 0},
        {"max_terms": 1, "initial_terms": (1, 1)},
        {"tolerance": 0.0, "prune": 1.0, "crossover": 0.0, "mutation": 1.0},
        {"shifts": ()},
        {"primitives": ()},
        {"library": "polynomial", "from_library": 1.0},
        {"islands": 10_000},
        {"islands": 3, "migrants": 0, "migrate_every": "5,100:20", "max_evaluations": 1},
        {"islands": 4, "topology": "random-regular:3", "characters": ("explorer", "plain")},
        {"islands": 2, "topology": "0>1", "target_error": 0.5},
        {"target_error": 1e308},
        {"population": 12, "islands": 4, "topology": "fully-connected", "migrants": 4},
    ],
)
def test_limits_of_the_ranges_are_valid(changes):
    made = Settings(**changes)
    assert all(getattr(made, name) == value for name, value in changes.items())


@pytest.mark.parametrize(
    ("topology", "islands", "migrants", "arriving"),
    [
        ("fully-connected", 4, 4, 12),
        # The largest number of emigrants and the island with the most sources determine the limit.
        ("ring", 3, "1,20:12,40:2", 12),
        ("star", 7, 2, 12),
        ("0>1,2>1,3>1,4>1,1>0", 5, 3, 12),
    ],
)
def test_immigrants_must_not_exceed_the_population(topology, islands, migrants, arriving):
    changes = {"topology": topology, "islands": islands, "migrants": migrants}
    Settings(population=arriving, **changes)
    message = f"{arriving} individuals would arrive on an island of {arriving - 1}: fewer migrants"
    with pytest.raises(SettingsError, match=message):
        Settings(population=arriving - 1, **changes)


@pytest.mark.parametrize(
    ("changes", "maximum_lag"),
    [
        ({}, 1 + 5 * 5),
        ({"max_height": 3, "shifts": (1, 2, 3)}, 1 + 3 * 3),
        ({"shifts": ()}, 1),
        ({"max_height": 0, "initial_height": 0}, 1),
        # A leaf of a library has a separate lag, and variation can insert it at any depth.
        ({"library": "polynomial", "library_lags": 4, "shifts": (2,)}, 4 + 5 * 2),
        ({"library": "polynomial", "library_lags": 4, "shifts": ()}, 4),
    ],
)
def test_maximum_lag_is_that_of_a_leaf_under_back_shifts(changes, maximum_lag):
    assert Settings(**changes).maximum_lag == maximum_lag


@pytest.mark.parametrize(
    ("population", "elite", "elites"), [(500, 0.1, 50), (10, 0.0, 1), (3, 0.1, 1), (4, 1.0, 4)]
)
def test_elite_is_a_fraction_of_the_population_and_never_empty(population, elite, elites):
    assert Settings(population=population, elite=elite).elites == elites


def test_fitness_simulates_as_the_assessment_of_its_mode() -> None:
    assert FITNESS_MODES.keys() == FITNESSES.keys()
    assert INTERVALS.keys() == set(MODES)
    for name, interval in FITNESSES.items():
        assert interval(70) == INTERVALS[FITNESS_MODES[name]], name
