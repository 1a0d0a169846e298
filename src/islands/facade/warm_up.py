"""Warm-up: compile every kernel before anybody waits for a result."""

from collections.abc import Callable

from islands.data.dataset import Dataset
from islands.estimation.parameter_constraints import CONSTRAINTS
from islands.facade.fit import fit
from islands.facade.identify import identify
from islands.kernels.jit_cache import ready
from islands.systems.catalogue import make_record


def warm_up(tell: Callable[[str], None] = print) -> bool:
    """Make sure that the kernels are compiled: once for a version and a processor, into the user's cache.

    Parameters
    ----------
    tell : callable
        Takes a line for the user before anything that takes long.

    Returns
    -------
    bool
        Whether they had to be compiled here.
    """
    return ready(_use_all, tell)


def _use_all() -> None:
    """Use every kernel once, with the types that it is used with."""
    whole = make_record("bouc-wen-piezo", "authors", "estimation")
    record = Dataset(whole.u[:1200], whole.y[:1200], whole.dt)
    fit(record, max_terms=3)
    for constraints in CONSTRAINTS:
        identify(record, population=10, generations=2, shooting=100, constraints=constraints)
