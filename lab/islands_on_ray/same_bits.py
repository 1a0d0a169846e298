"""SHA-256 of the hall of fame of one job that is run in several ways, over seeds. Every line must say `same`.

    python -m lab.islands_on_ray.same_bits [--seeds 5]

Each run is a process of the command line: serial; on a Ray of one core and of two; on a cluster of two nodes;
with islands killed three times; with its coordinator killed and resumed; stopped by Ctrl-C and resumed.
"""

import argparse
import hashlib
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("RAY_AUTH_TOKEN", "0123456789abcdef0123456789abcdef")

from islands.records.writer import write_record
from islands.systems.catalogue import make_record
from support.command_line import COLUMNS, ISLANDS
from support.processes import actors, eventually

JOB = ("--preset", "paper-case1", "--set", "population=100", "--generations", "120", "--islands", "3")


class Job:
    def __init__(self, folder: Path, seed: int) -> None:
        self.folder, self.seed = folder, seed
        self.record = folder.parent / "record.csv"

    def start(self, name: str, *options: str, before: tuple[str, ...] = ()) -> subprocess.Popen[bytes]:
        out = self.folder / name
        command = (
            *(*before, ISLANDS, "identify", self.record, *COLUMNS, *JOB, "--seed", str(self.seed)),
            *("--out", out, *options),
        )
        return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)

    def resume(self, name: str) -> subprocess.Popen[bytes]:
        command = (ISLANDS, "identify", "--resume", self.folder / name)
        return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)

    def begun(self, name: str) -> None:
        eventually((self.folder / name / "checkpoint.json").exists)

    def sha256(self, name: str) -> str:
        return hashlib.sha256((self.folder / name / "hall.json").read_bytes()).hexdigest()


def finish(running: subprocess.Popen[bytes]) -> None:
    _, complained = running.communicate(timeout=300)
    if running.returncode:
        raise SystemExit(complained.decode())


def serial(job: Job, name: str, _address: str) -> None:
    finish(job.start(name, "--engine", "serial"))


def one_core(job: Job, name: str, _address: str) -> None:
    finish(job.start(name, "--engine", "ray", before=("taskset", "-c", "0")))


def two_cores(job: Job, name: str, _address: str) -> None:
    finish(job.start(name, "--engine", "ray"))


def two_nodes(job: Job, name: str, address: str) -> None:
    finish(job.start(name, "--ray-address", address))


def islands_killed(job: Job, name: str, _address: str) -> None:
    running = job.start(name, "--engine", "ray")
    job.begun(name)
    for _ in range(3):
        os.kill(eventually(lambda: actors(running.pid))[0], signal.SIGKILL)
        time.sleep(0.7)
    finish(running)


def coordinator_killed(job: Job, name: str, _address: str) -> None:
    running = job.start(name, "--engine", "ray")
    job.begun(name)
    time.sleep(1.0)
    running.kill()
    running.communicate()
    finish(job.resume(name))


def stopped(job: Job, name: str, _address: str) -> None:
    running = job.start(name, "--engine", "ray")
    job.begun(name)
    time.sleep(1.0)
    running.send_signal(signal.SIGINT)
    finish(running)
    finish(job.resume(name))


WAYS = (serial, one_core, two_cores, two_nodes, islands_killed, coordinator_killed, stopped)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5)
    given = parser.parse_args()
    import islands_service.runtime  # noqa: F401 - what Ray reads from the environment is set before it comes
    from ray.cluster_utils import Cluster  # isort: skip

    nodes = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    nodes.add_node(num_cpus=1)
    differ = 0
    try:
        with tempfile.TemporaryDirectory() as parent:
            write_record(
                make_record("bouc-wen-piezo", "authors", "estimation")[:20_000], Path(parent) / "record.csv"
            )
            for seed in range(given.seeds):
                folder = Path(parent) / f"seed-{seed}"
                folder.mkdir()
                job = Job(folder, seed)
                for way in WAYS:
                    way(job, way.__name__, nodes.address)
                    same = job.sha256(way.__name__) == job.sha256("serial")
                    differ += not same
                    print(
                        f"seed {seed} {way.__name__:20s} {job.sha256(way.__name__)[:16]} "
                        f"{'same' if same else 'DIFFERS'}",
                        flush=True,
                    )
    finally:
        nodes.shutdown()
    print(f"{differ} of {given.seeds * len(WAYS)} differ")
    sys.exit(bool(differ))


if __name__ == "__main__":
    main()
