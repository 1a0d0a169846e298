"""Laws inside of a linear simulation: terms and limits of its states are found, and stated in words."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

import islands
from islands.diagnosis.discovery.candidate_terms import list_candidate_terms, write_rate_size
from islands.diagnosis.discovery.process_laws import describe_law
from islands.diagnosis.procedure import diagnose
from islands.diagnosis.result import Diagnosis
from islands.effects.catalogue import EFFECTS
from islands.effects.interface.context import Signal
from islands.facade.results.complete_diagnosis import DiagnosisResult
from islands.records.dataset import Dataset
from islands.report.documents.extension import extended_json
from islands.simulators.specification.equations import OdeSpec
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import LocalExtendedSpec

DT, STEPS, SAMPLES = 0.1, 10, 1200

#: Right-hand side of a process of one or two states: ``(states, input) -> derivatives``.
Equation = Callable[[Signal, float], list[float]]


def follow_unevenly(x: Signal, u: float) -> list[float]:
    error = (1.5 * u - x[0]) / 2.0
    return [error * (1.4 if error > 0.0 else 1.0)]


def radiate(x: Signal, u: float) -> list[float]:
    return [(1.5 * u - x[0] - 1.2 * ((1.0 + x[0] / 3.0) ** 4 - 1.0)) / 2.0]


def stop(x: Signal, u: float) -> list[float]:
    inner = min(max(x[0], -1.8), 1.8)
    rate = (1.5 * u - inner) / 1.5
    return [0.0 if abs(inner) == 1.8 and rate * inner > 0.0 else rate, (inner - x[1]) / 0.5]


def stop_between(x: Signal, u: float) -> list[float]:
    inner = min(max(x[0], -1.0), 2.0)
    rate = (1.5 * u - inner) / 1.5
    is_stopped = (inner == -1.0 and rate < 0.0) or (inner == 2.0 and rate > 0.0)
    return [0.0 if is_stopped else rate, (inner - x[1]) / 0.5]


def oscillate(force: Callable[[float, float], float]) -> Equation:
    """Return an oscillator of 0.6 Hz with a force that depends on position and speed."""

    def equation(state: Signal, u: float) -> list[float]:
        v, x = state.tolist()
        return [12.0 * (u - x) - 1.2 * v + force(x, v), v]

    return equation


#: Processes, with the order of the simulation.
PROCESSES: dict[str, tuple[Equation, int]] = {
    "uneven": (follow_unevenly, 1),
    "radiation": (radiate, 1),
    "limit": (stop, 2),
    "range": (stop_between, 2),
    "friction": (oscillate(lambda _, v: -2.0 * float(np.tanh(v / 0.02))), 2),
    "spring": (oscillate(lambda x, _: -1.5 * x**3), 2),
    "elastic stop": (oscillate(lambda x, _: -100.0 * (max(x - 1.5, 0.0) - max(-x - 1.5, 0.0))), 2),
}


def make_record(name: str, seed: int = 0) -> Dataset:
    """Simulate a process by Heun's method, with levels of the input that are held."""
    equation, order = PROCESSES[name]
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-2.0, 2.0, SAMPLES // 15), 15)
    state, outputs, step = np.zeros(order), [], DT / STEPS
    for level in u.tolist():
        outputs.append(state[-1])
        for _ in range(STEPS):
            slope = np.array(equation(state, level))
            state = state + step / 2.0 * (slope + np.array(equation(state + step * slope, level)))
    y = np.array(outputs) + 0.01 * rng.standard_normal(u.size)
    return Dataset(u, y, DT, ("u_V",), "T_K", ("V",), "K")


#: Processes in whose records few effects are searched for, and these effects.
BRIEFLY_SEARCHED = ("range", "friction", "spring", "elastic stop")
CATALOGUE = ("coulomb-friction", "cubic-stiffness", "input-saturation", "delay")


#: Messages of the diagnosis of each process.
MESSAGES: dict[str, list[str]] = {}


@cache
def find(name: str) -> tuple[Dataset, Diagnosis]:
    record = make_record(name)
    catalogue = [each for each in EFFECTS if each.name in CATALOGUE] if name in BRIEFLY_SEARCHED else EFFECTS
    simulator = make_simulator(f"linear:{PROCESSES[name][1]}", record)
    messages = MESSAGES.setdefault(name, [])
    found = diagnose(
        record, simulator, progress=lambda message, _=None, /: messages.append(message), catalogue=catalogue
    )
    return record, found


