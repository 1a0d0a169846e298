"""Table of simulated systems, which the command line lists and simulates."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from islands.errors import SettingsError, lookup
from islands.records.dataset import Dataset
from islands.systems import appendix, bouc_wen, signals
from islands.systems.bouc_wen import AUTHORS_SEED, DT


@dataclass(frozen=True, slots=True)
class SimulatedSystem:
    """A simulated system and its records.

    Attributes
    ----------
    name : str
        Unique name.
    description : str
        One-line description.
    variants, parts : tuple of str
        Names of the variants and parts. Every variant has every part. The first of each is the default.
    make : callable
        ``make(variant, part, seed) -> Dataset``. Deterministic parts ignore the seed.
    """

    name: str
    description: str
    variants: tuple[str, ...]
    parts: tuple[str, ...]
    make: Callable[[str, str, int], Dataset]


# Each signal starts at u = 0, so h = 0 is an equilibrium. Only the authors' noise record has a lagging slope
# (their sine record has none), so both variants share these test signals.
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

# The authors' estimation record has its published seed. Legacy seeds have 32 bits.
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


def _make_piezo_record(variant: str, part: str, seed: int) -> Dataset:
    if part in _PIEZO_TESTS:
        return bouc_wen.simulate_record(_PIEZO_TESTS[part]())
    return _PIEZO_RECORDS[variant, part](seed)


def _appendix_factory(system: appendix.OutputErrorSystem) -> Callable[[str, str, int], Dataset]:
    parts: Mapping[str, Callable[[str, int], Dataset]] = {
        "estimation": lambda scaling, seed: appendix.soft_record(system, seed, scaling),
        "validation": lambda _, seed: appendix.white_record(system, seed),
    }
    return lambda variant, part, seed: parts[part](variant, seed)


#: Systems by name.
SYSTEMS: Mapping[str, SimulatedSystem] = {
    system.name: system
    for system in (
        SimulatedSystem(
            name="bouc-wen-piezo",
            description="Piezoelectric actuator with Bouc-Wen hysteresis, equation (11)",
            variants=("authors", "consistent"),
            parts=("estimation", "validation", *_PIEZO_TESTS, "noise-2"),
            make=_make_piezo_record,
        ),
        SimulatedSystem(
            name="s1",
            description="Bilinear output-error system S1 of equation (A.1); variants scale the soft input",
            variants=tuple(appendix.SCALINGS),
            parts=("estimation", "validation"),
            make=_appendix_factory(appendix.S1),
        ),
        SimulatedSystem(
            name="s2",
            description="Rational output-error system S2 of equation (A.1); variants scale the soft input",
            variants=tuple(appendix.SCALINGS),
            parts=("estimation", "validation"),
            make=_appendix_factory(appendix.S2),
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
        Not negative. Equal arguments give bit-identical records.

    Raises
    ------
    SettingsError
        A name is unknown (the message lists the known names), or the seed is negative.
    """
    system = lookup(SYSTEMS, name, "system")
    lookup(dict.fromkeys(system.variants), variant, f"variant of {name}")
    lookup(dict.fromkeys(system.parts), part, f"part of {name}")
    if seed < 0:
        raise SettingsError(f"a seed must not be negative, got {seed}")
    return system.make(variant, part, seed)
