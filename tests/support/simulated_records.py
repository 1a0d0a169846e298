"""A specification of every simulator, each with a short record that the simulator could have produced."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.export.fmu import find_compiler
from islands.persistence.models import model_json
from islands.records.dataset import Dataset
from islands.simulators.interface import Simulator
from islands.simulators.specification.code import FmuSpec, ProgramSpec
from islands.simulators.specification.equations import OdeSpec
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import (
    SIMULATORS,
    ColumnSpec,
    LinearSpec,
    LocalExtendedSpec,
    LocalSpec,
    ModelSpec,
    PhysicalSpec,
)
from support.gain_scheduled import GainScheduledModel
from support.oscillator_fmus import write_oscillator
from support.repository import ROOT

#: File with a simulator that is a Python function.
PROGRAM = Path(__file__).with_name("naive_damper.py")

#: Folder with simulators that are equations.
EQUATIONS = ROOT / "examples" / "simulations"

#: Folder of FMUs, which exists until the process ends.
FMUS = TemporaryDirectory()

#: Samples of a record.
SAMPLES = 600

#: Sampling time in seconds.
DT = 0.01

MODEL = {
    "schema": "islands.model/1",
    "inputs": ["u_V"],
    "output": "y_um",
    "terms": [
        {"regressor": "y(k-1)", "parameter": 0.8},
        {"regressor": "u(k-1)", "parameter": 0.15},
        {"regressor": "u(k-2)*u(k-2)", "parameter": 0.002},
    ],
}

#: Model of a class that is not NARX; the fixture ``toy_class`` adds the class.
OF_CLASS = GainScheduledModel(
    parameters=(0.9, 0.8, 0.001, 0.1), input_names=("u_V",), output_name="y_um", dt=DT
)

MODEL_SPEC = ModelSpec(kind="model", model=MODEL, name="m")

PROGRAM_SPEC = ProgramSpec(kind="python", path=str(PROGRAM), function="force", parameters={"c": 0.1})


@dataclass(frozen=True)
class SpecAndRecord:
    """A specification, and a record to compare it with."""

    spec: LocalSpec
    record: Dataset
    columns: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)

    @cached_property
    def simulator(self) -> Simulator:
        return make_simulator(self.spec, self.record, self.columns)


def names() -> list[str]:
    """Return the names of all specifications, which are made on demand; an FMU requires a C compiler."""
    return [
        name
        for name in (*SIMULATORS, "class", "held", "terms", "extended")
        if name != "fmu" or find_compiler()
    ]


class _Made(dict[str, SpecAndRecord]):
    """Specifications and records by name; the FMU is compiled when it is first asked for."""

    def __missing__(self, name: str) -> SpecAndRecord:
        if name != "fmu":
            raise KeyError(name)
        self[name] = SpecAndRecord(FmuSpec(kind="fmu", file=write_fmu()), self["second-order"].record)
        return self[name]


def wave(samples: int = SAMPLES, dt: float = DT) -> NDArray[np.float64]:
    """Return a sum of five sines without a common period in the record."""
    t = dt * np.arange(samples)
    return sum(
        size * np.sin(2 * np.pi * f * t + p)
        for size, f, p in ((20, 0.31, 1), (12, 0.83, 2), (8, 1.37, 3), (5, 2.9, 4), (3, 5.3, 5))
    )


def recorded(
    u: NDArray[np.float64], y: NDArray[np.float64], dt: float = DT, units: tuple[str, str] = ("V", "um")
) -> Dataset:
    return Dataset(
        u=np.asarray(u)[:, None],
        y=np.asarray(y),
        dt=dt,
        input_names=(f"u_{units[0]}",),
        input_units=units[:1],
        output_name=f"y_{units[1]}",
        output_unit=units[1],
    )


def simulate_oscillator(u: NDArray[np.float64], m: float, c: float, k: float) -> NDArray[np.float64]:
    """Simulate ``m x'' + c x' + k x = u`` from rest, with an input that is linear between samples."""
    _, x, _ = scipy.signal.lsim(([1.0], [m, c, k]), u, DT * np.arange(u.size))
    return np.asarray(x)


