"""Random kills and suspensions of the processes of a service, and of its PostgreSQL server."""

import os
import random
import signal
import time
from contextlib import suppress
from threading import Event, Thread

from support.databases import Server
from support.processes import descendants
from support.service_processes import Service

#: Processes to kill, with relative frequencies. After the loss of a Ray process, recovery takes seconds.
VICTIMS = {"island": 10, "api": 4, "coordinator": 2, "raylet": 0.3, "gcs": 0.3, "head": 0.3}

#: Relative frequency of crashes and suspensions of PostgreSQL.
DATABASE = 1.0

#: Fraction of the victims that are suspended instead of killed.
SUSPENDED = 0.3

#: Range of the seconds for which a process is suspended: shorter and longer than the time after which the
#: supervisor, the deadline of an epoch or a lease replaces it.
SUSPENSION = (0.2, 15.0)

#: The same for PostgreSQL, and the seconds that it is away after a crash.
DATABASE_SUSPENSION, DATABASE_AWAY = (0.2, 8.0), 1.0

#: Range of the seconds between two kills if a job takes `JOB` seconds; scaled with the duration of a job, so
#: that jobs make progress between two kills on slower machines too.
PAUSE = (0.5, 2.0)

#: Reference duration of a job in seconds.
JOB = 3.0


class Killer(Thread):
    """Kills or suspends a given number of processes, one after the other.

    Parameters
    ----------
    service : Service
    database : Server or None
        PostgreSQL server that is struck, too.
    kills : int
    chance : Random
    seconds_of_a_job : float
    struck : dict
        Counts of what was done to each role.
    """

    def __init__(
        self,
        service: Service,
        database: Server | None,
        kills: int,
        chance: random.Random,
        seconds_of_a_job: float,
        struck: dict[str, int],
    ) -> None:
        super().__init__(name="killer", daemon=True)
        self._service, self._database, self._left = service, database, kills
        self._chance, self._struck = chance, struck
        self._slower = max(1.0, seconds_of_a_job / JOB)
        self._victims = {**VICTIMS, **({} if database is None else {"database": DATABASE})}
        # Times at which suspended processes are resumed.
        self._suspended: dict[int, float] = {}
        self.over, self.may_end = Event(), Event()

    def run(self) -> None:
        try:
            while self._left and not self._wait(self._slower * self._chance.uniform(*PAUSE)):
                self._strike_one()
        finally:
            for pid in list(self._suspended):
                self._resume(pid)
            self.over.set()
            # A PostgreSQL server that this thread has started receives a signal when the thread ends.
            self.may_end.wait()

    def _strike_one(self) -> None:
        (role,) = self._chance.choices(list(self._victims), list(self._victims.values()))
        suspends = self._chance.random() < SUSPENDED
        if role == "database":
            self._strike_database(suspends)
        else:
            pids = set(self._service.pids(role)) - self._suspended.keys()
            if not pids or not self._strike(self._chance.choice(sorted(pids)), suspends):
                return
        self._struck[f"{role} {'suspended' if suspends else 'killed'}"] += 1
        self._left -= 1

    def _wait(self, seconds: float) -> bool:
        """Wait until the next victim, resume processes meanwhile; return whether the end is requested."""
        until = time.monotonic() + seconds
        while (now := time.monotonic()) < until:
            for pid in [pid for pid, at in self._suspended.items() if at < now]:
                self._resume(pid)
            if self.over.wait(0.05):
                return True
        return False

    def _strike(self, pid: int, suspends: bool) -> bool:
        """Kill or suspend a process; return whether it still ran."""
        try:
            os.kill(pid, signal.SIGSTOP if suspends else signal.SIGKILL)
        except ProcessLookupError:
            return False
        if suspends:
            self._suspended[pid] = time.monotonic() + self._chance.uniform(*SUSPENSION)
        return True

    def _resume(self, pid: int) -> None:
        del self._suspended[pid]
        # It may have been killed, and another process may have its number now.
        if pid in descendants(self._service.process.pid):
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)

    def _strike_database(self, suspends: bool) -> None:
        assert self._database is not None
        if suspends:
            with self._database.frozen():
                self._wait(self._chance.uniform(*DATABASE_SUSPENSION))
        else:
            self._database.stop(signal.SIGQUIT)
            self._wait(DATABASE_AWAY)
            self._database.start()
