"""Origin of a result: what the head of a report states besides the result."""

from dataclasses import dataclass
from datetime import UTC, date, datetime

from islands.distribution import read_version

#: Report in the folder of a result.
REPORT_FILE = "report.html"

#: Digits of a SHA-256 in the head of a report. The appendix has all of them.
_DIGITS = 12


@dataclass(frozen=True, slots=True)
class Origin:
    """Where a result comes from.

    Attributes
    ----------
    name : str
        Name of the record or of the job.
    day : date or None
        Day of the result (UTC); None if it is unknown.
    owner : str
        Owner of the job; empty if there is none.
    job : str
        Id of the job; empty if there is none.
    """

    name: str
    day: date | None = None
    owner: str = ""
    job: str = ""

    @classmethod
    def from_seconds(cls, name: str, seconds: float, owner: str = "", job: str = "") -> "Origin":
        """Return the origin of a result at a time in seconds since 1970."""
        return cls(name, datetime.fromtimestamp(seconds, UTC).date(), owner, job)

    def list_facts(self, *sha256: str) -> list[str]:
        """Return what is known: day, version, data sets, owner and job.

        Parameters
        ----------
        *sha256 : str
            SHA-256 of every data set.
        """
        return [
            *([] if self.day is None else [self.day.isoformat()]),
            f"islands {read_version()}",
            *(f"data set {each[:_DIGITS]}" for each in sha256),
            *([f"owner {self.owner}"] if self.owner else []),
            *([f"job {self.job}"] if self.job else []),
        ]
