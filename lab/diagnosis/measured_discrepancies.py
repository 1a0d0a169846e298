"""Discrepancy analysis of measured records, compared with published figures.

    python -m lab.diagnosis.measured_discrepancies [NAME ...] [--clean N] [--injected N] [--json FILE]

A simulation with a known model error is compared with a part of each record. The simulation extended by the
named effects is then run on test data: unused parts of the record or separate records. Surrogates have the
noise of a record and either no model error or one injected effect. The records are read from
$ISLANDS_MEASURED_DIR.
"""

import argparse
import csv
import json
import os
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

for library in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(library, "1")

import numpy as np  # noqa: E402 - after the environment is set

import islands  # noqa: E402
from islands.diagnosis.result import Diagnosis  # noqa: E402
from islands.report.documents.extension import extended_document  # noqa: E402
from islands.simulators.specification.factory import make_simulator  # noqa: E402
from lab.diagnosis.self_test import diagnose_surrogate  # noqa: E402
from lab.diagnosis.surrogates import SurrogateCase, injection_strengths, make_surrogates  # noqa: E402

NAIVE = Path(__file__).parents[2] / "tests" / "support" / "naive_damper.py"
DATA = Path(os.environ.get("ISLANDS_MEASURED_DIR", Path(__file__).parents[3] / "shared/data"))


#: Reads a record.
Reader = Callable[[], islands.Dataset]


@dataclass(frozen=True)
class Case:
    """A record, a naive simulation of it, and the test data of the extended simulation.

    Attributes
    ----------
    record : callable
        Reads the record to diagnose.
    simulation : str
    tests : mapping of str to callable
        Test records; the first ``skip`` samples of each are not counted.
    skip : int
    scale, unit : float, str
        Scale and unit of the printed errors.
    published : str
    """

    record: Reader
    simulation: str
    tests: dict[str, Reader]
    skip: int = 0
    scale: float = 1.0
    unit: str = ""
    published: str = ""


def dataset(u: np.ndarray, y: np.ndarray, dt: float, units: tuple[str, str] = ("", "")) -> islands.Dataset:
    return islands.Dataset(
        u=np.asarray(u, dtype=float)[:, None],
        y=np.asarray(y, dtype=float),
        dt=dt,
        input_names=("u",),
        input_units=units[:1],
        output_name="y",
        output_unit=units[1],
    )


def columns(name: str) -> dict[str, np.ndarray]:
    with (DATA / name).open() as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    return {key: np.array([row[key] for row in rows]) for key in rows[0]}


def silverbox(part: str, length: int | None = None) -> Reader:
    def record() -> islands.Dataset:
        stored = np.load(DATA / "silverbox.npz")
        start, stop = stored[f"idx_{part}"]
        stop = stop if length is None else start + length
        # The means of the whole recording are offsets of the electronics: 6 mV at the input.
        u, y = (stored[name] - stored[name].mean() for name in ("u", "y"))
        return dataset(u[start:stop], y[start:stop], 1 / 610.35, ("V", "V"))

    return record


def bouc_wen(part: str, length: int | None = None) -> Reader:
    def record() -> islands.Dataset:
        stored = np.load(DATA / "boucwen_benchmark.npz")
        u, y = stored[f"u_{part}_N"], stored[f"y_{part}_m"]
        return dataset(u[:length], y[:length], 1 / 750, ("N", "m"))

    return record


def tanks(part: str) -> Reader:
    def record() -> islands.Dataset:
        found = columns("cascaded_tanks.csv")
        u, y = (found[f"{name}_{part}_V"].astype(float) for name in "uy")
        return dataset(u, y, 4.0, ("V", "V"))

    return record


def damper(volt: float, which: int) -> Reader:
    def record() -> islands.Dataset:
        found = columns("mrdamper_labcontrol.csv")
        here = np.abs(found["volt_V"].astype(float) - volt) < 1e-6
        test = sorted(set(found["test"][here]))[which]
        chosen = here & (found["test"] == test)
        x, force = (found[name][chosen].astype(float) for name in ("dist_mm", "force_N"))
        return dataset(x, force, 0.01, ("mm", "N"))

    return record


def furnace() -> islands.Dataset:
    found = columns("gas_furnace.csv")
    u, y = (found[name].astype(float) for name in ("u_gasrate_ft3min", "y_CO2_pct"))
    return dataset(u, y, 9.0, ("ft3/min", "%"))


def dryer() -> islands.Dataset:
    found = columns("daisy_hairdryer.csv")
    u, y = (found[name].astype(float) for name in ("u_V", "y_temp"))
    return dataset(u, y, 0.08, ("V", "V"))


def piezo() -> islands.Dataset:
    found = columns("piezo_micromanipulator_150V_1Hz.csv")
    time_s, u, y = (found[name].astype(float) for name in ("t_s", "u_V", "y_um"))
    kept = np.flatnonzero(time_s > 5.0)[::10][:4000]
    return dataset(u[kept] - u[kept].mean(), y[kept] - y[kept].mean(), 2e-3, ("V", "um"))


