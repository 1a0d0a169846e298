"""Table of fitness functions, which evolution minimises."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

#: Returns the samples of a shooting interval, given the setting ``shooting``; None means a free run.
ShootingInterval = Callable[[int], int | None]


def _one_step_ahead(_shooting: int) -> int | None:
    """Error of the one-step-ahead prediction."""
    return 1


def _shooting(shooting: int) -> int | None:
    """Error of multiple shooting over intervals of ``shooting`` samples."""
    return shooting


def _free_run(_shooting: int) -> int | None:
    """Error of the free run over the whole record."""
    return None


FITNESSES: Mapping[str, ShootingInterval] = MappingProxyType(
    {"one-step": _one_step_ahead, "shooting": _shooting, "free-run": _free_run}
)

#: Kind of simulation whose error a fitness function is, an entry of `islands.validation.assessment.MODES`.
FITNESS_MODES: Mapping[str, str] = MappingProxyType(
    {"one-step": "one_step_ahead", "shooting": "multiple_shooting", "free-run": "free_run"}
)
