"""Diagnoses of simulations of one oscillator, each with a known difference to its record."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

import islands
from islands.diagnosis.interim_findings import InterimFindings
from islands.diagnosis.procedure import diagnose
from islands.facade.explain_residual import FORMULA
from islands.facade.results.complete_diagnosis import DiagnosisResult
from islands.progress import Steps
from islands.records.dataset import Dataset
from islands.simulators.specification.equations import OdeSpec
from islands.simulators.specification.factory import make_simulator

Signal = NDArray[np.float64]

#: Sampling time in seconds, samples, and standard deviation of the noise as a fraction of that of the output.
DT, SAMPLES, NOISE = 0.01, 600, 0.02


def _oscillate(u: Signal) -> Signal:
    return np.asarray(lfilter([0.0, 0.05, 0.05], [1.0, -1.6, 0.7], u))


def _excite(rng: np.random.Generator, samples: int = SAMPLES) -> Signal:
    return np.asarray(lfilter([0.3], [1.0, -0.7], rng.standard_normal(samples)))


def _colour(rng: np.random.Generator, samples: int) -> Signal:
    return 0.3 * np.asarray(lfilter([1.0], [1.0, -0.95], rng.standard_normal(samples)))


class Run(NamedTuple):
    """Input and output of the exact simulation, each of shape (samples,), and a random generator."""

    u: Signal
    y: Signal
    rng: np.random.Generator


#: Measured outputs without noise.
MEASURED_OUTPUTS: Mapping[str, Callable[[Run], Signal]] = MappingProxyType(
    {
        "nothing": lambda run: run.y,
        "coloured noise": lambda run: run.y + 0.2 * run.y.std() * _colour(run.rng, run.y.size),
        "offset": lambda run: run.y + 0.3,
        "weak offset": lambda run: run.y + 0.005 * run.y.std(),
        "offset and delay": lambda run: 0.3 + np.concatenate([np.full(3, run.y[0]), run.y[:-3]]),
        "saturation and drift": lambda run: (
            np.minimum(run.y, 1.2 * run.y.std()) + np.linspace(0.0, 1.0, run.y.size)
        ),
        "another scale": lambda run: 1000.0 * run.y,
        "gain": lambda run: 0.9 * run.y,
        "sign": lambda run: -run.y,
        "early output": lambda run: np.concatenate([run.y[5:], np.full(5, run.y[-1])]),
        "missing input": lambda run: run.y + _oscillate(_excite(run.rng)),
        "random force": lambda run: run.y + 0.1 * _oscillate(run.rng.standard_normal(run.y.size)),
        "jump of the last quarter": lambda run: run.y + 2.0 * (np.arange(run.y.size) > 0.8 * run.y.size),
        "square": lambda run: run.y + 0.2 * _oscillate(run.u**2),
        "another system": lambda run: np.cumsum(run.u - run.u.mean()),
        "noise alone": lambda run: run.rng.standard_normal(run.y.size),
    }
)


def diagnose_difference(name: str, seed: int, simulation: str = "column:simulated") -> DiagnosisResult:
    """Diagnose the exact simulation, or another one, of a record with a difference of `MEASURED_OUTPUTS`."""
    return _diagnose(make_differing(name, seed), simulation)


def make_differing(name: str, seed: int) -> tuple[Dataset, Signal]:
    """Return a record with a difference of `MEASURED_OUTPUTS`, and the exact simulation, shape (samples,)."""
    rng = np.random.default_rng(seed)
    u = _excite(rng)
    simulated = _oscillate(u)
    y = MEASURED_OUTPUTS[name](Run(u, simulated, rng))
    y = y + NOISE * simulated.std() * rng.standard_normal(y.size)
    return Dataset(u, y, DT, ("force_N",), "travel_um", ("N",), "um"), simulated


def _diagnose(compared: tuple[Dataset, Signal], simulation: str, **options: Any) -> DiagnosisResult:
    record, simulated = compared
    return islands.diagnose(record, simulation, columns={"simulated": simulated}, **options)


def _diagnose_short(samples: int) -> DiagnosisResult:
    record, simulated = make_differing("offset", 0)
    return _diagnose((record[:samples], simulated[:samples]), "column:simulated")


def _diagnose_with_gaps() -> DiagnosisResult:
    record, simulated = make_differing("offset", 0)
    y = np.where(np.arange(record.samples) % 50 < 5, np.nan, record.y)
    return _diagnose((replace(record, y=y), simulated), "column:simulated")


def _diagnose_with_channels() -> DiagnosisResult:
    """Diagnose a record with a copy of the output, a constant channel and one that acts."""
    record, simulated = make_differing("nothing", 1)
    warmth = np.cumsum(np.random.default_rng(2).standard_normal(record.samples)) / 10.0
    u = np.column_stack([record.u, record.y, np.full(record.samples, 2.0), warmth])
    names, units = ("force_N", "copy_um", "constant_V", "T_K"), ("N", "um", "V", "K")
    changed = replace(record, u=u, y=record.y + 0.3 * warmth, input_names=names, input_units=units)
    return _diagnose((changed, simulated), "column:simulated")


def _diagnose_periods() -> DiagnosisResult:
    """Diagnose a periodic record, which has a measured noise floor."""
    rng = np.random.default_rng(3)
    u = np.tile(_excite(rng, 150), 6)
    simulated = _oscillate(u)
    y = simulated + 0.3 * simulated**3 + NOISE * simulated.std() * rng.standard_normal(u.size)
    return _diagnose((Dataset(u, y, DT), simulated), "column:simulated")


def _diagnose_held_out() -> DiagnosisResult:
    """Diagnose an offset, with a recording that is held out as a whole and has another offset."""
    record, _ = make_differing("offset", 4)
    other, _ = make_differing("nothing", 5)
    return islands.diagnose(record, "linear:2", validation=other)


def _diagnose_parameter() -> DiagnosisResult:
    """Diagnose an oscillator with a wrong stiffness, with tolerances of all parameters."""
    rng = np.random.default_rng(6)
    u = _excite(rng, 800)
    record = Dataset(u, np.zeros(u.size), DT, ("force_N",), "travel_um", ("N",), "um")
    y = islands.simulate(_make_oscillator(440.0), record).y
    measured = replace(record, y=y + 0.01 * y.std() * rng.standard_normal(u.size))
    return islands.diagnose(measured, _make_oscillator(400.0), tolerance={"m": 0.01, "c": 0.01, "k": 0.01})


def _make_oscillator(stiffness: float) -> OdeSpec:
    return OdeSpec.model_validate(
        {
            "kind": "ode",
            "name": "oscillator",
            "input": "force_N",
            "equations": "dx/dt = v\ndv/dt = (1e3*force_N - c*v - k*x)/m",
            "output": "x",
            "parameters": {"m": 1.0, "c": 4.0, "k": stiffness},
            "states": {"x": {"initial": 0.0}, "v": {"initial": 0.0}},
        }
    )


def _diagnose_until(phase: str) -> DiagnosisResult:
    """Stop a diagnosis at a phase, and return the result so far."""

    def stop(message: str, _fraction: float | None = None, /) -> None:
        if message.startswith(phase):
            raise KeyboardInterrupt

    record, simulated = make_differing("offset and delay", 0)
    simulator = make_simulator("column:simulated", record, {"simulated": simulated})
    interim = InterimFindings()
    with suppress(KeyboardInterrupt):
        diagnose(record, simulator, progress=stop, interim=interim)
    found = interim.make_diagnosis()
    assert found is not None
    steps = Steps()
    steps.leave_out(FORMULA)
    return DiagnosisResult.from_diagnosis(found).with_steps(steps)


def _diagnose_with_formula() -> DiagnosisResult:
    found = diagnose_difference("another system", 0)
    return DiagnosisResult.from_diagnosis(found, islands.explain_residual(found))


#: Diagnoses of other kinds of records and requests.
OTHERS: Mapping[str, Callable[[], DiagnosisResult]] = MappingProxyType(
    {
        "too short": partial(_diagnose_short, 80),
        "short": partial(_diagnose_short, 210),
        "gaps": _diagnose_with_gaps,
        "channels": _diagnose_with_channels,
        "periods": _diagnose_periods,
        "held-out recording": _diagnose_held_out,
        "wrong parameter": _diagnose_parameter,
        "stopped while screening": partial(_diagnose_until, "effects in addition"),
        "stopped before free forms": partial(_diagnose_until, "searching for missing terms"),
        "formula": _diagnose_with_formula,
    }
)
