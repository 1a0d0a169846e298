"""Progress callbacks of long computations, requests to stop them, and their optional steps."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import exp
from pathlib import Path
from typing import Any, Protocol, TypeVar

from islands.errors import IslandsError, check_callables
from islands.parallel import ParallelMap

A = TypeVar("A")
R = TypeVar("R")

#: Fraction from which the time left is estimated.
MIN_FRACTION = 0.1

#: Seconds for which no time left is estimated.
_FIRST_SECONDS = 1.0

#: Part of the time left after which an estimate without a further report is not shown.
_VALID_PART = 0.75

#: Part of a phase up to which its steps count equally.
_REGULAR_PART = 0.75

#: Returns true if the computation must end.
Stop = Callable[[], bool]


class ProgressCallback(Protocol):
    """Callback for the progress of a long computation. It never influences the result."""

    def __call__(self, message: str, fraction: float | None = None, /) -> None:
        """Report progress.

        Parameters
        ----------
        message : str
            Description of the current step.
        fraction : float or None
            Completed part of the computation, from 0 to 1; None if unknown.
        """


def ignore_progress(_message: str, _fraction: float | None = None, /) -> None:
    """Ignore progress."""


def never_stop() -> bool:
    """Return that the computation may continue."""
    return False


@dataclass(frozen=True, slots=True)
class Phase:
    """Phase of a long computation.

    Attributes
    ----------
    beginning : str
        Beginning of the messages of the phase.
    share : float
        Its time relative to that of the other phases, as it was measured.
    steps : int
        Number of its messages with this beginning and of its parallel maps, as it was measured.
    unless : str
        Beginning of an earlier phase after which this one does not occur; empty if there is none.
    """

    beginning: str
    share: float
    steps: int = 1
    unless: str = ""


class PhasedProgress:
    """Progress callback that adds the completed fraction of the whole computation to messages.

    A phase that is skipped takes no time: its share is left out of the whole. Fractions never decrease.

    Parameters
    ----------
    progress : ProgressCallback
        Receives messages with fractions of the whole.
    phases : sequence of Phase
        In their order. A message belongs to the first phase with its beginning, from the present one on;
        one that belongs to none is part of the present phase.
    """

    def __init__(self, progress: ProgressCallback, phases: Sequence[Phase]) -> None:
        self._progress, self._phases = progress, phases
        self._message, self._fraction = "", 0.0
        self._present, self._before = 0, 0.0
        self._within, self._steps, self._has_begun = 0.0, 0, False
        self._begun: set[str] = set()

    @property
    def rest(self) -> float:
        """Time of the phases after the present one, relative to that of the present one."""
        return self._sum_following() / self._phases[self._present].share

    def _sum_following(self) -> float:
        """Return the shares of the phases after the present one."""
        following = self._phases[self._present + 1 :]
        return sum(phase.share for phase in following if phase.unless not in self._begun)

    def __call__(self, message: str, fraction: float | None = None, /) -> None:
        """Report a message, with the completed part of its phase if it is known."""
        found = self._find(message)
        if found is not None and found > self._present:
            self._before += self._phases[self._present].share if self._has_begun else 0.0
            self._present, self._within, self._steps = found, 0.0, 0
        elif found is not None and fraction is None and self._has_begun and message != self._message:
            self._steps += 1
            self._advance(0.0)
        if found is not None:
            self._within = max(self._within, min(fraction or 0.0, 1.0))
            self._has_begun = True
            self._begun.add(self._phases[found].beginning)
        self._message = message
        self._report()

    def count(self, parallel_map: ParallelMap) -> ParallelMap:
        """Return a map that reports how many of its calls have ended, as a part of the present phase."""

        def counted_map(function: Callable[[A], R], arguments: Iterable[A], /) -> Iterator[R]:
            listed = list(arguments)
            for ended, result in enumerate(parallel_map(function, listed), start=1):
                yield result
                self._advance(ended / len(listed))
                self._report()
            self._steps += 1

        return counted_map

    def _find(self, message: str) -> int | None:
        """Return the phase of a message; None if it belongs to none from the present one on."""
        for index in range(self._present, len(self._phases)):
            phase = self._phases[index]
            if message.startswith(phase.beginning) and phase.unless not in self._begun:
                return index
        return None

    def _advance(self, ended: float) -> None:
        within = (self._steps + ended) / self._phases[self._present].steps
        if within > _REGULAR_PART:
            # A phase with more steps than usual is never complete: each of them still counts.
            rest = 1.0 - _REGULAR_PART
            within = 1.0 - rest * exp(-(within - _REGULAR_PART) / rest)
        self._within = max(self._within, within)

    def _report(self) -> None:
        present = self._phases[self._present].share
        whole = self._before + present + self._sum_following()
        self._fraction = max(self._fraction, (self._before + self._within * present) / whole)
        self._progress(self._message, self._fraction)


def report_part(progress: ProgressCallback, begin: float, end: float) -> ProgressCallback:
    """Return a callback for a part of a computation, which takes it from one fraction to another."""

    def report(message: str, fraction: float | None = None, /) -> None:
        progress(message, None if fraction is None else begin + (end - begin) * fraction)

    return report


def prefix_messages(progress: ProgressCallback, title: str) -> ProgressCallback:
    """Return a callback that writes a title before the messages."""

    def report(message: str, fraction: float | None = None, /) -> None:
        progress(title + message, fraction)

    return report


class TimeLeft:
    """Estimate of the time that a computation still takes, from the fractions that it reports.

    It decreases between two reports. It is None in the first moments, and if no report has come during the
    larger part of the time that was left: then a step takes longer than expected.

    Parameters
    ----------
    began : float
        Time at which the computation began, in seconds by the clock of the caller.
    least : float
        Fraction from which the time left is estimated.
    """

    def __init__(self, began: float, least: float = MIN_FRACTION) -> None:
        self._began, self._least, self._fraction = began, least, 0.0
        self._estimate: tuple[float, float] | None = None

    def update(self, fraction: float, now: float) -> None:
        """Estimate the time left from the completed fraction; a smaller one begins another computation."""
        if fraction < self._fraction:
            self._began, self._estimate = now, None
        elif fraction > self._fraction and fraction >= self._least:
            self.expect((now - self._began) * (1.0 - fraction) / fraction, now)
        self._fraction = fraction

    def expect(self, seconds: float, now: float) -> None:
        """Take the time left from another estimate."""
        self._estimate = seconds, now

    def at(self, now: float) -> float | None:
        """Return the seconds left at a time; None if they are unknown."""
        if self._estimate is None or now - self._began < _FIRST_SECONDS:
            return None
        seconds, then = self._estimate
        return None if now - then > _VALID_PART * seconds else seconds - (now - then)


class TimeLimit:
    """Stop of a computation after a time, of which its parts can have shares.

    Parameters
    ----------
    end : float
        Time at which the computation stops, in seconds by the clock.
    clock : callable
        Returns the time in seconds.
    stop : callable
        Stops the computation earlier.
    """

    def __init__(self, end: float, clock: Callable[[], float], stop: Stop = never_stop) -> None:
        self._end, self._clock, self._stop = end, clock, stop

    def __call__(self) -> bool:
        """Return whether the computation must end."""
        return self._stop() or self._clock() >= self._end

    def share(self, parts: int) -> "TimeLimit":
        """Return the limit of the first of several parts that share the time left equally."""
        now = self._clock()
        return TimeLimit(now + (self._end - now) / parts, self._clock, self._stop)


class StoppedError(IslandsError):
    """A computation was stopped.

    Attributes
    ----------
    step : str
        Step that was left out.
    """

    def __init__(self, step: str) -> None:
        super().__init__(f"stopped before this step: {step}")
        self.step = step


class AnswerFoundError(IslandsError):
    """A computation has its answer, and the caller wants no optional step.

    A callback that receives the answer raises it.

    Attributes
    ----------
    found : object
        The answer, without the optional steps.
    """

    def __init__(self, found: Any, reason: str) -> None:
        super().__init__(reason)
        self.found = found


@dataclass(frozen=True, slots=True)
class Failure:
    """Why an optional step has no value.

    Attributes
    ----------
    reason : str
        See `explain_failure`.
    """

    reason: str


def attempt(compute: Callable[[], R]) -> R | Failure:
    """Return what an optional step computes, or why it fails.

    A step that comes after the answer, such as a figure of it, must not take the answer away.

    Parameters
    ----------
    compute : callable

    Raises
    ------
    StoppedError
        A stop was requested within the step.
    """
    try:
        return compute()
    except StoppedError:
        raise
    except Exception as error:
        return Failure(explain_failure(error))


def explain_failure(error: Exception) -> str:
    """Return the message of a deliberate error; class, message and place of any other one."""
    if isinstance(error, IslandsError):
        return str(error)
    place = error.__traceback__
    while place is not None and place.tb_next is not None:
        place = place.tb_next
    text = ": ".join(filter(None, (type(error).__name__, str(error))))
    return (
        text
        if place is None
        else f"{text} ({Path(place.tb_frame.f_code.co_filename).name}, line {place.tb_lineno})"
    )


class Steps:
    """Steps of a long computation, which a stop request ends between two of them.

    A computation calls this object at the start of every step without which it has no result. Every other
    step is optional: it is computed by `attempt`, or begins with `skip`.

    Parameters
    ----------
    progress : ProgressCallback
    stop : callable
        Returns true once a stop is requested, and from then on.
    """

    def __init__(self, progress: ProgressCallback = ignore_progress, stop: Stop = never_stop) -> None:
        check_callables(progress=progress, stop=stop)
        self._progress, self._stop = progress, stop
        self._raised: BaseException | None = None
        self._left_out: dict[str, None] = {}
        self._not_computed: dict[str, str] = {}
        #: Why the optional steps from now on are not computed; empty if they are.
        self.refusal = ""

    def __call__(self, message: str, fraction: float | None = None, /) -> None:
        """Report a step that the result needs.

        Raises
        ------
        StoppedError
            A stop is requested.
        """
        self.check(message)
        self.report(message, fraction)

    def report(self, message: str, fraction: float | None = None, /) -> None:
        """Report progress, whether a stop is requested or not."""
        self.call(self._progress, message, fraction)

    def stop(self) -> bool:
        """Return whether a stop is requested."""
        return self.call(self._stop)

    def share_stop(self, parts: int) -> Stop:
        """Return the stop of the first of several parts, which share a limit of time equally."""
        return self._stop.share(parts) if isinstance(self._stop, TimeLimit) else self.stop

    def call(self, callback: Callable[..., R], *arguments: object) -> R:
        """Call a function of the caller, whose exceptions end the computation, also in an optional step."""
        try:
            return callback(*arguments)
        except BaseException as error:
            self._raised = error
            raise

    def check(self, step: str) -> None:
        """Raise `StoppedError` if a stop is requested within a step that the result needs."""
        if self.stop():
            raise StoppedError(step)

    def attempt(self, step: str, compute: Callable[[], R]) -> R | None:
        """Return what an optional step computes; None if it is left out, or fails.

        The name of the step is recorded in `left_out` or, with the reason, in `not_computed`.
        """
        if self.skip(step):
            return None
        if self.refusal:
            self._not_computed[step] = self.refusal
            return None
        self._raised = None
        try:
            found = attempt(compute)
        except StoppedError:
            self.leave_out(step)
            return None
        if isinstance(found, Failure):
            if self._raised is not None:
                raise self._raised
            self._not_computed[step] = found.reason
            return None
        return found

    def skip(self, step: str) -> bool:
        """Return whether a step must be left out because a stop is requested, and record its name."""
        if self.stop():
            self.leave_out(step)
            return True
        return False

    def leave_out(self, step: str) -> None:
        """Record a step that is left out."""
        self._left_out[step] = None

    def add(self, left_out: Iterable[str], not_computed: Mapping[str, str], part: str) -> None:
        """Record the steps that a part of the computation lacks, with the name of the part."""
        self._left_out |= {f"{part}: {step}": None for step in left_out}
        self._not_computed |= {f"{part}: {step}": reason for step, reason in not_computed.items()}

    @property
    def left_out(self) -> tuple[str, ...]:
        """Names of the steps that were left out, each once, in their order."""
        return tuple(self._left_out)

    @property
    def not_computed(self) -> dict[str, str]:
        """Optional steps that failed, each with the reason, in their order."""
        return dict(self._not_computed)
