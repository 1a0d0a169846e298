"""Table of estimators, without their functions: command line and job validation import it in milliseconds."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class Estimator:
    """An entry of the table. Its function has the same name in `islands.estimation.estimators`.

    Attributes
    ----------
    interval : callable
        Maps the shooting interval of the settings to that of the error which the estimate minimises, in
        samples: 1 for the one-step-ahead error, None for the free run.
    noise : str
        Noise for which the estimator is recommended: its estimates are consistent, and 95 % intervals contain
        the true parameters in 92 to 98 % of records.
    """

    interval: Callable[[int], int | None]
    noise: str


ESTIMATORS: Mapping[str, Estimator] = MappingProxyType(
    {
        "least-squares": Estimator(lambda _shooting: 1, "white equation noise"),
        "extended-least-squares": Estimator(lambda _shooting: 1, "coloured equation noise"),
        "shooting": Estimator(
            lambda shooting: shooting,
            "output noise, with intervals much longer than the memory of the system",
        ),
        "free-run": Estimator(lambda _shooting: None, "output noise"),
    }
)
