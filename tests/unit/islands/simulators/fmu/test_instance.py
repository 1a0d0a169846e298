"""Simulation of reference FMUs: the solution of the equations, events, failures, and what is left behind."""

import gc
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from islands.errors import ModelError
from islands.export.fmu import find_compiler
from islands.expressions.tree import FMU, Apply, Symbol
from islands.simulators.fmu.fmi_description import FmiInterface, read_description
from islands.simulators.fmu.instance import FmuInstance, FmuRun, load_fmu
from islands.simulators.fmu.model import FmuParameterChoice, choose_variables
from islands.simulators.fmu.simulator import simulate_fmu
from islands.simulators.fmu.system import make_fmu_system
from islands.simulators.ode.lane_values import LaneInput
from islands.simulators.ode.program import generate_program
from islands.simulators.ode.sampled_signal import interpolate_linearly
from support.oscillator_fmus import write_oscillator

# The library of FMUs is imported and compiled for, which takes seconds.
pytestmark = [
    pytest.mark.ci,
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler is called cc"),
]

DT = 0.005
T = DT * np.arange(300)
U = 20 * np.sin(2 * np.pi * 1.3 * T) + 10 * np.sin(2 * np.pi * 3.1 * T + 1)

#: Interfaces by the elements of the description, with the largest error relative to the output's peak.
INTERFACES = {"ModelExchange": 1e-4, "CoSimulation": 1e-3}


def load(path: Path) -> FmuInstance:
    return FmuInstance(read_description(str(path)))


def run(
    fmu: FmuInstance, x: float = 0.0, v: float = 0.0, start: float = 0.0, every: int = 1, **values: float
) -> FmuRun:
    """Simulate x and v."""
    chosen = {name: FmuParameterChoice(value, fixed=True) for name, value in values.items()}
    model = choose_variables(fmu.description, parameters=chosen)
    computed = [Apply(FMU, (Symbol(name),)) for name in ("x", "v")]
    is_exchange = fmu.description.interface == FmiInterface.MODEL_EXCHANGE
    program = generate_program(
        make_fmu_system(model), (Symbol("x"), Symbol("v")) if is_exchange else tuple(computed)
    )
    lane = LaneInput(values, {"x": x, "v": v}, {"u": interpolate_linearly(U).refine(every)})
    (found,) = simulate_fmu(fmu, model, program, start, DT / every, [lane])
    return replace(found, y=found.y[:, ::every])


def solve(x: float = 0.0, v: float = 0.0) -> NDArray[np.float64]:
    system = scipy.signal.StateSpace(
        [[0.0, 1.0], [-400.0, -8.0]], [[0.0], [2.0]], np.eye(2), np.zeros((2, 1))
    )
    _, y, _ = scipy.signal.lsim(system, U, T, X0=[x, v])
    return np.asarray(y.T)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("interface", INTERFACES)
def test_the_simulation_is_the_solution_of_the_equations(
    version: int, interface: str, tmp_path: Path
) -> None:
    fmu = load(write_oscillator(tmp_path / "mass.fmu", version, interface))
    found, expected = run(fmu, x=0.02, v=-0.3), solve(0.02, -0.3)
    assert found.failure == ""
    error = np.abs(found.y - expected).max(axis=1) / np.abs(expected).max(axis=1)
    assert (error < INTERFACES[interface] * np.array([1, 10])).all()
    assert np.array_equal(found.y[:, 0], [0.02, -0.3])


@pytest.mark.parametrize("macros", [(), pytest.param(("NO_RESET",), marks=pytest.mark.ci)])
@pytest.mark.parametrize("version", [2, 3])
def test_a_simulation_does_not_depend_on_earlier_ones(
    version: int, macros: tuple[str, ...], tmp_path: Path
) -> None:
    fmu = load(write_oscillator(tmp_path / "mass.fmu", version, macros=macros))
    first = run(fmu)
    run(fmu, m=0.7, c=1.0)
    run(fmu, x=0.1, start=3.0)
    assert np.array_equal(run(fmu).y, first.y)


def test_a_state_event_rebounds_the_mass(tmp_path: Path) -> None:
    """The mass does not pass the stop at 0.05 m; its velocity there is inverted and halved."""
    fmu = load(write_oscillator(tmp_path / "mass.fmu", events=True))
    free, (x, v) = run(fmu).y[0], run(fmu, stop=0.05).y
    assert free.max() > 0.1
    assert x.max() == 0.05
    rebounds = np.flatnonzero((v[:-1] > 0.05) & (v[1:] < 0))
    assert rebounds.size > 0
    assert v[rebounds[0] + 1] == pytest.approx(-0.5 * v[rebounds[0]], abs=0.3 * v[rebounds[0]])


@pytest.mark.parametrize("version", [2, 3])
def test_a_time_event_acts_at_its_time(version: int, tmp_path: Path) -> None:
    """A force of 1 N from half a second on adds the step response of the oscillator."""
    fmu = load(write_oscillator(tmp_path / "mass.fmu", version, events=True))
    added = run(fmu, on=0.5).y[0] - run(fmu).y[0]
    _, expected = scipy.signal.step(([1.0], [0.5, 4.0, 200.0]), T=T)
    assert not added[T <= 0.5].any()
    np.testing.assert_allclose(added[100:], expected[:200], atol=1e-6)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("mass", [-1.0, 2e6])
def test_a_failure_is_a_result_and_the_next_simulation_succeeds(
    version: int, mass: float, tmp_path: Path
) -> None:
    fmu = load(write_oscillator(tmp_path / "mass.fmu", version))
    first = run(fmu)
    failed = run(fmu, m=mass)
    assert np.isnan(failed.y).all()
    assert failed.y.shape == first.y.shape
    assert "m is out of range" in failed.failure
    assert np.array_equal(run(fmu).y, first.y)


@pytest.mark.ci
@pytest.mark.parametrize("resources", [False, True])
def test_a_folder_exists_only_for_resources_and_as_long_as_the_instance(
    resources: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_oscillator(tmp_path / "mass.fmu", resources=resources)
    folder = tmp_path / "extracted"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    fmu = load(path)
    assert run(fmu).failure == ""
    assert len(list(folder.iterdir())) == resources
    del fmu
    gc.collect()
    assert not list(folder.iterdir())


def test_a_file_that_has_changed_is_refused(tmp_path: Path) -> None:
    path = write_oscillator(tmp_path / "mass.fmu", 2)
    description = read_description(str(path))
    write_oscillator(path, 3)
    with pytest.raises(ModelError, match="has changed since it was first read"):
        load_fmu(description)


@pytest.mark.ci
def test_a_library_that_cannot_be_loaded_is_refused(tmp_path: Path) -> None:
    path = write_oscillator(tmp_path / "mass.fmu", 3, macros=("fmi3Reset=absent",))
    with pytest.raises(ModelError, match=r"mass.fmu cannot be loaded: .*fmi3Reset"):
        load(path)
