"""Diagnose: hold a simulation against a record, by its name or by what a file says of it."""

from collections.abc import Callable, Mapping, Sequence

from islands.data.dataset import Dataset
from islands.discrepancy.diagnosis import Diagnosis
from islands.discrepancy.diagnosis import diagnose as diagnosed
from islands.discrepancy.effects import EFFECTS
from islands.discrepancy.interfaces.effect import Effect, Signal
from islands.discrepancy.interfaces.parallel import ParallelMap
from islands.discrepancy.interfaces.simulator import Simulator
from islands.discrepancy.simulators.python_function import PythonFunctionSimulator
from islands.evolution.progress import ProgressCallback, ignore_progress
from islands.io.simulator_spec.factory import make_simulator as made
from islands.io.simulator_spec.specification import LocalSpec, SimulationSpec


def diagnose(
    record: Dataset,
    simulation: str | SimulationSpec | LocalSpec | Simulator,
    *,
    tolerance: Mapping[str, float] | None = None,
    columns: Mapping[str, Signal] | None = None,
    effects: Sequence[Effect] = EFFECTS,
    seed: int = 0,
    progress: ProgressCallback = ignore_progress,
    spread: ParallelMap = map,
) -> Diagnosis:
    """Find out what a simulation gets wrong about a record, why, and what mending it is worth.

    Parameters
    ----------
    record : Dataset
        Its first input drives the simulation; further ones are channels that may couple in.
    simulation : str, spec or Simulator
        As on the command line: ``second-order``, ``linear:2``, ``model:FILE.json``,
        ``python:FILE.py:FUNCTION``, ... Or one that is made already.
    tolerance : mapping, optional
        Relative standard deviations of its parameters about their nominal values; who is not named is free.
    columns : mapping, optional
        Outputs of simulations elsewhere, ``(samples,)`` each: ``column:NAME`` takes one.
    effects : sequence of Effect
        The effects that are searched for. Add one with ``(*islands.EFFECTS, mine)``: maps of a user act after
        those of the catalogue.
    seed : int
        The same record, simulation and seed give the same diagnosis, bit for bit.
    progress : callable
        Told what is being done.
    spread : ParallelMap
        Fits the effects, side by side perhaps; the result is the same.

    Raises
    ------
    RecordError
        The record cannot be used, or the simulation diverges on it.
    SettingsError, ModelError
        There is no such simulation, a tolerance is of none of its parameters, two effects have one name, or
        an effect is broken.
    """
    # What is asked for has a kind; what is made has sites for effects.
    asked_for = isinstance(simulation, str) or hasattr(simulation, "kind")
    simulator = made(simulation, record, columns) if asked_for else simulation  # type: ignore[arg-type]
    return diagnosed(record, simulator, tolerance, seed, progress, spread, effects)  # type: ignore[arg-type]


def function_simulator(function: Callable[..., Signal], **nominal: float) -> Simulator:
    """Make a simulator from a Python function, for `diagnose`.

    Parameters
    ----------
    function : callable
        ``function(u, dt, **parameters) -> y``: input and output of shape (samples,), sampling time in
        seconds. Each parameter has a number as its default.
    **nominal
        Nominal values of parameters that differ from the defaults.

    Raises
    ------
    SettingsError
        The function does not have this form, or has no such parameter.
    """
    return PythonFunctionSimulator(function, getattr(function, "__name__", "function"), nominal)
