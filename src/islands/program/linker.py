"""From terms to the flat program that the kernels run."""

from collections.abc import Sequence

import numpy as np

from islands.kernels import linker
from islands.kernels.machine import Program
from islands.program.store import Store, Term


def link(terms: Sequence[Term]) -> Program:
    """Link regressors, one term each and in the order given.

    A term may also be a bare canonical expression of lag 0, the target y(k) for instance: the kernel of
    columns allows it, a simulation does not.
    """
    store = Store()
    numbers = store.terms(terms)
    nodes = store.nodes
    program: Program = linker.link(nodes, numbers, np.full(nodes.operation.size, -1, np.int64))
    return program
