"""A proposal: a formula for what is left over, where no name explains it."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Proposal:
    """A formula for what the best simulation leaves over.

    Attributes
    ----------
    formula : str
        Of the residual, measured minus simulated, in free run: it reads its own past, the input and the
        simulated output.
    explains : float
        Share of the remainder's mean square that it foretells over the locked samples.
    """

    formula: str
    explains: float
