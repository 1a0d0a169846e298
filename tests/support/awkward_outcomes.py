"""What the commands lead to for a file with a measurement of a known law."""

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path

import numpy as np
from typer.testing import CliRunner

import islands
from islands.records.dataset import Dataset
from islands_api.cli.app import app
from support.awkward_records import SAMPLES, AwkwardRecord
from support.command_line import stored
from support.known_laws import LAWS, WARM_UP, Measurement, find_least_error, measure

#: Largest ratio of the error of a right result to that of the true structure.
CLOSE = 1.2

#: Seeds of the test records differ from those of the records by this number.
TEST = 1000

RIGHT, REFUSED, ANNOUNCED, SILENT = "right", "refused", "announced", "SILENTLY WRONG"


@dataclass(frozen=True)
class Outcome:
    """What a command leads to: the kind, the ratio of errors, and the words that announce a wrong result."""

    kind: str
    ratio: float
    words: str


def find_ratio(record: AwkwardRecord, folder: Path, least: float, test: Measurement) -> tuple[float, str]:
    """Return the error of the free run of a result relative to the least one, and the sampling time read."""
    document, best = stored(folder), islands.load(folder).best
    names, dt = document["record"]["names"], document["record"]["dt"]
    if abs(dt - record.dt) > 0.01 * record.dt:
        return inf, f"sampling time {dt:.6g} s, not {record.dt:g} s; "
    y = record.factor * np.concatenate((test.clean[:WARM_UP], test.y[WARM_UP:]))
    data = Dataset(
        record.factor * test.u,
        y,
        dt,
        tuple(each.removesuffix("+1") for each in names["inputs"]),
        names["output"],
    )
    if document["preprocessing"]["average"] == 1:
        errors = (best.predict(data) - y)[max(WARM_UP, best.model.maximum_lag) :]
        error = float(np.sqrt(np.mean(errors**2)))
    else:
        error = float(np.sqrt(best.simulate(data).mean_squared_error))
    return (error / (record.factor * least) if np.isfinite(error) else inf), ""


def run(arguments: Sequence[str]) -> tuple[int, str]:
    """Run a command; return its exit code and its output on one line."""
    done = CliRunner().invoke(app, list(arguments))
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        return 99, f"{type(done.exception).__name__}: {done.exception}"
    return done.exit_code, done.output


def fit(
    record: AwkwardRecord, arguments: Sequence[str], folder: Path, least: float, test: Measurement
) -> Outcome:
    """Run a command that writes a result into a folder, and assess the result."""
    code, printed = run([*arguments, "--out", str(folder), "--figures", "none"])
    printed = " ".join(printed.split())
    if code == 99:
        return Outcome(SILENT, inf, printed)
    if code:
        return Outcome(REFUSED, inf, printed)
    ratio, words = find_ratio(record, folder, least, test)
    verdict = re.search(r"As a simulation: ([^.(]*)", printed)
    fails = re.search(r"Fails at: (.*?) Next:", printed)
    words += f"{verdict[1].strip() if verdict else ''}; {fails[1] if fails else ''}"
    if ratio <= CLOSE:
        return Outcome(RIGHT, ratio, "")
    is_good = (verdict is None or verdict[1].startswith("good")) and "may be saturated" not in printed
    return Outcome(SILENT if is_good else ANNOUNCED, ratio, words)


def find_suggested(path: Path, words: Sequence[str], given: Sequence[str]) -> list[str]:
    """Return the command that `islands inspect` prints for a file, with fit in place of identify."""
    code, printed = run(["inspect", str(path), *words, *given])
    if code:
        return []
    command = printed.partition("Next:")[2].replace("\\\n", " ")
    suggested = shlex.split(command)[1:]
    suggested[0] = "fit"
    end = suggested.index("--out")
    return suggested[:end]


def assess(record: AwkwardRecord, seed: int, folder: Path) -> tuple[Outcome, Outcome]:
    """Return what the defaults and the suggested command lead to for a record."""
    law = LAWS[record.law]
    own, test = (measure(law, record.dt, SAMPLES, number) for number in (seed, seed + TEST))
    path = folder / record.name
    record.write(path, own)
    least = find_least_error(law, own, test)
    words = [word for name in record.inputs for word in ("--input", name)] + ["--output", record.output]
    default = ["fit", str(path), *words, *record.given]
    outcome = fit(record, default, folder / "default", least, test)
    suggested = find_suggested(path, words, record.given)
    if sorted(suggested) == sorted(default):
        return outcome, outcome
    if not suggested:
        return outcome, Outcome(REFUSED, inf, "inspect suggests no command")
    return outcome, fit(record, suggested, folder / "suggested", least, test)
