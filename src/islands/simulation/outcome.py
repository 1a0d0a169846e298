"""Outcome of an evaluation: success or an expected failure.

A search produces thousands of failures, so a failure is a value with a reason and advice. Exceptions are only
used for errors of the caller.
"""

from dataclasses import dataclass
from enum import Enum


class Status(Enum):
    """Kind of an outcome; the value is the advice."""

    OK = "nothing to do"
    DIVERGED = "the prediction left the bound: take fewer terms, other terms, or constrain the parameters"
    SINGULAR = (
        "the regressors are linearly dependent on this data: remove one, or excite the system more richly"
    )
    INFEASIBLE = "the structure cannot meet the constraints: change either as the reason says"
    TOO_FEW_ROWS = (
        "there are not more rows than parameters: take a longer record, fewer terms or smaller lags"
    )
    ABANDONED = "nothing to do: other individuals are better"


@dataclass(frozen=True, slots=True)
class EvaluationOutcome:
    """Status of an evaluation and its reason.

    Attributes
    ----------
    verdict : Status
        Status; its value is the advice.
    reason : str
        What happened and where. Empty for OK.
    """

    verdict: Status = Status.OK
    reason: str = ""

    def __bool__(self) -> bool:
        return self.verdict is Status.OK

    def __str__(self) -> str:
        return "ok" if self else f"{self.verdict.name.lower()}: {self.reason}; {self.verdict.value}"


OK = EvaluationOutcome()
