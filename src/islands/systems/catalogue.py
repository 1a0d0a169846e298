"""The table of simulated systems: what the command line lists and makes, and what the tests run through."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from islands.data.dataset import Dataset
from islands.errors import SettingsError
from islands.systems import appendix, bouc_wen, signals
from islands.systems.bouc_wen import AUTHORS_SEED, DT


@dataclass(frozen=True, slots=True)
class SimulatedSystem:
    """A simulated system and the records that can be made of it.

    Attributes
    ----------
    name : str
        How it is asked for.
    description : str
        One line.
    variants, parts : tuple of str
        Every variant has every part; the first of each is the usual one.
    make : callable
        ``make(variant, part, seed) -> Dataset``. Arguments of the tuples above; a part without chance in it
        leaves the seed aside.
    """

    name: str
    description: str
    variants: tuple[str, ...]
    parts: tuple[str, ...]
    make: Callable[[str, str, int], Dataset]


# Each begins at u = 0, so h = 0 is where the actuator rests. The lagging slope belongs to the authors'
# noise alone (their sine has none), so both variants share these tests of a model.
_PIEZO_TESTS: Mapping[str, Callable[[], signals.Signal]] = {
    "sine-20V": lambda: signals.sine(DT, 20.0, 20.0, 1.0),
    "sine-0.25Hz": lambda: signals.sine(DT, 20.0, 40.0, 0.25),
    "sine-5Hz": lambda: signals.sine(DT, 20.0, 40.0, 5.0),
    "hold-loading": lambda: signals.hold_signal(DT, 20.0, amplitude=40.0, frequency=1.0, level=20.0),
    "hold-unloading": lambda: signals.hold_signal(
        DT, 20.0, amplitude=40.0, frequency=1.0, level=20.0, loading=False
    ),
    "minor-loops": lambda: signals.minor_loops(DT, amplitude=40.0, frequency=1.0),
}

# The authors' estimation record is fixed by its publication; legacy seeds have 32 bits.
_PIEZO_RECORDS: Mapping[tuple[str, str], Callable[[int], Dataset]] = {
    ("authors", "estimation"): lambda _: bouc_wen.authors_estimation(),
    ("authors", "validation"): lambda _: bouc_wen.authors_validation(),
    ("authors", "noise-2"): lambda seed: bouc_wen.authors_estimation((AUTHORS_SEED + 1 + seed) % 2**32),
    ("consistent", "estimation"): bouc_wen.consistent_estimation,
    ("consistent", "validation"): lambda _: bouc_wen.consistent_validation(),
    ("consistent", "noise-2"): lambda seed: bouc_wen.consistent_estimation(
        np.random.SeedSequence(seed, spawn_key=(1,))
    ),
}


def _piezo(variant: str, part: str, seed: int) -> Dataset:
    if part in _PIEZO_TESTS:
        return bouc_wen.respond(_PIEZO_TESTS[part]())
    return _PIEZO_RECORDS[variant, part](seed)


def _appendix(system: appendix.OutputErrorSystem) -> Callable[[str, str, int], Dataset]:
    parts: Mapping[str, Callable[[str, int], Dataset]] = {
        "estimation": lambda scaling, seed: appendix.soft_record(system, seed, scaling),
        "validation": lambda _, seed: appendix.white_record(system, seed),
    }
    return lambda variant, part, seed: parts[part](variant, seed)


#: Name to entry; a new system is one entry here.
SYSTEMS: Mapping[str, SimulatedSystem] = {
    system.name: system
    for system in (
        SimulatedSystem(
            name="bouc-wen-piezo",
            description="Piezoelectric actuator with Bouc-Wen hysteresis, equation (11)",
            variants=("authors", "consistent"),
            parts=("estimation", "validation", *_PIEZO_TESTS, "noise-2"),
            make=_piezo,
        ),
        SimulatedSystem(
            name="s1",
            description="Bilinear output-error system S1 of equation (A.1); variants scale the soft input",
            variants=tuple(appendix.SCALINGS),
            parts=("estimation", "validation"),
            make=_appendix(appendix.S1),
        ),
        SimulatedSystem(
            name="s2",
            description="Rational output-error system S2 of equation (A.1); variants scale the soft input",
            variants=tuple(appendix.SCALINGS),
            parts=("estimation", "validation"),
            make=_appendix(appendix.S2),
        ),
    )
}


def make_record(name: str, variant: str, part: str, seed: int = 0) -> Dataset:
    """Make one record of one system.

    Parameters
    ----------
    name, variant, part : str
        A key of `SYSTEMS` and a variant and a part of that entry.
    seed : int
        Not negative. The same four arguments give the same bits.

    Raises
    ------
    SettingsError
        One of the names is unknown, and the message lists those there are; or the seed is negative.
    """
    system = SYSTEMS[_known("system", name, tuple(SYSTEMS))]
    _known(f"variant of {name}", variant, system.variants)
    _known(f"part of {name}", part, system.parts)
    if seed < 0:
        raise SettingsError(f"a seed is a whole number from 0 on, got {seed}")
    return system.make(variant, part, seed)


def _known(kind: str, wanted: str, there: tuple[str, ...]) -> str:
    if wanted not in there:
        raise SettingsError(f"no {kind} is called {wanted!r}: there is {', '.join(there)}")
    return wanted
