"""Fuzzing of the searches: short and extreme records give a result, or an error that says what to do.

    python -m lab.fuzzing.searches [--cases 200] [--seconds N] [--seed 0] [--first 0] [--function fit ...]

A case is a record of 1 to 200 samples (of a diagnosis, which needs 200, also more) and a call of `fit`,
`identify`, `diagnose` or `fit` of several outputs. The columns of the record are constant, binary, huge,
tiny, equal, incomplete and others. It is a defect if the call raises another exception than an error of
`islands.errors`, if NumPy warns, if a number that is promised to be finite is not, or if the call takes
longer than `SLOW`. ``--seed S --first N --cases 1`` repeats a case. The exit status is 1 if there is a
defect.
"""

import argparse
import faulthandler
import signal
import sys
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from types import FrameType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

import islands
from islands.diagnosis.result import Diagnosis
from islands.errors import ExtrapolationWarning, IslandsError
from islands.estimation.parameter_constraints import CONSTRAINTS
from islands.facade.results.identification import Result
from islands.models.candidate_library import LIBRARIES
from islands.records.coupled import CoupledRecord
from islands.records.dataset import Dataset
from islands.report.documents.diagnosis_json import as_json, diagnosis_document
from islands.report.documents.result_folder import result_json
from islands.simulators.specification.equations import OdeSpec

Generator = np.random.Generator
Signal = NDArray[np.float64]

#: Largest number of seconds of CPU of one case: a diagnosis of an axis takes up to 75.
SLOW = 120.0

#: Most samples of a record, and most of one that is diagnosed.
MOST_SAMPLES, MOST_DIAGNOSED = 200, 320

#: A system for `diagnose`, as a user writes it.
DECAY = OdeSpec.model_validate(
    {
        "kind": "ode",
        "name": "decay",
        "input": "u",
        "equations": "dx/dt = (gain * u - x) / constant",
        "output": "x",
        "parameters": {"gain": 1.0, "constant": {"value": 0.5, "positive": True}},
        "states": {"x": {}},
    }
)

#: Seconds after which a process that is stuck in a case ends.
STUCK = 900.0

#: Share of the searches whose library or preset is chosen by trials, which take seconds.
_AUTO = 0.02

#: Effects of the catalogue that a diagnosis draws from.
_EFFECTS = tuple(islands.EFFECTS)


class SlowCaseError(BaseException):
    """A case exceeds `SLOW`. No handler of exceptions in the library catches it."""


@dataclass(frozen=True)
class Case:
    """A call of a search.

    Attributes
    ----------
    function : str
        Name of the function.
    description : str
        The record and the settings.
    run : callable
        Carries out the call.
    """

    function: str
    description: str
    run: Callable[[], Any]


@dataclass(frozen=True)
class Ending:
    """How a case ended: ``result``, the name of a deliberate error, or ``defect``, with its reason."""

    case: Case
    outcome: str
    reason: str = ""
    seconds: float = 0.0


def _ramp(rng: Generator, samples: int) -> Signal:
    return np.linspace(rng.normal(), rng.normal(), samples)


def _steps(rng: Generator, samples: int) -> Signal:
    return np.repeat(rng.integers(-3, 4, samples), rng.integers(1, 20))[:samples].astype(float)


def _incomplete(rng: Generator, samples: int) -> Signal:
    return np.where(rng.random(samples) < rng.choice((0.02, 0.3, 1.0)), np.nan, rng.normal(size=samples))


def _spike(rng: Generator, samples: int) -> Signal:
    signal = rng.normal(size=samples)
    signal[rng.integers(samples)] = rng.choice((1e6, 1e29, 9.9e37, -1e300, np.inf))
    return signal


#: Kinds of columns.
COLUMNS: dict[str, Callable[[Generator, int], Signal]] = {
    "random": lambda rng, samples: rng.normal(size=samples),
    "walk": lambda rng, samples: np.cumsum(rng.normal(size=samples)),
    "sine": lambda rng, samples: np.sin(rng.uniform(0.01, 3.0) * np.arange(samples)),
    "constant": lambda rng, samples: np.full(samples, rng.choice((0.0, 1.0, -7.3, 1e-29, 1e29, 1e300))),
    "binary": lambda rng, samples: rng.integers(0, 2, samples).astype(float),
    "ramp": _ramp,
    "steps": _steps,
    "impulse": lambda rng, samples: np.eye(1, samples, rng.integers(samples))[0],
    "huge": lambda rng, samples: rng.choice((1e15, 1e20, 1e29, 1e150, 1.7e308)) * rng.uniform(-1, 1, samples),
    "tiny": lambda rng, samples: rng.choice((1e-15, 1e-20, 1e-29, 1e-150, 5e-323)) * rng.normal(size=samples),
    "offset": lambda rng, samples: rng.choice((1e5, 1e12, 1e16)) + rng.normal(size=samples),
    "incomplete": _incomplete,
    "spike": _spike,
    "decay": lambda rng, samples: np.exp(-rng.choice((0.05, 2.0, 8.0)) * np.arange(samples)),
}

