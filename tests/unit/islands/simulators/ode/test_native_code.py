"""Machine code of a program: the bits of the interpreter, for every instruction and in every lane."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from islands.expressions.tree import Symbol
from islands.simulators.ode import native_code
from islands.simulators.ode.lane_simulation import simulate_lanes
from islands.simulators.ode.lane_values import LaneInput
from islands.simulators.ode.program import OdeProgram, generate_program
from islands.simulators.ode.sampled_signal import interpolate_linearly, make_time
from islands.simulators.ode.shooting import IntervalSimulation
from islands.simulators.ode.system_document import make_system

pytestmark = pytest.mark.ci

DT, SAMPLES = 0.01, 200
TIME = DT * np.arange(SAMPLES)
FORCE = 3.0 * np.sin(7.0 * TIME) + 2.0 * np.cos(3.1 * TIME)

ARITHMETIC = {
    "name": "arithmetic",
    "input": "F",
    "channels": ["T"],
    "equations": """
        dx/dt = v
        dv/dt = F - c*v - k*x - b*x**3 + 0.1*abs(v)*x - rate(T)*0.01 + sign(v)*0.2 - t/50
        dy/dt = -y + min(x, T) - max(v, -y)/(2 + x**2) + sqrt(abs(x)) + where(x - v, y, 0.3)
        dp/dt = -p**5 + (x < v)*a + (y <= 0)*b - tanh(v/0.1) + sign(v)*exp(-abs(v/c))
    """,
    "output": "x + 0.1*y + p*F",
    "parameters": {"a": 0.4, "b": 2.0, "c": 1.2, "k": 80.0},
}


@pytest.fixture(autouse=True)
def empty_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache folder without programs, and a process that knows none."""
    monkeypatch.setattr(native_code, "cache_folder", lambda: tmp_path)
    forget_programs(monkeypatch)
    return tmp_path


def forget_programs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(native_code, "_counts", type(native_code._counts)())
    native_code._compile.cache_clear()


def motion(index: int) -> LaneInput:
    parameters = {"a": 0.4, "b": 2.0, "c": 1.2 + 0.1 * index, "k": 80.0}
    signals = {"F": interpolate_linearly(FORCE), "T": interpolate_linearly(np.cos(TIME) - 0.5)}
    initial = {"x": 0.01, "v": 0.3, "y": -0.2, "p": 0.5}
    return LaneInput(parameters, initial, {**signals, **make_time(0.0, SAMPLES, DT)})


def make_lanes() -> list[LaneInput]:
    """Make lanes of which one diverges, one has another input, some have limits, and some spill."""
    lanes = [motion(index) for index in range(19)]
    lanes[3] = replace(lanes[3], initial_states={**lanes[3].initial_states, "p": 1e200})
    lanes[5] = replace(lanes[5], signals={**lanes[5].signals, "F": interpolate_linearly(2.0 * FORCE)})
    lanes[7] = replace(lanes[7], limits={"x": (-0.02, 0.03)})
    lanes[8] = replace(lanes[8], limits={"x": (-0.02, 0.03)}, spills={"x": ("y", 0.5)})
    return lanes


def simulate_natively(
    program: OdeProgram,
    lanes: list[LaneInput],
    monkeypatch: pytest.MonkeyPatch,
    simulate: Callable[[OdeProgram, float, list[LaneInput]], np.ndarray] = simulate_lanes,
) -> tuple[np.ndarray, np.ndarray]:
    """Return outputs of the interpreter and of machine code."""
    monkeypatch.setattr(native_code, "COMPILED_FROM", np.inf)
    interpreted = simulate(program, DT, lanes)
    monkeypatch.setattr(native_code, "COMPILED_FROM", 0)
    return interpreted, simulate(program, DT, lanes)


def test_machine_code_has_the_bits_of_the_interpreter(monkeypatch: pytest.MonkeyPatch) -> None:
    program = generate_program(make_system(ARITHMETIC))
    compiled: list[object] = []
    make = native_code._compile
    monkeypatch.setattr(native_code, "_compile", lambda given: compiled.append(given) or make(given))
    interpreted, native = simulate_natively(program, make_lanes(), monkeypatch)
    assert len(compiled) == 2  # the lanes beyond sixteen have neither limits nor signals of single lanes
    assert native.tobytes() == interpreted.tobytes()
    assert np.isnan(native).all(axis=(1, 2)).tolist() == [index == 3 for index in range(19)]
    fewer = simulate_lanes(program, DT, make_lanes(), every=3)
    assert fewer.tobytes() == np.ascontiguousarray(interpreted[:, :, ::3]).tobytes()


