"""Compilation of all kernels before the first use."""

from collections.abc import Callable

from islands.data.dataset import Dataset
from islands.facade.fit import fit
from islands.facade.identify import identify
from islands.kernels.jit_cache import ready
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
    fit(record, max_terms=3)
    for constraints in ("none", "hysteresis"):
        identify(record, population=10, generations=2, shooting=100, constraints=constraints)