#: Kinds of a mixture, in which two pieces follow each other.
_PIECES = ("random", "constant", "binary", "huge", "tiny", "steps")


def draw_column(rng: Generator, samples: int, known: Sequence[Signal]) -> tuple[str, Signal]:
    """Return the kind and the values of a column: one of `COLUMNS`, a copy of a column, or a mixture."""
    kind = str(rng.choice((*COLUMNS, "random", "sine", "walk", "mixture", "copy")))
    if kind == "copy" and known:
        return kind, known[rng.integers(len(known))] * rng.choice((1.0, -2.0, 1e3))
    if kind in COLUMNS:
        return kind, COLUMNS[kind](rng, samples)
    first, second = rng.choice(_PIECES, 2)
    values = COLUMNS[first](rng, samples)
    start = rng.integers(samples)
    values[start:] = COLUMNS[second](rng, samples)[start:]
    return f"{first}/{second}", values


def _respond(rng: Generator, u: Signal) -> Signal:
    """Return the response of a stable system of first order to an input, with or without noise."""
    pole, response = rng.uniform(-0.9, 0.99), np.zeros(len(u))
    for k in range(1, len(u)):
        response[k] = pole * response[k - 1] + u[k - 1] + 0.1 * np.tanh(u[k - 1]) ** 2
    return response + rng.choice((0.0, 0.01)) * rng.normal(size=len(u))


@dataclass(frozen=True)
class Columns:
    """Inputs and outputs of a record, and their description."""

    u: Signal
    y: Signal
    dt: float
    description: str

    @property
    def segments(self) -> tuple[int, ...]:
        """Two recordings of a record that has more than one sample."""
        first = len(self.u) // 3
        return (first, len(self.u) - first) if first else (len(self.u),)


def draw_columns(rng: Generator, samples: int, inputs: int, outputs: int = 1) -> Columns:
    """Return random columns."""
    kinds: list[str] = []
    values: list[Signal] = []
    for place in range(inputs + outputs):
        if place >= inputs and rng.random() < 0.6:
            kind, column = "response", _respond(rng, values[rng.integers(inputs)])
        else:
            kind, column = draw_column(rng, samples, values)
        kinds.append(kind)
        values.append(column)
    dt = float(rng.choice((0.01, 1.0, 1e-9, 86400.0), p=(0.7, 0.2, 0.05, 0.05)))
    described = f"{samples} samples of {dt:g} s, {' '.join(kinds[:inputs])} to {' '.join(kinds[inputs:])}"
    return Columns(np.column_stack(values[:inputs]), np.column_stack(values[inputs:]), dt, described)


def _draw_changes(rng: Generator, table: dict[str, Sequence[Any]], share: float) -> dict[str, Any]:
    """Return some entries of a table with one of their values each."""
    return {name: values[rng.integers(len(values))] for name, values in table.items() if rng.random() < share}


_FIT = {
    "degree": (1, 2, 3),
    "lags": (1, 2, 4),
    "delays": ((1,), (5,)),
    "max_terms": (1, 3, 5),
    "constraints": (*CONSTRAINTS, "odd", "gain = 2.5"),
    "estimator": tuple(islands.ESTIMATORS),
    "average": ("auto", 1, 2),
    "feedthrough": ("auto", "yes", "no"),
    "shooting": (1, 7, 1000),
    "validation": (0.25, 0.5, 0.05),
    "seed": (0, 1),
}

_IDENTIFY = {
    "preset": (*islands.PRESETS, "narx", "hysteresis"),
    "max_height": (0, 1, 2, 3),
    "constraints": (*CONSTRAINTS, "odd", "gain = 2.5"),
    "fitness": ("shooting", "one-step"),
    "shooting": (1, 7, 1000),
    "primitives": (("mul",), ("mul", "sqrt", "abs"), ("mul", "exp", "tanh")),
    "library_degree": (1, 2, 3),
    "refine": (True, False),
    "average": ("auto", 1, 2),
    "feedthrough": ("auto", "yes", "no"),
    "estimator": tuple(islands.ESTIMATORS),
    "validation": (0.25, 0.5, 0.05),
    "seed": (0, 1),
}

_SIMULATIONS = (
    *("linear:0", "linear:1", "linear:2:3", "linear:4", "column:y_sim"),
    *("second-order", "rigid-axis", "cascaded-tanks", "bouc-wen-piezo"),
)