def test_limits_and_overflow_have_the_bits_of_the_interpreter(monkeypatch: pytest.MonkeyPatch) -> None:
    system = make_system(ARITHMETIC)
    program = generate_program(system, (Symbol("x"), Symbol("y")))
    lanes = make_lanes()[5:10]
    interpreted, native = simulate_natively(program, lanes, monkeypatch)
    assert native.tobytes() == interpreted.tobytes()
    assert (native[2, 0].min(), native[2, 0].max()) == (-0.02, 0.03)
    assert not np.array_equal(native[2, 1], native[3, 1])


@pytest.mark.parametrize(("interval", "restarted"), [(30, "xvyp"), (30, "xv"), (SAMPLES, "x")])
def test_restarted_runs_have_the_bits_of_the_interpreter(
    interval: int, restarted: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    starts = np.random.default_rng(1).standard_normal((19, -(-SAMPLES // interval), len(restarted)))
    starts[2, -1, 0] = 1e200

    def simulate(program: OdeProgram, dt: float, lanes: list[LaneInput]) -> np.ndarray:
        simulation = IntervalSimulation(program, dt, lanes, restarted, interval)
        return simulation.simulate(np.arange(19), starts, np.ones(starts.shape[:2], dtype=bool))[:, 0]

    program = generate_program(make_system(ARITHMETIC), (Symbol("x"),))
    interpreted, native = simulate_natively(program, make_lanes(), monkeypatch, simulate)
    # The sign of a NaN depends on the order of the operands of a sum, which a compiler may exchange.
    assert np.nan_to_num(native, nan=7.0).tobytes() == np.nan_to_num(interpreted, nan=7.0).tobytes()
    assert np.array_equal(np.isnan(native), np.isnan(interpreted))
    assert np.array_equal(native[4, :, 0], starts[4, :, 0])
    assert not np.isfinite(native[2, -1]).all()


def test_program_is_compiled_once_it_has_run_long_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    program = generate_program(make_system(ARITHMETIC))
    monkeypatch.setattr(native_code, "COMPILED_FROM", 3 * SAMPLES * len(program.instructions.code))
    calls: list[int] = []
    run = native_code.NativeCode.integrate
    monkeypatch.setattr(
        native_code.NativeCode, "integrate", lambda *given: (calls.append(len(calls)), run(*given))[1]
    )
    found = [simulate_lanes(program, DT, [motion(1)]).tobytes() for _ in range(5)]
    assert len(calls) == 2
    assert len(set(found)) == 1


def test_stored_code_is_used_at_once_with_the_same_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    program = generate_program(make_system(ARITHMETIC))
    interpreted, native = simulate_natively(program, make_lanes(), monkeypatch)
    forget_programs(monkeypatch)
    monkeypatch.setattr(native_code, "COMPILED_FROM", 1e12)
    monkeypatch.setattr(native_code, "generate_code", pytest.fail)
    monkeypatch.setattr("islands.simulators.ode.lane_simulation.integrate", pytest.fail)
    assert simulate_lanes(program, DT, make_lanes()).tobytes() == native.tobytes() == interpreted.tobytes()


@pytest.mark.parametrize("damage", [lambda code: code[:-100], lambda code: code[:40] + b"?" + code[41:]])
def test_damaged_code_is_compiled_again(
    damage: Callable[[bytes], bytes], empty_store: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = generate_program(make_system(ARITHMETIC))
    _, native = simulate_natively(program, make_lanes(), monkeypatch)
    files = list((empty_store / "programs").iterdir())
    stored = {file: file.read_bytes() for file in files}
    for file, code in stored.items():
        file.write_bytes(damage(code))
    forget_programs(monkeypatch)
    assert simulate_lanes(program, DT, make_lanes()).tobytes() == native.tobytes()
    assert {file: file.read_bytes() for file in files} == stored


def test_the_older_half_of_too_many_programs_is_deleted(
    empty_store: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(native_code, "MAX_STORED", 4)
    for count in range(1, 6):
        native_code.store_code(f"program {count}", b"code")
        assert len(list((empty_store / "programs").iterdir())) == (count if count < 5 else 3)
    assert native_code.load_code("program 5") == b"code"
    assert not native_code.is_stored("program 1")
