"""What becomes of an evaluation: success, or a failure that happens a thousand times in a search.

A failure is a value with a reason and advice, never an exception: exceptions are for a caller's mistake.
"""

from dataclasses import dataclass
from enum import Enum


class Status(Enum):
    """The kinds of outcome; the value is the advice."""

    OK = "nothing to do"
    DIVERGED = "the prediction left the bound: take fewer terms, other terms, or constrain the parameters"
    SINGULAR = (
        "the regressors depend on each other on this data: remove one, or excite the system more richly"
    )
    INFEASIBLE = "the structure cannot meet the constraints: change either as the reason says"
    TOO_FEW_ROWS = (
        "there are not more rows than parameters: take a longer record, fewer terms or smaller lags"
    )
    ABANDONED = "nothing to do: others are better"


@dataclass(frozen=True, slots=True)
class EvaluationOutcome:
    """A verdict and its reason.

    Attributes
    ----------
    verdict : Status
        Its name is the kind, its value the advice.
    reason : str
        What happened, where; empty for OK.
    """

    verdict: Status = Status.OK
    reason: str = ""

    def __bool__(self) -> bool:
        return self.verdict is Status.OK

    def __str__(self) -> str:
        return "ok" if self else f"{self.verdict.name.lower()}: {self.reason}; {self.verdict.value}"


OK = EvaluationOutcome()