def _record(rng: Generator, columns: Columns) -> tuple[tuple[Any, ...], dict[str, Any]]:
    """Return the arguments that give a record of one output: arrays, or a Dataset of one or two segments."""
    if rng.random() < 0.3:
        return (columns.u, columns.y[:, 0], columns.dt), {}
    segments = columns.segments if rng.random() < 0.3 else ()
    return (), {"make": partial(Dataset, columns.u, columns.y[:, 0], columns.dt, segments=segments)}


def _call(function: Callable[..., Any], given: tuple[tuple[Any, ...], dict[str, Any]], **options: Any) -> Any:
    arguments, made = given
    return function(*(arguments or (made["make"](),)), **options)


def _draw_fit(rng: Generator) -> Case:
    columns = draw_columns(rng, rng.integers(1, MOST_SAMPLES + 1), rng.integers(1, 5))
    options = {
        "library": str(rng.choice((*LIBRARIES,))) if rng.random() > _AUTO else "auto",
        "certificate": int(rng.choice((0, 20))),
        "max_terms": 4,
        **_draw_changes(rng, _FIT, 0.35),
    }
    given = _record(rng, columns)
    return Case("fit", f"{columns.description}; {options}", partial(_call, islands.fit, given, **options))


def _draw_identify(rng: Generator) -> Case:
    columns = draw_columns(rng, rng.integers(1, MOST_SAMPLES + 1), rng.integers(1, 5))
    options: dict[str, Any] = {
        "population": int(rng.integers(2, 12)),
        "generations": int(rng.integers(0, 4)),
        "islands": int(rng.integers(1, 3)),
        **_draw_changes(rng, _IDENTIFY, 0.3),
    }
    options.setdefault("swap_search", rng.random() < 0.05)
    options.setdefault("preset", "narx" if rng.random() > _AUTO else "auto")
    options.setdefault("migrants", 0 if options["islands"] == 1 else 1)
    given = _record(rng, columns)
    run = partial(_call, islands.identify, given, **options)
    return Case("identify", f"{columns.description}; {options}", run)


def _draw_coupled(rng: Generator) -> Case:
    columns = draw_columns(rng, rng.integers(1, MOST_SAMPLES + 1), rng.integers(1, 4), outputs=2)
    inputs, outputs = columns.u.shape[1], ("y1", "y2")
    names = tuple(f"u{place + 1}" for place in range(inputs))
    frame = dict(zip((*names, *outputs), np.column_stack([columns.u, columns.y]).T, strict=True))
    options = {"degree": int(rng.integers(1, 3)), "lags": int(rng.integers(1, 3)), "max_terms": 4}
    options["certificate"] = 0

    def run() -> Result:
        if len(columns.u) % 2:
            return islands.fit(frame, inputs=names, output=outputs, dt=columns.dt, **options)
        records = tuple(
            Dataset(columns.u, y, columns.dt, names, name)
            for name, y in zip(outputs, columns.y.T, strict=True)
        )
        return islands.fit(CoupledRecord(records), **options)

    return Case("fit of several outputs", f"{columns.description}; {options}", run)


def _draw_diagnose(rng: Generator) -> Case:
    samples = rng.integers(1, MOST_DIAGNOSED + 1) if rng.random() < 0.2 else rng.integers(200, MOST_DIAGNOSED)
    columns = draw_columns(rng, samples, 1 if rng.random() < 0.8 else 2)
    simulation = DECAY if rng.random() < 0.2 else str(rng.choice(_SIMULATIONS))
    _, simulated = draw_column(rng, samples, (columns.u[:, 0], columns.y[:, 0]))
    chosen = rng.choice(len(_EFFECTS), rng.integers(1, 4), replace=False)
    effects = tuple(_EFFECTS[place] for place in sorted(chosen))
    segments = columns.segments if rng.random() < 0.1 else ()

    def run() -> Diagnosis:
        if rng.random() < 0.3:
            record = islands.as_record(columns.u, columns.y[:, 0], columns.dt, resting_inputs=True)
        else:
            record = Dataset(columns.u, columns.y[:, 0], columns.dt, segments=segments)
        return islands.diagnose(record, simulation, columns={"y_sim": simulated}, effects=effects)

    name = simulation if isinstance(simulation, str) else "ode"
    described = f"{columns.description}; {name}; {', '.join(each.name for each in effects)}"
    return Case("diagnose", described, run)


#: What draws a case, by function, and its share of the cases.
FUNCTIONS: dict[str, tuple[Callable[[Generator], Case], float]] = {
    "fit": (_draw_fit, 0.45),
    "identify": (_draw_identify, 0.35),
    "diagnose": (_draw_diagnose, 0.1),
    "fit of several outputs": (_draw_coupled, 0.1),
}