CASES = {
    "silverbox": Case(
        silverbox("train", 8000),
        "second-order",
        {name: silverbox(f"test_{name}") for name in ("multisine", "arrow", "arrow_noextrap")},
        50,
        1e3,
        "mV",
        "best published 0.36 / 0.26 / 0.32",
    ),
    "bouc-wen": Case(
        bouc_wen("train", 8000),
        "second-order",
        {"multisine": bouc_wen("test_multisine"), "sinesweep": bouc_wen("test_sinesweep")},
        0,
        1e6,
        "um",
        "best published 12 (multisine)",
    ),
    "tanks": Case(tanks("est"), "cascaded-tanks", {"val": tanks("val")}, 50, 1.0, "V", "0.18 to 0.59"),
    "furnace": Case(furnace, "linear:1", {}),
    "furnace, delayed": Case(furnace, "linear:1:3", {}),
    "dryer": Case(dryer, "linear:2", {}),
    "dryer, delayed": Case(dryer, "linear:2:2", {}),
    "piezo 150 V": Case(piezo, "linear:0", {}),
    **{
        f"damper {volt:g} V {which}": Case(damper(volt, which), f"python:{NAIVE}:force", {}, unit="N")
        for volt in (0.0, 0.8712, 1.98, 3.212)
        for which in (2, 5)
    },
}


def errors(case: Case, record: islands.Dataset, found: Diagnosis) -> dict[str, list[float]]:
    """Return the RMSE on each test record, of the simulation alone and with the named effects."""
    rows: dict[str, list[float]] = {}
    for name, made in case.tests.items():
        test = made()
        rows[name] = []
        for fit in (found.base, found.best):
            y = islands.simulate(extended_document(fit, record), test).y
            rows[name].append(case.scale * float(np.sqrt(np.mean((test.y - y)[case.skip :] ** 2))))
    return rows


def probes(case: Case, found: islands.DiagnosisResult, clean: int, injected: int) -> dict[str, Any]:
    """Return the diagnoses of surrogates of a record, without and with an injected effect.

    Effects are injected in random order, with a misfit of one to four standard deviations of the residual of
    the best simulation, so that the effect is the larger part of the misfit.
    """
    core = make_simulator(case.simulation, found.record)
    source = make_surrogates(found, core, {})
    called = [diagnose_surrogate(source, SurrogateCase(None, seed)).named for seed in range(clean)]
    rng, diagnoses = np.random.default_rng(1), list[tuple[str, str, bool]]()
    names = rng.permutation(sorted(source.effects)).tolist()
    while names and len(diagnoses) < injected:
        strong = [
            each
            for each in injection_strengths(source, source.effects[names.pop()], rng)
            if 1.0 < each.misfit < 4.0
        ]
        if strong:
            answer = diagnose_surrogate(source, SurrogateCase(strong[0], len(diagnoses)))
            diagnoses.append((strong[0].cause, answer.named, answer.recognised))
    return {"clean": called, "injected": diagnoses}


def measured(case: Case, clean: int = 0, injected: int = 0) -> dict[str, Any]:
    record = case.record()
    began, cpu = time.perf_counter(), time.process_time()
    found = islands.diagnose(record, case.simulation)
    wall, busy = time.perf_counter() - began, time.process_time() - cpu
    gain = found.gain
    causes = [each for each in found.effects if each.explained_fraction is not None]
    return {
        "samples": record.samples,
        "simulation": case.simulation,
        "verdict": str(found.verdict),
        "names": [each.name for each in causes if each.is_claimed],
        "further": [each.name for each in causes if not each.is_claimed],
        "equivalents": [list(each.equivalents) for each in causes],
        "candidates": [each.name for each in found.candidates[:3]],
        "locked": None
        if gain is None
        else [case.scale * gain.before.rmse, case.scale * gain.after.rmse, *gain.ci95],
        "floor": case.scale * found.noise_floor,
        "tests": errors(case, record, found),
        "unit": case.unit,
        "published": case.published,
        "surrogates": probes(case, found, clean, injected),
        "wall_s": wall,
        "cpu_s": busy,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help=", ".join(CASES))
    parser.add_argument("--json", type=Path)
    parser.add_argument("--clean", type=int, default=0, help="clean surrogates of each record")
    parser.add_argument("--injected", type=int, default=0, help="surrogates of each with an injected effect")
    asked = parser.parse_args()
    rows = {}
    for name in asked.names or CASES:
        row = rows[name] = measured(CASES[name], asked.clean, asked.injected)
        print(f"{name} ({row['simulation']}, {row['samples']} samples, {row['cpu_s']:.0f} s of CPU)")
        names, first = ", ".join(row["names"]) or "-", ", ".join(row["candidates"])
        further = f", not claimed: {', '.join(row['further'])}" if row["further"] else ""
        print(f"    {row['verdict']}: {names}{further}   (screened first: {first})")
        if row["locked"] is not None:
            before, after, low, high = row["locked"]
            print(f"    held out {before:.4g} -> {after:.4g} {row['unit']} ({low:.0f} to {high:.0f} % less)")
        for test, (before, after) in row["tests"].items():
            print(f"    {test}: {before:.4g} -> {after:.4g} {row['unit']}")
        said = row["surrogates"]
        if said["clean"]:
            print(f"    clean surrogates: {Counter(said['clean'])}")
        if said["injected"]:
            first = sum(hidden == called for hidden, called, _ in said["injected"])
            among = sum(recognised for *_, recognised in said["injected"])
            print(f"    injected: {len(said['injected'])}, named first {first}, among the names {among}")
            print(f"        {[each[:2] for each in said['injected'] if each[0] != each[1]]}")
        if row["published"]:
            print(f"    {row['published']}")
    if asked.json:
        asked.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