@cache
def write_fmu() -> str:
    """Write an oscillator as an FMU, once in a process, since the file must not change; return its path."""
    return str(write_oscillator(Path(FMUS.name) / "oscillator.fmu"))


@cache
def made() -> Mapping[str, SpecAndRecord]:
    """Return the specifications and their records by name."""
    u = wave()
    rng = np.random.default_rng(11)
    oscillation = simulate_oscillator(u, 0.5, 4.0, 200.0)
    position = simulate_oscillator(u, 2.0, 6.0, 0.0)
    level = 5.0 + scipy.signal.lfilter([0.02], [1, -0.98], np.abs(u) / 10)
    lagged = scipy.signal.lfilter([0.0, 0.08], [1, -0.9], u) + 0.01 * rng.standard_normal(u.size)
    plain = recorded(u, 0.8 * u + 0.01 * rng.standard_normal(u.size))
    oscillator = recorded(u, oscillation, units=("N", "m"))
    spring = PhysicalSpec(kind="second-order", parameters={"m": 0.5, "c": 4.0, "k": 200.0})
    found = {
        "bouc-wen-piezo": SpecAndRecord(PhysicalSpec(kind="bouc-wen-piezo"), plain),
        "second-order": SpecAndRecord(spring, oscillator),
        "rigid-axis": SpecAndRecord(
            PhysicalSpec(kind="rigid-axis", parameters={"m": 2.0, "c": 6.0, "F": 1.0}),
            recorded(u, position, units=("N", "m")),
        ),
        "cascaded-tanks": SpecAndRecord(
            PhysicalSpec(kind="cascaded-tanks", parameters={"k1": 2.0, "k2": 2.0, "k3": 1.0}),
            recorded(np.abs(u) / 10, level),
        ),
        "ode": SpecAndRecord(OdeSpec.from_text("ode", str(EQUATIONS / "second-order.toml")), oscillator),
        "linear": SpecAndRecord(
            LinearSpec(
                kind="linear",
                order=1,
                delay=2,
                numerator=(0.1, 0.05),
                denominator=(0.85,),
                level=0.3,
                reference_input=0.2,
            ),
            plain,
        ),
        "model": SpecAndRecord(MODEL_SPEC, plain),
        "class": SpecAndRecord(
            ModelSpec(kind="model", model=json.loads(model_json(OF_CLASS)), name="lag"), recorded(u, lagged)
        ),
        "column": SpecAndRecord(ColumnSpec(kind="column", column="theirs"), plain, {"theirs": 0.8 * u}),
        "python": SpecAndRecord(PROGRAM_SPEC, plain),
        "held": SpecAndRecord(
            LocalExtendedSpec.model_validate({**extension(spring), "hold": "zero-order", "times": 4}),
            oscillator,
        ),
        "terms": SpecAndRecord(
            LocalExtendedSpec.model_validate(
                {
                    **extension(MODEL_SPEC),
                    "inputs": ["u_V"],
                    "output": "y_um",
                    "output_equation": {
                        "equation": "y_sim + a1*(rate(u)*u) + a2*tanh(y_sim/s2)",
                        "parameters": {"a1": 0.001, "a2": 0.5, "s2": 10.0},
                    },
                }
            ),
            plain,
        ),
        "extended": SpecAndRecord(
            LocalExtendedSpec.model_validate(
                extension(spring, name="cubic-stiffness", parameters={"k": {"value": 50.0}})
            ),
            oscillator,
        ),
    }
    return _Made(found)


def extension(core: LocalSpec, **effect: object) -> dict[str, object]:
    """Return the document of an extended oscillator, with one effect if its fields are given."""
    frame = {"unit": "m", "peak": 0.2, "rate": 0.5, "force_unit": "N", "force": 40.0}
    return {
        "inputs": ["u_N"],
        "output": "y_m",
        "core": core.model_dump(),
        "effects": [effect] if effect else [],
        "scales": {
            "dt": DT,
            "input_peak": 40.0,
            "output_peak": 0.2,
            "fitted_s": 0.75 * SAMPLES * DT,
            "duration_s": SAMPLES * DT,
            "frame": {**frame, "sense": -1.0, "dissipates": True, "sharp": 0.02},
        },
    }
