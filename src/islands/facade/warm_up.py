"""Compilation of all kernels before the first use."""

from collections.abc import Callable
from dataclasses import replace

from islands.data.coupled_record import CoupledRecord
from islands.data.dataset import Dataset
from islands.facade.fit import fit
from islands.facade.identify import identify
from islands.kernels.jit_cache import ready
from islands.model.expression import Lagged
from islands.model.model import make_model
from islands.simulation.coupled_free_run import coupled_free_run
from islands.simulation.coupled_model import CoupledModel
from islands.systems.catalogue import make_record


def warm_up(report: Callable[[str], None] = print) -> bool:
    """Compile the kernels into the cache of the user, once per version and processor.

    Parameters
    ----------
    report : callable
        Receives a line for the user before a long step.

    Returns
    -------
    bool
        Whether kernels had to be compiled.
    """
    return ready(_use_all_kernels, report)


def _use_all_kernels() -> None:
    """Call every kernel once with each of its argument types."""
    whole = make_record("bouc-wen-piezo", "authors", "estimation")
    record = Dataset(whole.u[:1200], whole.y[:1200], whole.dt)
    fit(record, library="phi-polynomial", max_terms=3)
    for constraints in ("none", "hysteresis"):
        identify(
            record,
            preset="hysteresis",
            population=10,
            generations=2,
            shooting=100,
            constraints=constraints,
        )
    _simulate_two_outputs(record)


def _simulate_two_outputs(record: Dataset) -> None:
    names = (record.output_name, "other")
    equations = (
        make_model([(Lagged(0), 0.5)], (*record.input_names, names[1 - place]), name)
        for place, name in enumerate(names)
    )
    both = CoupledRecord((record, replace(record, output_name="other")))
    coupled_free_run(CoupledModel(tuple(equations)), both)
