import subprocess
import sys

import numpy as np
import pytest

from islands.records.dataset import Dataset
from islands.records.inspection import record_facts
from islands.records.inspection.record_facts import FACTS, MOST_SAMPLES, measure_facts
from support.known_records import lag, measure, slow, steps, white


def test_every_fact_is_measured_once_for_each_signal():
    u = np.column_stack([steps(2000, 0), slow(2000, 1)])
    found = measure_facts(Dataset(u, lag(u[:, 0], 5.0) + u[:, 1], 0.1)).facts
    assert {fact.name for fact in found} == set(FACTS)
    keys = [(fact.name, fact.signal) for fact in found]
    assert len(keys) == len(set(keys))
    assert [keys.count(("dead-time", name)) for name in ("u1", "u2", "y")] == [1, 1, 0]


def test_facts_do_not_depend_on_the_units():
    u, y = slow(2000, 0), lag(slow(2000, 0), 5.0)
    one, other = (measure_facts(measure(u * scale, 7.0 + y * scale, 0.05)) for scale in (1.0, 1000.0))
    for name in ("dead-time", "rest", "loop", "saturation", "coverage"):
        assert one.find(name).value == other.find(name).value
    assert other.find("noise", "y").value == pytest.approx(1000.0 * one.find("noise", "y").value)


def test_a_part_of_a_long_record_is_stated():
    u = white(MOST_SAMPLES + 1000, 0)
    fact = measure_facts(measure(u, u)).find("samples")
    assert fact.value == MOST_SAMPLES + 1000
    assert fact.details["part"] == (500, MOST_SAMPLES + 499)


@pytest.mark.parametrize("samples", [1, 2, 5, 30])
def test_short_records_have_facts(samples):
    rng = np.random.default_rng(0)
    assert measure_facts(Dataset(rng.random(samples), rng.random(samples), 1.0)).facts


@pytest.mark.parametrize("scale", [0.0, 1e-300, 1e300])
def test_extreme_values_have_facts(scale):
    record = Dataset(scale * slow(500, 0), scale * slow(500, 1), 1.0)
    assert measure_facts(record).facts


def test_unknown_fact_is_an_error():
    with pytest.raises(KeyError, match="colour"):
        measure_facts(Dataset(white(50, 0), white(50, 1), 1.0)).find("colour")


#: Measures the facts of a record with loops, and prints the imported modules that take long.
IMPORTS = """
import sys, numpy, islands.records.inspection.record_facts as record_facts
from islands.records.dataset import Dataset
u = numpy.sin(0.05 * numpy.arange(2000)) * numpy.sin(0.007 * numpy.arange(2000))
y = numpy.convolve(u, numpy.ones(9) / 9.0)[: u.size]
assert record_facts.measure_facts(Dataset(u, y, 0.01)).find("loop").value is not None
print(*sorted({name.partition(".")[0] for name in sys.modules} & {"scipy", "numba"}))
"""


@pytest.mark.ci
def test_facts_are_measured_without_libraries_that_take_a_second_to_import():
    """A service inspects every file in a new process."""
    done = subprocess.run([sys.executable, "-c", IMPORTS], capture_output=True, text=True, check=True)
    assert done.stdout == "\n"


@pytest.mark.parametrize(
    ("function", "name"),
    [
        ("find_quantisation", "quantisation"),
        ("estimate_dead_times", "dead-time"),
        ("check_rest", "rest"),
        ("check_loop", "loop"),
        ("measure_drift", "drift"),
        ("recommend_rate", "sampling-time"),
    ],
)
def test_a_fact_that_fails_leaves_the_others(function, name, monkeypatch):
    def fail(*_arguments):
        raise ZeroDivisionError("the fact fails")

    record = measure(steps(500, 0), lag(steps(500, 0), 5.0), 0.05)
    complete = measure_facts(record).facts
    monkeypatch.setattr(record_facts, function, fail)
    found = measure_facts(record)
    unknown = [fact for fact in found.facts if fact not in complete]
    assert {fact.name for fact in unknown} == {name}
    assert all("is not computed: ZeroDivisionError: the fact fails" in fact.sentence for fact in unknown)
    assert all(fact.value is None for fact in unknown)
    assert found.find("samples").value == 500.0
