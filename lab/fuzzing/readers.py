"""Fuzzing of all readers of records: a mutated file is read, or refused with an error for its owner.

    python -m lab.fuzzing.readers [--seconds 60] [--cases N] [--seed 0] [--suffix .csv ...]
    python -m lab.fuzzing.readers --families 1000000

Each format runs in child processes with limited memory, so that a crash of a library ends only its case. The
cases of a seed are always the same; a defect is printed with the numbers that repeat it. The exit status is 1
if there is a defect. With ``--families``, costly text files of a size and of twice the size are read instead;
a time that grows faster than the size is a defect.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from islands.records.reading import READERS, preview
from support.fuzzing import SLOW, Defect, corpus
from support.hostile_tables import FAMILIES, reading_seconds

ROOT = Path(__file__).parents[2]

#: Cases of one child process.
BATCH = 500

#: Largest growth of the time of a file of twice the size.
LARGEST_RATIO = 2.2

#: Folder of the mutated files; one in memory if there is one.
FOLDER = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None


def run_batch(suffix: str, seed: int, first: int, cases: int) -> tuple[int, list[Defect]]:
    """Run cases in a child process; return the number of those that ended, and the defects."""
    asked = {"suffix": suffix, "seed": seed, "first": first, "cases": cases, "folder": FOLDER}
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "OMP_NUM_THREADS": "1"}
    with (
        tempfile.TemporaryFile("w+") as complaints,
        subprocess.Popen(
            [sys.executable, "-W", "ignore", "-m", "support.fuzzing"],
            cwd=ROOT / "tests",
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=complaints,
            text=True,
        ) as child,
    ):
        assert child.stdin is not None
        assert child.stdout is not None
        json.dump(asked, child.stdin)
        child.stdin.close()
        ended, defects = 0, []
        for line in child.stdout:
            answer = json.loads(line)
            ended += 1
            if answer["reason"] is not None:
                defects.append(Defect(suffix, seed, answer["case"], answer["reason"]))
        child.wait()
        complaints.seek(0)
        complaint = complaints.read()[-2000:]
    if ended < cases:
        reason = f"the process ended with {child.returncode}: {complaint}"
        defects.append(Defect(suffix, seed, first + ended, reason))
        ended += 1
    return ended, defects


def measure_families(size: int) -> int:
    """Print the CPU time of each family at a size and at twice the size; return the number of defects."""
    defects = 0
    with tempfile.TemporaryDirectory(dir=FOLDER) as folder:
        path = Path(folder) / "r.csv"
        for name, write in FAMILIES.items():
            times = []
            for length in (size, 2 * size):
                path.write_bytes(write(length).encode())
                times.append(reading_seconds(preview, path, 2))
            grows = times[1] > max(0.05, LARGEST_RATIO * times[0])
            defects += grows
            print(f"{name:44} {times[0]:8.3f} s {times[1]:8.3f} s{'  DEFECT' if grows else ''}", flush=True)
    return defects


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="of all formats together")
    parser.add_argument("--cases", type=int, help="of each format, in place of --seconds")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--suffix", nargs="*", default=[each for each in READERS if corpus(each)])
    parser.add_argument("--families", type=int, metavar="BYTES", help="time of costly files of this size")
    options = parser.parse_args()
    if options.families:
        return 1 if measure_families(options.families) else 0
    count, defects = dict.fromkeys(options.suffix, 0), []
    for suffix in options.suffix:
        until = time.monotonic() + options.seconds / len(options.suffix)
        while count[suffix] < options.cases if options.cases else time.monotonic() < until:
            batch = min(BATCH, options.cases - count[suffix]) if options.cases else BATCH
            ended, found = run_batch(suffix, options.seed, count[suffix], batch)
            count[suffix] += ended
            defects += found
        print(f"{suffix:10} {count[suffix]:9,} cases", flush=True)
    for defect in defects:
        print(f"\n{defect.suffix}, seed {defect.seed}, case {defect.case}:\n{defect.reason}")
    print(f"\n{sum(count.values()):,} cases, {len(defects)} defects (a case may take {SLOW:g} s)")
    return 1 if defects else 0


if __name__ == "__main__":
    sys.exit(main())
