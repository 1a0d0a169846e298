"""Table of estimators, without their functions: command line and job validation import it in milliseconds.

A `Criterion` states which estimator gave the parameters of a model, and which error they minimise.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

#: Standard errors within which an estimated parameter does not differ from zero.
SIGNIFICANT = 2.0


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


@dataclass(frozen=True, slots=True)
class Criterion:
    """Error that the parameters of a model minimise on the estimation data.

    Attributes
    ----------
    estimator : str
        An entry of ``ESTIMATORS``; ``box-jenkins`` for the linear model of `identify_linear`.
    interval : int or None
        Samples of the interval over which predictions are fed back: 1 for the one-step-ahead error, None for
        that of the free run, and else the error of multiple shooting.
    """

    estimator: str
    interval: int | None

    @property
    def error(self) -> str:
        """Name of the error, as of the metrics of a result."""
        return {1: "one_step_ahead", None: "free_run"}.get(self.interval, "multiple_shooting")


#: What is estimated again on estimation and validation data after the ranking, by name.
REFITS: Mapping[str, str] = MappingProxyType(
    {
        "none": "nothing: the validation data have no part in the parameters",
        "all": "the parameters of all ranked models",
    }
)

#: Criterion of least squares.
LEAST_SQUARES = Criterion("least-squares", 1)

#: Criterion of `identify_linear`: the free-run error after a filter that makes it white.
BOX_JENKINS = Criterion("box-jenkins", None)


def make_criterion(estimator: str, shooting: int) -> Criterion:
    """Return the criterion of an entry of ``ESTIMATORS`` for a shooting interval of the settings."""
    return Criterion(estimator, ESTIMATORS[estimator].interval(shooting))


def refinement_criterion(interval: int | None) -> Criterion:
    """Return the criterion of a refinement over an interval; None is the free run."""
    return Criterion("free-run" if interval is None else "shooting", interval)
