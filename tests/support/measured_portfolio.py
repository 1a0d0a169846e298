"""Measured records of several kinds, each with a test part that no search uses."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

import islands
from islands.records.dataset import Dataset
from support.repository import measured_record

Pair = tuple[Dataset, Dataset]


def _read(
    name: str, inputs: list[str], output: str, first: int, last: int, dt: float | None = None
) -> Dataset:
    return islands.read_record(measured_record(name), inputs, output, dt, rows=slice(first, last))


def _parts(
    name: str, inputs: list[str], output: str, first: int, cut: int, last: int, dt: float | None = None
) -> Pair:
    return _read(name, inputs, output, first, cut, dt), _read(name, inputs, output, cut, last, dt)


def _tanks() -> Pair:
    name = "cascaded_tanks.csv"
    return _read(name, ["u_est_V"], "y_est_V", 0, 1024), _read(name, ["u_val_V"], "y_val_V", 0, 1024)


def _mr_damper() -> Pair:
    table = np.genfromtxt(
        measured_record("mrdamper_labcontrol.csv"), delimiter=",", names=True, dtype=None, encoding="utf-8"
    )
    kept = table[table["volt_V"] == np.unique(table["volt_V"])[1]]
    first = kept[kept["test"] == kept["test"][0]]
    u, y = np.column_stack([first["dist_mm"], first["vel_mmps"]]), first["force_N"].astype(float)
    record = Dataset(u.astype(float), y, 0.01, ("dist_mm", "vel_mmps"), output_name="force_N")
    cut = 3 * record.samples // 4
    return record[:cut], record[cut:]


def _shape_memory_alloy() -> Pair:
    table = np.genfromtxt(
        measured_record("sma_wing_hysteresis.csv"), delimiter=",", names=True, dtype=None, encoding="utf-8"
    )
    parts = [table[table["set"] == name] for name in ("DataT", "DataE")]
    one, other = (
        Dataset(part["v_V"].astype(float), part["y"].astype(float), 1.0, ("v_V",)) for part in parts
    )
    return one, other


#: Reader of each record and of its test part.
MEASURED: Mapping[str, Callable[[], Pair]] = MappingProxyType(
    {
        "cascaded tanks": _tanks,
        "hair dryer": lambda: _parts("daisy_hairdryer.csv", ["u_V"], "y_temp", 0, 750, 1000, 0.08),
        "gas furnace": lambda: _parts("gas_furnace.csv", ["u_gasrate_ft3min"], "y_CO2_pct", 0, 222, 296),
        "Wiener-Hammerstein": lambda: _parts("wh2009.npz", ["u"], "y", 20_000, 26_000, 29_000),
        "Silverbox": lambda: _parts("silverbox.npz", ["u"], "y", 60_000, 66_000, 69_000),
        "piezo": lambda: _parts(
            "piezo_micromanipulator_150V_1Hz.csv", ["u_V"], "y_um", 25_001, 43_751, 50_001
        ),
        "MR damper": _mr_damper,
        "buck converter": lambda: _parts("buck_converter.csv", ["u_V"], "y_V", 0, 1000, 2000),
        "shape memory alloy": _shape_memory_alloy,
    }
)
