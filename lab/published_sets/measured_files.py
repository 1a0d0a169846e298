"""Readers of the files with measured sets: estimation data and tests of each, split as their owners do."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.records.coupled import AnyRecord, CoupledRecord
from islands.records.dataset import Dataset, join
from lab.published_sets.definition import BenchmarkData, BenchmarkTest

#: Initial samples of most tests (nonlinear_benchmarks: ``state_initialization_window_length``).
KNOWN = 50

#: Initial samples of tests with fewer than 300 samples.
_KNOWN_OF_SHORT = 10

#: Tests of the damper at the voltage of its benchmark: those that are held out.
_VOLTAGE, _DAMPER_TESTS = 0.8712, ("6", "8", "10")

#: Levels of the excitation of the mirror, and the period of its multisines in samples.
_LEVELS, _PERIOD = ("100mV", "200mV", "300mV"), 8192


def _test(record: AnyRecord, known: int = KNOWN, unscored: int | None = None) -> BenchmarkTest:
    return BenchmarkTest(record, known, known if unscored is None else unscored)


def _read_table(path: Path) -> NDArray[Any]:
    """Return the columns of a text file by name."""
    return np.genfromtxt(path, delimiter=",", names=True, dtype=None, encoding="utf-8")


def read_silverbox(folder: Path) -> BenchmarkData:
    """Read multisines for the estimation; multisine, and an arrow whose amplitude grows beyond theirs."""
    return _cut_arrays(
        folder / "silverbox.npz",
        {
            "multisine": "idx_test_multisine",
            "arrow": "idx_test_arrow",
            "arrow-no-extrapolation": "idx_test_arrow_noextrap",
        },
    )


def read_wiener_hammerstein(folder: Path) -> BenchmarkData:
    """Read filtered noise for the estimation and for the test."""
    return _cut_arrays(folder / "wh2009.npz", {"test": "idx_test"})


def _cut_arrays(path: Path, tests: dict[str, str]) -> BenchmarkData:
    """Cut the arrays u and y at the first and the last row that the file states by name."""
    with np.load(path) as arrays:
        dt = 1.0 / float(arrays["fs"])
        whole = Dataset(arrays["u"], arrays["y"], dt, ("u_V",), "y_V")
        rows = {name: slice(*map(int, arrays[name])) for name in ("idx_train", *tests.values())}
    return BenchmarkData(
        whole[rows["idx_train"]], {test: _test(whole[rows[name]]) for test, name in tests.items()}
    )


def read_bouc_wen(folder: Path) -> BenchmarkData:
    """Read a multisine with noise for the estimation; a multisine and a sweep without noise."""
    with np.load(folder / "boucwen_benchmark.npz") as arrays:
        dt = 1.0 / float(arrays["fs"])
        records = {
            name: Dataset(arrays[f"u_{name}_N"], arrays[f"y_{name}_m"], dt, ("u_N",), "y_m")
            for name in ("train", "test_multisine", "test_sinesweep")
        }
    return BenchmarkData(
        records["train"],
        {"multisine": _test(records["test_multisine"]), "sweep": _test(records["test_sinesweep"])},
    )


def read_cascaded_tanks(folder: Path) -> BenchmarkData:
    """Read one record for the estimation and one for the test."""
    table = _read_table(folder / "cascaded_tanks.csv")
    estimation, test = (
        Dataset(table[f"u_{part}_V"], table[f"y_{part}_V"], 4.0, ("u_V",), "y_V") for part in ("est", "val")
    )
    return BenchmarkData(estimation, {"validation": _test(test)})


def read_steering_mirror(folder: Path) -> BenchmarkData:
    """Read multisines of three levels in the steady state; the first of two periods of a test is a warm-up.

    The levels alternate, so that the end of the estimation data has all of them.
    """
    with np.load(folder / "fsm_piezo.npz") as arrays:
        dt = 1.0 / float(arrays["fs"])
        parts = {
            level: [_read_levels(arrays, level, part, dt) for part in ("train", "test")] for level in _LEVELS
        }
    estimation = [
        each
        for realisations in zip(*(parts[level][0] for level in _LEVELS), strict=True)
        for each in realisations
    ]
    tests = {level: _test(_join_coupled(parts[level][1]), KNOWN, _PERIOD) for level in _LEVELS}
    return BenchmarkData(_join_coupled(estimation), tests)


def _read_levels(arrays: Any, level: str, part: str, dt: float) -> list[CoupledRecord]:
    """Return the realisations of a level, each with its periods one after another."""
    u, y = (arrays[f"{name}_{level}_{part}"].astype(float) for name in ("u", "y_um"))
    inputs, outputs = (
        [f"{name}{place}_{unit}" for place in (1, 2, 3)] for name, unit in (("u", "V"), ("y", "um"))
    )
    found = []
    for realisation in range(u.shape[2]):
        u_all, y_all = (np.concatenate(list(np.moveaxis(each[:, :, realisation], 2, 0))) for each in (u, y))
        records = (
            Dataset(u_all, column, dt, tuple(inputs), name)
            for name, column in zip(outputs, y_all.T, strict=True)
        )
        found.append(CoupledRecord(tuple(records)))
    return found


def _join_coupled(records: Sequence[CoupledRecord]) -> CoupledRecord:
    """Join recordings of several outputs."""
    return CoupledRecord(tuple(map(join, zip(*(each.records for each in records), strict=True))))


def read_damper(folder: Path) -> BenchmarkData:
    """Read the tests at one voltage: seven for the estimation, the others one by one.

    The column of the velocity is the difference of the displacement, which therefore is the only input.
    """
    table = _read_table(folder / "mrdamper_labcontrol.csv")
    at_voltage = table[table["volt_V"] == _VOLTAGE]
    records = {}
    for name in dict.fromkeys(at_voltage["test"].tolist()):
        rows = at_voltage[at_voltage["test"] == name]
        number = str(name).removeprefix("ensaio").partition(".")[0]
        records[number] = Dataset(rows["dist_mm"], rows["force_N"], 0.01, ("dist_mm",), "force_N")
    estimation = tuple(each for number, each in records.items() if number not in _DAMPER_TESTS)
    return BenchmarkData(join(estimation), {f"test-{each}": _test(records[each]) for each in _DAMPER_TESTS})


def read_micromanipulator(folder: Path) -> BenchmarkData:
    """Read a sine of 1 Hz after its first 5 s: the last quarter of the rest is the test."""
    table = _read_table(folder / "piezo_micromanipulator_150V_1Hz.csv")
    record = Dataset(table["u_V"], table["y_um"], 2e-4, ("u_V",), "y_um")
    return BenchmarkData(record[25_001:43_751], {"test": _test(record[43_751:])})


def read_piezo_loops(folder: Path) -> BenchmarkData:
    """Read butterfly loops of three amplitudes for the estimation, and of one between them."""
    table = _read_table(folder / "piezo_pnzt_loops.csv")
    loops = {
        name: Dataset(rows["V"], rows["D_nm"], 0.005, ("u_V",), "y_nm")
        for name in ("1300V", "1400V", "1500V", "1600V")
        for rows in [table[(table["set"] == "Serie1_0.5Hz") & (table["loop"] == name)]]
    }
    test = loops.pop("1400V")
    return BenchmarkData(join(tuple(loops.values())), {"1400V": _test(test, _KNOWN_OF_SHORT)})


def read_memory_alloy(folder: Path) -> BenchmarkData:
    """Read major and minor loops, which follow each other, for the estimation and for the test."""
    table = _read_table(folder / "sma_wing_hysteresis.csv")
    estimation, test = (
        Dataset(rows["v_V"], rows["y"], 1.0, ("u_V",), "y")
        for name in ("DataT", "DataE")
        for rows in [table[table["set"] == name]]
    )
    return BenchmarkData(estimation, {"test": _test(test, _KNOWN_OF_SHORT)})


def read_hair_dryer(folder: Path) -> BenchmarkData:
    """Read one record, whose last quarter is the test."""
    table = _read_table(folder / "daisy_hairdryer.csv")
    record = Dataset(table["u_V"], table["y_temp"], 0.08, ("u_V",), "y_degC")
    return BenchmarkData(record[:750], {"test": _test(record[750:], _KNOWN_OF_SHORT)})


def read_gas_furnace(folder: Path) -> BenchmarkData:
    """Read one record, whose last quarter is the test."""
    table = _read_table(folder / "gas_furnace.csv")
    record = Dataset(table["u_gasrate_ft3min"], table["y_CO2_pct"], 9.0, ("u_gasrate",), "y_CO2_pct")
    return BenchmarkData(record[:222], {"test": _test(record[222:], _KNOWN_OF_SHORT)})


def read_buck_converter(folder: Path) -> BenchmarkData:
    """Read the record that is marked for the identification, and the other one for the test."""
    table = _read_table(folder / "buck_converter.csv")
    is_used = table["split"] == "id"
    estimation, test = (
        Dataset(rows["u_V"], rows["y_V"], 1e-5, ("u_V",), "y_V") for rows in (table[is_used], table[~is_used])
    )
    return BenchmarkData(estimation, {"validation": _test(test)})
