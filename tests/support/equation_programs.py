"""Extended simulations of equations, and their programs in C and MATLAB, run on a record."""

import ctypes
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.diagnosis.calibration.levenberg_marquardt import evaluate_fit
from islands.diagnosis.calibration.target import Target
from islands.effects.catalogue import CATALOGUE, catalogue_order
from islands.effects.interface.effect import Effect, Site
from islands.export.equations.collection import collect_equations
from islands.export.extension import export_extended
from islands.records.dataset import Dataset
from islands.report.documents.extension import extended_document
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.interface import Simulator
from islands.simulators.intersample import InterSample, ResampledSimulator
from islands.simulators.specification.table import LocalExtendedSpec
from lab.speed.compiled_c import compile_model

Array = NDArray[np.float64]

FLAGS = ("-std=c99", "-O1", "-Wall", "-Wextra", "-Wpedantic", "-Werror")

OCTAVE = shutil.which("octave-cli")

#: Largest difference of a program from the simulation, relative to the range of the output.
TOLERANCE = 1e-9

#: Functions of Octave that exchange numbers through binary files, which keep every bit.
OCTAVE_FILES = """
function r = read_numbers(name)
  file = fopen(name); r = fread(file, Inf, 'double'); fclose(file);
end
function write_numbers(name, values)
  file = fopen(name, 'w'); fwrite(file, values, 'double'); fclose(file);
end
"""


def list_effects(simulator: Simulator, record: Dataset) -> list[Effect]:
    """Return all effects that a simulator supports and a record can show."""
    context = make_context(record, simulator, record.samples)
    return [
        *(
            each
            for each in CATALOGUE.values()
            if each.site in simulator.sites
            and (each.site != Site.CORE or each.name in simulator.supported_effects)
            and each.is_applicable(context)
        ),
        *simulator.state_effects,
    ]


def extend(
    simulator: Simulator,
    record: Dataset,
    effects: Sequence[Effect] = (),
    hold: str = "first-order",
    times: int = 1,
    known: Sequence[Effect] = (),
) -> tuple[LocalExtendedSpec, Array]:
    """Return the document of a simulator with effects at their last starting points, and its output.

    Those in ``known`` act in its order.
    """
    if (hold, times) != ("first-order", 1):
        simulator = ResampledSimulator(simulator, InterSample(hold), times)
    context = make_context(record, simulator, record.samples)
    simulation = ExtendedSimulator(simulator, catalogue_order(effects, known), context)
    values = simulation.nominal
    residual = 0.01 * context.output_peak * np.sin(2 * np.pi * 7.3 * context.time)
    for effect in simulation.effects:
        values[simulation.get_slice(effect)] = effect.starting_points(context, residual)[-1]
    target = Target(record.y, np.ones(record.samples, dtype=bool), None, {}, fitted=record.samples)
    fit = evaluate_fit(simulation, target, values)
    return LocalExtendedSpec.model_validate(extended_document(fit, record)), simulation.simulate(values)


def read_columns(spec: LocalExtendedSpec, record: Dataset, further: Mapping[str, Array]) -> list[Array]:
    """Return the columns that a program reads, in the order of its arguments."""
    columns = dict(zip(record.input_names, record.u.T, strict=True)) | {record.output_name: record.y}
    columns |= further
    return [np.ascontiguousarray(columns[each]) for each in collect_equations(spec).columns.values()]


def run_c(
    spec: LocalExtendedSpec,
    record: Dataset,
    folder: Path,
    further: Mapping[str, Array] = MappingProxyType({}),
) -> Array:
    """Compile the program in C and simulate a record, which may have further columns."""
    library = compile_model(export_extended(spec, "c"), FLAGS, folder)
    columns = read_columns(spec, record, further)
    # One more member, which some programs set themselves.
    members = (ctypes.c_size_t * (2 + len(columns)))(record.samples, *(each.ctypes.data for each in columns))
    y = np.full(record.samples, np.nan)
    defaults = [(ctypes.c_char * 1).in_dll(library, name) for name in ("PARAMETERS", "INITIAL_STATES")]
    status = library.simulate(
        *map(ctypes.byref, defaults), ctypes.byref(members), ctypes.c_void_p(y.ctypes.data)
    )
    assert status == 0
    return y


def run_matlab(
    programs: Sequence[tuple[LocalExtendedSpec, Dataset]],
    folder: Path,
    further: Mapping[str, Array] = MappingProxyType({}),
) -> list[Array]:
    """Simulate records with programs in Octave, in one process. Warnings are errors."""
    runs = []
    for index, (spec, record) in enumerate(programs):
        own = folder / str(index)
        own.mkdir()
        text = export_extended(spec, "matlab")
        (own / "extended_simulation.m").write_text(text, encoding="ascii")
        columns = read_columns(spec, record, further)
        for place, column in enumerate(columns):
            column.tofile(own / f"u{place}")
        arguments = ", ".join(f"read_numbers('u{place}')" for place in range(len(columns)))
        runs.append(
            f"cd('{own}'); clear extended_simulation; write_numbers('y', extended_simulation({arguments}));"
        )
    done = subprocess.run(
        [str(OCTAVE), "--quiet", "--no-init-file", "--no-history", "--eval", OCTAVE_FILES + "\n".join(runs)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    return [np.fromfile(folder / str(index) / "y") for index in range(len(programs))]


def compare(found: Array, expected: Array) -> None:
    """Compare the output of a program with that of the simulation."""
    assert np.isfinite(expected).all()
    assert float(np.max(np.abs(found - expected))) < TOLERANCE * float(np.ptp(expected))


def fix_states(document: Mapping[str, Any], values: Mapping[str, float]) -> dict[str, Any]:
    """Return the document of equations whose states at the first sample are given and not fitted."""
    states = {
        name: {**document.get("states", {}).get(name, {}), "initial": value, "fixed": True}
        for name, value in values.items()
    }
    return {**document, "states": states}
