"""Random linear regressions, for the tests of estimation and of forward selection."""

import numpy as np
from hypothesis import strategies as st

seeds = st.integers(0, 2**32 - 1)


def problem(seed, terms=5, rows=120, noise=0.3):
    """Draw a regressor matrix of correlated terms (terms, rows) and a target."""
    generator = np.random.default_rng(seed)
    psi = generator.normal(size=(terms, terms)) @ generator.normal(size=(terms, rows))
    psi += 0.5 * generator.normal(size=(terms, rows))
    return psi, generator.normal(size=terms) @ psi + noise * generator.normal(size=rows)


def squares(psi, y, theta):
    return float(np.sum((y - theta @ psi) ** 2))
