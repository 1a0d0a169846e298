"""Soak test: random kills and suspensions of a service's processes while jobs are submitted, run, cancelled.

    python -m lab.service.soak [--database sqlite|postgresql] [--kills 500] [--minutes M] [--seed 0]
        [--json FILE]

At the end no accepted job may be lost, none may be run twice, and every result must equal that of the same
job before the first kill byte for byte. Otherwise the exit status is 1.
"""

import argparse
import json
import math
import os
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lab.service.killer import Killer
from support.databases import Server, server
from support.processes import alive
from support.service_client import TERMINAL
from support.service_processes import Service, serving

#: Number of different jobs.
SEEDS = 5

#: Generations of a job.
GENERATIONS = 40

#: Number of jobs that are queued or running at the same time.
ACTIVE = 4

#: Fraction of the jobs that are cancelled.
CANCELLED = 0.3

#: Fraction of the cancelled jobs that are resumed.
RESUMED = 0.5

#: Time limit in seconds for all jobs to end after the last kill.
CALM = 600.0


@dataclass
class Found:
    """Result of a soak test; the last three fields must be 0."""

    kills: dict[str, int] = field(default_factory=Counter)
    jobs: int = 0
    states: dict[str, int] = field(default_factory=Counter)
    resubmitted: int = 0
    given_up_and_resumed: int = 0
    most_attempts: int = 0
    seconds_of_a_job: float = 0.0
    seconds: float = 0.0
    load: float = 0.0
    lost: int = 0
    duplicated: int = 0
    different: int = 0

    @property
    def good(self) -> bool:
        return self.lost == self.duplicated == self.different == 0


class Soak:
    """Client that submits jobs and records every acknowledged submission.

    Attributes
    ----------
    promised : dict
        Job id that was returned for every idempotency key.
    """

    def __init__(self, service: Service, chance: random.Random, found: Found) -> None:
        self._service, self._chance, self._found = service, chance, found
        self.promised: dict[str, str] = {}
        self._seeds: dict[str, int] = {}
        self._open: set[str] = set()
        self._to_cancel: set[str] = set()
        self._cancelled: set[str] = set()
        self._expected: dict[int, bytes] = {}

    def prepare(self) -> None:
        """Run every job once without kills."""
        jobs = {seed: self._submit(f"undisturbed {seed}", seed) for seed in range(SEEDS)}
        self._expected = {0: self._service.found(jobs[0])}  # and Ray has started
        began = time.monotonic()
        self._expected = {seed: self._service.found(job) for seed, job in jobs.items()}
        self._found.seconds_of_a_job = (time.monotonic() - began) / (SEEDS - 1)
        assert len(set(self._expected.values())) > 1
        self._open.clear()

    def step(self) -> None:
        """Submit new jobs, repeat some submissions, cancel some jobs, and check which have ended."""
        while len(self._open) < ACTIVE:
            number = len(self.promised)
            job = self._submit(f"job {number}", number % SEEDS)
            if self._chance.random() < CANCELLED:
                self._to_cancel.add(job)
        self._ask_again(self._chance.choice(list(self.promised)))
        for job in sorted(self._open):
            self._look(job)

    def finish(self) -> None:
        """Wait for all jobs that have not ended."""
        until = time.monotonic() + CALM
        while self._open and time.monotonic() < until:
            for job in sorted(self._open):
                self._look(job)
            time.sleep(0.1)

    def judge(self) -> None:
        """Compare the stored jobs with the acknowledged submissions."""
        listed = self._listed()
        known = set(self.promised.values())
        self._found.jobs = len(known)
        self._found.lost = len(known - listed.keys()) + len(self._open)
        self._found.duplicated = len(listed.keys() - known) + len(self.promised) - len(known)
        for key, job in self.promised.items():
            self._judge(key, job, listed.get(job))

    def _judge(self, key: str, job: str, document: dict[str, Any] | None) -> None:
        if document is None:
            return
        state = document["state"]
        self._found.states[state] += 1
        self._found.most_attempts = max(self._found.most_attempts, document["attempt"])
        if state == "succeeded":
            same = self._service.models(job) == self._expected[self._seeds[job]]
            self._found.different += not (same and self._once(job))
        elif not (state == "cancelled" and job in self._cancelled):
            print(f"{key} is {state}: {document['problem']}")
            self._found.lost += 1

    def _once(self, job: str) -> bool:
        """Return whether a job's events have no gap and it has succeeded exactly once."""
        text = self._service.ask("GET", f"/v1/jobs/{job}/events").text
        events = [
            dict(line.split(": ", 1) for line in each.splitlines()) for each in text.split("\n\n") if each
        ]
        numbers = [int(event["id"]) for event in events]
        kinds = [event["event"] for event in events]
        return numbers == list(range(1, len(events) + 1)) and kinds.count("succeeded") == 1

    def _submit(self, key: str, seed: int) -> str:
        job = self._service.submit(GENERATIONS, key=key, seed=seed)
        self.promised[key], self._seeds[job] = job, seed
        self._open.add(job)
        return job

    def _ask_again(self, key: str) -> None:
        job = self.promised[key]
        again = self._service.submit(GENERATIONS, key=key, seed=self._seeds[job])
        self._found.resubmitted += 1
        self._found.duplicated += again != job

    def _look(self, job: str) -> None:
        state = (document := self._service.job(job))["state"]
        if state not in TERMINAL:
            if job in self._to_cancel and self._chance.random() < 0.3:
                self._to_cancel.discard(job)
                self._cancelled.add(job)
                self._service.ask("POST", f"/v1/jobs/{job}/cancel")
        elif state == "failed" and document["problem"]["type"] == "no-progress":
            self._found.given_up_and_resumed += 1
            self._service.ask("POST", f"/v1/jobs/{job}/resume")
        elif state == "cancelled" and job in self._cancelled and self._chance.random() < RESUMED:
            self._cancelled.discard(job)
            self._service.ask("POST", f"/v1/jobs/{job}/resume")
        else:
            self._open.discard(job)

    def _listed(self) -> dict[str, dict[str, Any]]:
        found: dict[str, dict[str, Any]] = {}
        cursor: dict[str, str] = {}
        while True:
            page = self._service.ask("GET", "/v1/jobs", params={"limit": "200", **cursor}).json()
            found |= {job["id"]: job for job in page["items"]}
            if page["next"] is None:
                return found
            cursor = {"cursor": page["next"]}


