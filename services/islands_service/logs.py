"""Logs of the processes: their format, and one line for the beginning and the end of an outage."""

import logging
import sys
from collections.abc import Callable
from logging import WARNING
from time import monotonic

import structlog
from structlog.typing import Processor

log = structlog.get_logger()

#: Least number of seconds between two lines about failures.
EVERY = 60.0


def configure_logs(form: str, role: str) -> None:
    """Log as ``text`` or ``json`` and add the role to every line; warnings of libraries likewise."""
    shared: list[Processor] = [
        structlog.contextvars.merge_contextvars,
        structlog.processors.add_log_level,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
        structlog.processors.format_exc_info,
    ]
    renderer: Processor = (
        structlog.processors.JSONRenderer()
        if form == "json"
        else structlog.dev.ConsoleRenderer(colors=sys.stderr.isatty())
    )
    structlog.configure(
        processors=[*shared, renderer],
        wrapper_class=structlog.make_filtering_bound_logger(logging.INFO),
        logger_factory=structlog.PrintLoggerFactory(sys.stderr),
        cache_logger_on_first_use=True,
    )
    handler = logging.StreamHandler(sys.stderr)
    remove_meta = structlog.stdlib.ProcessorFormatter.remove_processors_meta
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(foreign_pre_chain=shared, processors=[remove_meta, renderer])
    )
    logging.basicConfig(handlers=[handler], level=logging.WARNING, force=True)
    structlog.contextvars.bind_contextvars(role=role)


class OutageLog:
    """Log of the failures of an operation that is repeated until it succeeds.

    The first failure is logged, the next one after `EVERY` seconds with the number of failures, and the first
    success. An outage that begins less than `EVERY` seconds after such a line is logged only if it lasts
    longer, so that an operation that fails now and then does not fill the log either. A failure that is more
    than `EVERY` seconds after the last one begins another outage.

    Parameters
    ----------
    failing, working : str
        Events at the begin and at the end.
    clock : callable
        Returns seconds.
    level : int
        Level of failures.
    """

    def __init__(
        self, failing: str, working: str, clock: Callable[[], float] = monotonic, level: int = WARNING
    ) -> None:
        self._failing, self._working, self._clock, self._level = failing, working, clock, level
        self._failures, self._began, self._failed_at, self._is_logged = 0, 0.0, 0.0, False
        self._next_line: float | None = None

    def fail(self, error: Exception, **details: object) -> None:
        """Log a failure, unless another one was logged less than a minute ago."""
        now = self._clock()
        if self._failures == 0 or now - self._failed_at > EVERY:
            self._failures, self._began = 0, now
        self._failures, self._failed_at = self._failures + 1, now
        if self._next_line is None or now >= self._next_line:
            repeated = {} if self._failures == 1 else self._summary(now)
            log.log(self._level, self._failing, reason=str(error), **details, **repeated)
            self._next_line, self._is_logged = now + EVERY, True

    def succeed(self, **details: object) -> None:
        """Log the end of an outage, if its failures were logged."""
        if self._is_logged:
            log.info(self._working, **details, **self._summary(self._clock()))
        self._failures, self._is_logged = 0, False

    def _summary(self, now: float) -> dict[str, float]:
        return {"failures": self._failures, "seconds": round(now - self._began, 1)}