@pytest.mark.ci
def test_process_that_is_slower_in_one_direction_is_found() -> None:
    _, found = find("uneven")
    assert found.verdict == "discovered"
    (cause,) = found.causes
    assert cause.term == "a1*(abs((K*u + level - x)/T)) in dx/dt"
    assert cause.parameters["a1"].value == pytest.approx(0.2 / 1.2, rel=0.05)
    summary = " ".join(DiagnosisResult.from_diagnosis(found).summary.split())
    assert "the time constant T is 1.43 s while x rises, and 2 s while it falls" in summary


@pytest.mark.ci
def test_loss_by_radiation_is_found_with_the_absolute_zero() -> None:
    _, found = find("radiation")
    (cause,) = found.causes
    assert cause.term == "a1*((x + s1)**4) in dx/dt"
    assert cause.parameters["s1"].value == pytest.approx(3.0, rel=0.1)
    assert cause.parameters["s1"].unit == "K"
    assert "as by radiation of heat: x = -s1 is the absolute zero" in cause.summary


@pytest.mark.ci
@pytest.mark.nightly
def test_limit_of_a_state_that_is_not_measured_is_found() -> None:
    _, found = find("limit")
    assert [each.name for each in found.causes] == ["state-clip"]
    assert found.causes[0].parameters["state-clip:x1"].value == pytest.approx(1.8, rel=0.02)


@pytest.mark.ci
@pytest.mark.parametrize("name", ["uneven", "radiation", pytest.param("limit", marks=pytest.mark.nightly)])
def test_a_law_of_the_process_is_no_model_error(name: str) -> None:
    find(name)
    assert "searching for missing terms" in MESSAGES[name]
    assert not [each for each in MESSAGES[name] if "model error" in each]


@pytest.mark.ci
@pytest.mark.nightly
@pytest.mark.parametrize(
    ("name", "cause", "value"),
    [("friction", "coulomb-friction", 2.0 / 12.0), ("spring", "cubic-stiffness", 0.125)],
)
def test_force_in_an_oscillator_is_found_by_a_linear_simulation(name: str, cause: str, value: float) -> None:
    _, found = find(name)
    assert [each.name for each in found.causes] == [cause]
    (force,) = found.causes[0].parameters.values()
    assert force.value == pytest.approx(value, rel=0.05)


@pytest.mark.ci
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(each, marks=pytest.mark.nightly if each in (*BRIEFLY_SEARCHED, "limit") else ())
        for each in PROCESSES
    ],
)
def test_extension_holds_for_another_record(name: str) -> None:
    record, found = find(name)
    spec = LocalExtendedSpec.model_validate_json(extended_json(found.best, record))
    other = make_record(name, seed=1)
    error = islands.simulate(spec, other).y - other.y
    assert np.sqrt(np.mean(error**2)) == pytest.approx(0.01, rel=0.15)


PROCESS = {
    "kind": "ode",
    "name": "process",
    "input": "u",
    "output": "x",
    "equations": "dx/dt = (u - x)/T",
    "parameters": {"T": {"value": 2.0}},
}

OSCILLATOR = {
    "kind": "ode",
    "name": "oscillator",
    "input": "u",
    "output": "x",
    "equations": "dx/dt = v\ndv/dt = u - x - v",
}


def test_the_gain_of_a_state_at_the_output_is_no_candidate() -> None:
    system = OdeSpec.model_validate({**OSCILLATOR, "output": "x + 0.1*v + 0.2*u"}).make_system()
    sizes = dict.fromkeys(("x", "v", "dx/dt", "dv/dt", "u", "rate(u)"), 2.0)
    of_output = [
        each.text for each in list_candidate_terms(system, sizes, 10.0, {}) if each.target == "output"
    ]
    assert "x" not in of_output
    assert {"v", "u", "x**3"} <= set(of_output)


def test_laws_are_stated_in_words_and_other_terms_are_not() -> None:
    system = OdeSpec.model_validate(PROCESS).make_system()
    sizes = dict.fromkeys(("x", "dx/dt", "u", "rate(u)"), 2.0)
    values = {"T": 2.0, "a1": -0.2, "s1": 270.0}
    stated = {
        each.text: describe_law(each, 1, system, values)
        for each in list_candidate_terms(system, sizes, 10.0, {})
        if each.target == "x"
    }
    (_, own), *_ = system.derivatives
    assert "T is 2.5 s while x rises, and 1.67 s while it falls" in stated[write_rate_size(own)]
    assert "fourth power of x, as by radiation" in stated["x**4"]
    assert "fourth power of x + s1, as by radiation" in stated["(x + {scale})**4"]
    assert sum(map(bool, stated.values())) == 3
