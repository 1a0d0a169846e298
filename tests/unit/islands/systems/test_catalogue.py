"""Table of simulated systems: every variant and part of every entry."""

import numpy as np
import pytest

from islands.errors import SettingsError
from islands.systems.catalogue import SYSTEMS, make_record

RECORDS = [
    (system.name, variant, part)
    for system in SYSTEMS.values()
    for variant in system.variants
    for part in system.parts
]
SAMPLING = {"bouc-wen-piezo": 1e-3, "s1": 1.0, "s2": 1.0}


@pytest.mark.parametrize(("name", "variant", "part"), RECORDS)
def test_every_record_is_finite_and_reproducible(name, variant, part):
    record, again = (make_record(name, variant, part, seed=5) for _ in range(2))
    assert record.dt == SAMPLING[name]
    assert record.samples >= 500
    assert np.isfinite(record.y).all()
    assert record.y.std() > 0.0
    assert (record.u.tobytes(), record.y.tobytes()) == (again.u.tobytes(), again.y.tobytes())
    assert record.start == again.start


@pytest.mark.parametrize("part", SYSTEMS["bouc-wen-piezo"].parts)
@pytest.mark.parametrize("variant", SYSTEMS["bouc-wen-piezo"].variants)
def test_piezo_starts_at_rest_except_in_the_authors_noise(variant, part):
    record = make_record("bouc-wen-piezo", variant, part)
    at_rest = abs(record.u[0, 0]) < 1e-6 and abs(record.y[0]) < 1e-6
    assert at_rest == ((variant, part) not in {("authors", "estimation"), ("authors", "noise-2")})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("piezo", "authors", "estimation"), r"unknown system 'piezo': take one of bouc-wen-piezo, s1, s2"),
        (("s1", "raw", "estimation"), r"unknown variant of s1 'raw': take one of rescaled, unit-gain"),
        (("s2", "rescaled", "test"), r"unknown part of s2 'test': take one of estimation, validation"),
        (("s1", "rescaled", "estimation", -1), r"a seed must not be negative, got -1"),
    ],
)
def test_unknown_name_error_lists_the_known_names(arguments, message):
    with pytest.raises(SettingsError, match=message):
        make_record(*arguments)
