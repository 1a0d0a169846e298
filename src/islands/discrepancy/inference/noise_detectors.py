"""A detector: finds in a record what its sampling and its noise have done to it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from islands.discrepancy.interfaces.effect import Scene, Signal


@dataclass(frozen=True, slots=True)
class Detection:
    """What a detector has found.

    Attributes
    ----------
    parameters : mapping
        Values by name, each with its unit.
    gained : float
        Minus twice the log-likelihood that naming it is worth, paid for as BIC does.
    """

    parameters: Mapping[str, tuple[float, str]]
    gained: float


@dataclass(frozen=True, slots=True)
class Detector:
    """An entry of the catalogue that changes no simulation.

    Attributes
    ----------
    name, family : str
    detect : callable
        ``(y, residual, scene) -> Detection or None``: the measured output and what the best simulation leaves
        of it, both over the fitted samples.
    source : str
    excluded_by : tuple of str
        Detectors before it that leave the same traces.
    """

    name: str
    family: str
    detect: Callable[[Signal, Signal, Scene], Detection | None]
    source: str
    excluded_by: tuple[str, ...] = ()