@contextmanager
def _database(name: str) -> Iterator[Server | None]:
    if name == "sqlite":
        yield None
    else:
        with server() as started:
            yield started


def soak(folder: Path, database: str, kills: int, seed: int, minutes: float) -> Found:
    """Kill processes of a service at random; return what happened to its jobs."""
    found, began = Found(), time.monotonic()
    with _database(database) as postgres:
        environment = {} if postgres is None else {"ISLANDS_DATABASE": postgres.url}
        with serving(folder, patience=CALM, environment=environment) as service:
            client = Soak(service, random.Random(seed), found)
            client.prepare()
            killer = Killer(
                service, postgres, kills, random.Random(seed + 1), found.seconds_of_a_job, found.kills
            )
            killer.start()
            reported = 0
            while not killer.over.wait(0.1):
                client.step()
                if time.monotonic() - began > 60.0 * minutes:
                    killer.over.set()
                if sum(found.kills.values()) >= reported + 20:
                    reported = sum(found.kills.values())
                    print(
                        f"{reported} kills, {len(client.promised)} jobs, {time.monotonic() - began:.0f} s",
                        flush=True,
                    )
            client.finish()
            client.judge()
            killer.may_end.set()
            killer.join()
            assert alive([service.process.pid])
    found.seconds = time.monotonic() - began
    found.load = os.getloadavg()[1]
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--database", choices=("sqlite", "postgresql"), default="sqlite")
    parser.add_argument("--kills", type=int, default=500)
    parser.add_argument("--minutes", type=float, default=math.inf, help="Kill nothing after this time.")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--folder", type=Path, help="Keep the service's data and its log there.")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="islands-soak-", ignore_cleanup_errors=True) as temporary:
        folder = given.folder or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        found = soak(folder / "data", given.database, given.kills, given.seed, given.minutes)
    for name, value in vars(found).items():
        print(f"{name.replace('_', ' '):24s} {dict(value) if isinstance(value, dict) else value}")
    if given.json:
        given.json.write_text(json.dumps(vars(found), indent=2))
    return 0 if found.good else 1


if __name__ == "__main__":
    sys.exit(main())