def draw_case(seed: int, number: int, functions: Sequence[str] = tuple(FUNCTIONS)) -> Case:
    """Return a case; it depends on the arguments only."""
    rng = np.random.default_rng((seed, number))
    shares = np.array([FUNCTIONS[name][1] for name in functions])
    with np.errstate(all="ignore"):  # a response to a huge input
        return FUNCTIONS[str(rng.choice(functions, p=shares / shares.sum()))][0](rng)


def check_result(found: Any) -> None:
    """Check that the numbers of a result that are promised to be finite are finite, and write its texts.

    Raises
    ------
    AssertionError, ValueError
        A number is not finite.
    """
    match found:
        case Result():
            for fitted in found.models:
                parameters = np.asarray(fitted.model.parameters, dtype=float)
                assert np.isfinite(parameters).all(), f"parameters {parameters}"
            assert found.models
            result_json(found.search_result)
            assert str(found)
            for each in found.outputs:
                check_result(each)
        case Diagnosis():
            as_json(diagnosis_document(found))
            assert np.isfinite(found.best.values).all()
            assert np.isfinite([found.nominal_rmse, found.noise_floor]).all()


def _stop_slow_case(_signal: int, _frame: FrameType | None) -> None:
    raise SlowCaseError


def run_case(case: Case) -> Ending:
    """Carry out a case and check its result."""
    signal.signal(signal.SIGPROF, _stop_slow_case)
    # The signal waits for the end of a compiled loop. If one never ends, the process ends with its traceback.
    faulthandler.dump_traceback_later(STUCK, exit=True, file=sys.__stderr__)
    signal.setitimer(signal.ITIMER_PROF, SLOW)
    began = time.process_time()
    outcome, reason = "result", ""
    try:
        # The matrices are small: several threads take more time.
        with warnings.catch_warnings(), threadpool_limits(1, user_api="blas"):
            warnings.simplefilter("error")
            # A warning about the data of a case is none about the code.
            warnings.simplefilter("ignore", ExtrapolationWarning)
            check_result(case.run())
    except IslandsError as error:
        outcome = type(error).__name__
        if not str(error).strip():
            outcome, reason = "defect", "the message of the error is empty"
        else:
            reason = str(error)
    except SlowCaseError:
        outcome, reason = "defect", f"it takes more than {SLOW:g} s of CPU\n{traceback.format_exc()}"
    except Exception:
        outcome, reason = "defect", traceback.format_exc()
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        faulthandler.cancel_dump_traceback_later()
    return Ending(case, outcome, reason, time.process_time() - began)


def run_cases(seed: int, numbers: Sequence[int], functions: Sequence[str]) -> Iterator[Ending]:
    """Carry out cases one after the other."""
    for number in numbers:
        yield run_case(draw_case(seed, number, functions))


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--seconds", type=float, help="stop after this time, in place of --cases")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--function", nargs="*", default=list(FUNCTIONS), choices=list(FUNCTIONS))
    parser.add_argument("--messages", action="store_true", help="list the messages of the deliberate errors")
    options = parser.parse_args(arguments)
    began, outcomes, defects, messages = time.monotonic(), Counter[str](), 0, Counter[str]()
    cpu = Counter[str]()
    number, longest = options.first, (0.0, 0)
    while (
        time.monotonic() - began < options.seconds
        if options.seconds
        else number < options.first + options.cases
    ):
        ending = run_case(draw_case(options.seed, number, options.function))
        outcomes[f"{ending.case.function}: {ending.outcome}"] += 1
        cpu[ending.case.function] += ending.seconds  # type: ignore[assignment]
        longest = max(longest, (ending.seconds, number))
        if ending.outcome == "defect":
            defects += 1
            print(f"\nseed {options.seed}, case {number}, {ending.case.function}: {ending.case.description}")
            print(ending.reason, flush=True)
        elif ending.reason:
            messages[f"{ending.case.function}: {ending.reason}"] += 1
        number += 1
        if (number - options.first) % 100 == 0:
            seconds = time.monotonic() - began
            print(f"{number - options.first:7,} cases, {defects} defects, {seconds:.0f} s", flush=True)
    for name, count in sorted(outcomes.items()):
        print(f"{name:28} {count:7,}")
    print(*(f"{name}: {seconds:.0f} s of CPU" for name, seconds in cpu.items()), sep=", ")
    if options.messages:
        for text, count in messages.most_common():
            print(f"{count:6} {text}")
    seconds = time.monotonic() - began
    print(f"{number - options.first:,} cases, {defects} defects, {seconds:.0f} s")
    print(f"the longest case is {longest[1]}: {longest[0]:.1f} s")
    return 1 if defects else 0


if __name__ == "__main__":
    sys.exit(main())
