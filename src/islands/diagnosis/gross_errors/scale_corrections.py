"""Corrections of scales: wrong sampling time, wrong unit of the output or the input, flipped sign."""

from collections.abc import Iterator, Set
from dataclasses import replace
from math import pi

from islands.diagnosis.gross_errors.correction import Correction
from islands.records.dataset import Dataset

#: Factors between units that are confused, each with an example; their inverses are tried as well.
UNIT_FACTORS = (
    (10.0, "mm and cm"),
    (100.0, "a fraction and per cent"),
    (1e3, "m and mm"),
    (1e6, "m and um"),
    (9.80665, "kgf and N"),
    (2 * pi, "revolutions and radians"),
    (180 / pi, "radians and degrees"),
    (60.0, "revolutions per second and per minute"),
    (30 / pi, "rad/s and revolutions per minute"),
    (25.4, "inches and mm"),
    (3.6, "m/s and km/h"),
)

#: Factors of a wrong sampling time; their inverses are tried as well.
TIME_FACTORS = (2.0, 4.0, 5.0, 10.0, 20.0, 50.0, 60.0, 100.0, 1e3)


def correct_sampling_time(record: Dataset) -> Iterator[Correction]:
    """Yield the record with other sampling times."""
    for size in TIME_FACTORS:
        for factor in (size, 1.0 / size):
            dt = record.dt / factor
            yield Correction(
                "sampling-time",
                replace(record, dt=dt),
                f"The sampling time seems to be {dt:.6g} s, and not {record.dt:.6g} s.",
                f"Give {dt:.6g} s as the sampling time (option dt), or correct the time column.",
                {"factor": (factor, ""), "sampling time": (dt, "s")},
            )


def correct_output_unit(record: Dataset) -> Iterator[Correction]:
    """Yield the record with the output in other units."""
    name = record.output_name
    for factor, words in _list_factors(name):
        yield Correction(
            "output-unit",
            _divide_output(record, factor),
            f"The output {name} seems to be in another unit than that of the simulation: {words}",
            _advise(name, factor),
            {"factor": (factor, "")},
            scale=1.0 / factor,
        )


def correct_input_unit(record: Dataset, read: Set[str] = frozenset()) -> Iterator[Correction]:
    """Yield the record with the input, or a channel that the simulation reads, in other units."""
    for place, role, name in _list_driving_signals(record, read):
        for factor, words in _list_factors(name):
            yield Correction(
                "input-unit",
                _scale_input(record, place, 1.0 / factor),
                f"The {role} {name} seems to be in another unit than that of the simulation: {words}",
                _advise(name, factor),
                {"factor": (factor, "")},
            )


def _list_driving_signals(record: Dataset, read: Set[str]) -> Iterator[tuple[int, str, str]]:
    """Yield place, role and name of the input and of each channel that the simulation reads."""
    for place, name in enumerate(record.input_names):
        if place == 0 or name in read:
            yield place, "channel" if place else "input", name


def _scale_input(record: Dataset, place: int, factor: float) -> Dataset:
    """Return the record with one of its inputs multiplied by a factor."""
    u = record.u.copy()
    u[:, place] *= factor
    return replace(record, u=u)


def _divide_output(record: Dataset, factor: float) -> Dataset:
    return replace(record, **record.change_outputs(lambda y: y / factor))


def _list_factors(name: str) -> Iterator[tuple[float, str]]:
    """Yield each factor of a recorded signal, with the words for it."""
    for size, example in UNIT_FACTORS:
        for factor in (size, 1.0 / size):
            many = f"{factor:.6g} times" if factor > 1.0 else f"1/{size:.6g} of"
            yield factor, f"{name} is {many} the value that the simulation expects, as between {example}."


def _advise(name: str, factor: float) -> str:
    """Return the advice to correct a signal that was multiplied by a factor."""
    change = f"Divide column {name} by {factor:.6g}"
    if factor < 1.0:
        change = f"Multiply column {name} by {1.0 / factor:.6g}"
    return f"{change}, or give the parameters of the simulation in its unit."


def correct_sign(record: Dataset, read: Set[str] = frozenset()) -> Iterator[Correction]:
    """Yield the record with the output, the input, or a channel that the simulation reads inverted."""
    inverted = [("output", record.output_name, _divide_output(record, -1.0), -1.0)]
    inverted += [
        (role, name, _scale_input(record, place, -1.0), 1.0)
        for place, role, name in _list_driving_signals(record, read)
    ]
    for role, name, corrected, scale in inverted:
        yield Correction(
            "sign",
            corrected,
            f"The sign of the {role} {name} seems to be flipped.",
            f"Multiply column {name} by -1, or choose the direction of the simulation accordingly.",
            scale=scale,
        )
