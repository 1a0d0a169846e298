"""Connection to PostgreSQL that ends if the server is silent: suspended, or behind a stalled proxy or disk.

The kernel of such a server still acknowledges every packet, so that neither the keepalives of TCP nor
``tcp_user_timeout`` end the connection, and psycopg has no time limit for the answer to a statement.
"""

from collections.abc import Generator
from math import inf
from time import monotonic
from typing import Any, TypeVar

import psycopg

T = TypeVar("T")

#: Seconds without a byte from the server after which a statement fails. A statement may wait for a lock until
#: the server ends the transaction of a stopped process, which is sooner.
ANSWER_TIMEOUT = 12.0

#: The same for the check of a connection from the pool, which waits for no lock.
PING_TIMEOUT = 3.0


class TimedConnection(psycopg.Connection[Any]):
    """Connection that is closed when the server has not answered for some seconds.

    Attributes
    ----------
    patient : bool
        Whether statements may take any time, for example those of a migration.
    """

    patient = False

    def wait(self, gen: Generator[Any, Any, T], *arguments: Any, **options: Any) -> T:
        """Run a generator of psycopg to its end.

        Raises
        ------
        psycopg.OperationalError
            The server is silent. The connection is closed.
        """
        return super().wait(self._limit(gen), *arguments, **options)

    def _limit(self, generator: Generator[Any, Any, T]) -> Generator[Any, Any, T]:
        """Forward a generator, to which psycopg sends an event of the socket, or 0 ten times a second."""
        limit, heard = self._limit_seconds(), monotonic()
        try:
            wanted = next(generator)
            while True:
                ready = yield wanted
                if ready:
                    heard = monotonic()
                elif monotonic() - heard > limit:
                    self.close()
                    raise psycopg.OperationalError(f"the server has sent nothing for {limit:.0f} s")
                wanted = generator.send(ready)
        except StopIteration as end:
            result: T = end.value
            return result

    def _limit_seconds(self) -> float:
        if self.patient:
            return inf
        # Only the check of the pool runs outside a transaction.
        return PING_TIMEOUT if self.autocommit else ANSWER_TIMEOUT
