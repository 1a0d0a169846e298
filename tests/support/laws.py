"""Simulated laws with known terms, as records with measurement noise or with equation noise."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.expressions.parsing import parse
from islands.models.form import is_linear
from islands.models.latent import LatentModel
from islands.models.narx import Model, make_model
from islands.models.protocol import DynamicModel
from islands.program.regressor_matrix import regressor_matrix
from islands.records.dataset import Dataset
from islands.simulation.predictors import free_run

#: Sampling time of all records in seconds.
DT = 0.05

#: Samples of a record before the first one that is kept: transients of the zero initial state.
_RUN_IN = 100

#: Samples for which a stepped input is constant.
_STEP = 4

#: Samples of the window that smooths a slow input.
_WINDOW = 21


@dataclass(frozen=True)
class Law:
    """A law of motion in discrete time, and a search that is suited to it.

    Attributes
    ----------
    terms : mapping
        Parameter by regressor.
    inputs : tuple of (float, float)
        Range of each input.
    slow : bool
        Whether the inputs are band-limited noise with a continuous slope, and not steps.
    noise : str
        ``output`` for noise of the measurement, ``equation`` for noise that enters the recursion.
    output : mapping
        Coefficients by power of a static output curve; then no model of the vocabulary is exact.
    search : mapping
        Preset and settings of ``islands.identify``.
    """

    terms: Mapping[str, float]
    inputs: tuple[tuple[float, float], ...] = ((-1.0, 1.0),)
    slow: bool = False
    noise: str = "output"
    output: Mapping[int, float] = field(default_factory=dict)
    search: Mapping[str, Any] = field(default_factory=dict)

    @property
    def in_vocabulary(self) -> bool:
        """Whether the search can find exactly the terms of the law."""
        return not self.output

    @property
    def model(self) -> Model:
        """The law as a model."""
        names = ("u",) if len(self.inputs) == 1 else tuple(f"u{i + 1}" for i in range(len(self.inputs)))
        return make_model([(parse(text), value) for text, value in self.terms.items()], names, dt=DT)

    def has_terms_of(self, model: DynamicModel, record: Dataset) -> bool:
        """Return whether a model has exactly the terms of the law.

        A regressor equals a term if both are proportional on the record: with positive inputs ``sqrt(u^2)``
        is ``u``. A linear state space has those of a linear law of its order and dead times.
        """
        if isinstance(model, LatentModel) and is_linear(model) and is_linear(self.model):
            lags = [lag for item in self.model.regressors for channel, lag in item.lags if channel]
            return model.order == self.model.output_lag and min(model.input_lags) + 1 == min(lags)
        if not self.in_vocabulary or not isinstance(model, Model) or model.size != len(self.terms):
            return False
        warm_up = max(model.maximum_lag, self.model.maximum_lag)
        own, other = (regressor_matrix(each.regressors, record, warm_up) for each in (self.model, model))
        unit = [each / np.linalg.norm(each, axis=1, keepdims=True) for each in (own, other)]
        return bool((np.abs(unit[0] @ unit[1].T).max(axis=1) > 1.0 - 1e-9).all())

    def record(self, samples: int, level: float, seed: int) -> Dataset:
        """Simulate a record.

        Parameters
        ----------
        samples : int
        level : float
            Standard deviation of the noise as a fraction of that of the noise-free output.
        seed : int
            Seed of the inputs and of the noise.
        """
        rng = np.random.default_rng(seed)
        count = samples + _RUN_IN
        u = np.column_stack([_excite(rng, count, limits, self.slow) for limits in self.inputs])
        noise = rng.standard_normal(count)
        clean = self._simulate(u, np.zeros(count))
        size = level * float(np.std(clean[_RUN_IN:]))
        y = self._simulate(u, size * noise) if self.noise == "equation" else clean + size * noise
        return Dataset(u[_RUN_IN:], y[_RUN_IN:], DT, self.model.input_names)

    def _simulate(self, u: NDArray[np.float64], error: NDArray[np.float64]) -> NDArray[np.float64]:
        # The equation error is one more input, so a single input becomes u1.
        names = (*self.model.input_names, "e")
        terms = {text.replace("u(", "u1("): value for text, value in self.terms.items()}
        terms[f"u{len(names)}(k-1)"] = 1.0
        model = make_model([(parse(text), value) for text, value in terms.items()], names)
        simulated = free_run(model, Dataset(np.column_stack([u, error]), np.zeros(len(u)), DT, names))
        if not simulated.outcome:
            raise ValueError(f"the law diverges: {simulated.outcome}")
        y = np.nan_to_num(simulated.y)
        curve = self.output or {1: 1.0}
        return np.add.reduce([value * y**power for power, value in curve.items()])


def _excite(
    rng: np.random.Generator, count: int, limits: tuple[float, float], slow: bool
) -> NDArray[np.float64]:
    low, high = limits
    if slow:
        window = np.hanning(_WINDOW)
        noise = np.convolve(rng.standard_normal(count + _WINDOW - 1), window, mode="valid")
        return low + (high - low) * (noise - noise.min()) / np.ptp(noise)
    levels = rng.uniform(low, high, -(-count // _STEP))
    return np.repeat(levels, _STEP)[:count]


_POLYNOMIAL = {
    "preset": "narx",
    "population": 100,
    "generations": 10,
    "max_terms": 8,
    "max_height": 2,
    "shifts": (1, 2),
}


def _law(*, noise: str = "output", search: Mapping[str, Any] | None = None, **arguments: Any) -> Law:
    return Law(noise=noise, search=MappingProxyType(_POLYNOMIAL | dict(search or {})), **arguments)


#: More individuals and generations, to find functions that are not in the library.
_LONGER = {"population": 200, "generations": 25}

_LAGS_5 = {"library_lags": 5, "library_degree": 2}

LAWS: Mapping[str, Law] = MappingProxyType(
    {
        "first order": _law(terms={"y(k-1)": 0.9, "u(k-1)": 0.2}),
        "ARX second order": _law(
            terms={"y(k-1)": 1.5, "y(k-2)": -0.7, "u(k-1)": 0.1, "u(k-2)": 0.15}, noise="equation"
        ),
        "dead time": _law(terms={"y(k-1)": 0.8, "u(k-4)": 0.3}, search=_LAGS_5),
        "motor with load": _law(terms={"y(k-1)": 0.92, "u(k-1)": 0.4, "1": -0.1}, inputs=((0.5, 3.0),)),
        "bilinear": _law(terms={"y(k-1)": 0.7, "u(k-1)": 0.4, "y(k-1)*u(k-1)": 0.15}),
        "Duffing": _law(
            terms={"y(k-1)": 1.6, "y(k-2)": -0.8, "u(k-1)": 0.1, "y(k-1)^3": -0.1}, noise="equation"
        ),
        "Van der Pol": _law(
            terms={
                "y(k-1)": 1.85,
                "y(k-2)": -0.95,
                "y(k-1)^2*y(k-2)": 0.05,
                "y(k-1)^3": -0.05,
                "u(k-1)": 0.1,
            },
            noise="equation",
        ),
        "Hammerstein cubic": _law(terms={"y(k-1)": 0.8, "u(k-1)": 0.3, "u(k-1)^3": -0.2}),
        "Hammerstein square": _law(terms={"y(k-1)": 0.6, "u(k-1)": 0.5, "u(k-1)^2": 0.25}, noise="equation"),
        "Hammerstein two lags": _law(terms={"y(k-1)": 1.2, "y(k-2)": -0.45, "u(k-1)": 0.2, "u(k-2)^2": 0.2}),
        "Wiener": _law(terms={"y(k-1)": 0.8, "u(k-1)": 0.3}, output={1: 1.0, 2: 0.25}),
        "Wiener cubic": _law(terms={"y(k-1)": 0.85, "u(k-1)": 0.2}, output={1: 1.0, 3: -0.1}, noise="output"),
        "two inputs": _law(
            terms={"y(k-1)": 0.7, "u1(k-1)": 0.3, "u2(k-1)": -0.2}, inputs=((-1.0, 1.0), (-1.0, 1.0))
        ),
        "product of two inputs": _law(
            terms={"y(k-1)": 0.6, "u1(k-1)": 0.3, "u1(k-1)*u2(k-1)": 0.4},
            inputs=((-1.0, 1.0), (-1.0, 1.0)),
            noise="equation",
        ),
        "heat exchanger": _law(
            terms={"y(k-1)": 0.95, "u1(k-1)*u2(k-1)": 0.2, "u1(k-1)*y(k-1)": -0.2},
            inputs=((0.2, 1.0), (20.0, 40.0)),
        ),
        "logistic": _law(terms={"y(k-1)": 1.2, "y(k-1)^2": -0.2, "u(k-1)": 0.1}, inputs=((0.0, 1.0),)),
        "tank": _law(
            terms={"y(k-1)": 1.0, "u(k-1)": 0.2, "sqrt(y(k-1))": -0.1},
            inputs=((0.2, 1.0),),
            search=_LONGER | {"primitives": ("mul", "sqrt")},
        ),
        "quadratic drag": _law(
            terms={"y(k-1)": 1.0, "u(k-1)": 0.3, "y(k-1)*abs(y(k-1))": -0.3},
            search=_LONGER | {"primitives": ("mul", "abs")},
            noise="equation",
        ),
        "friction": _law(
            terms={"y(k-1)": 0.95, "u(k-1)": 0.3, "sign(y(k-1))": -0.05},
            search=_LONGER | {"primitives": ("mul", "sign")},
            noise="equation",
        ),
        "saturation": _law(
            terms={"y(k-1)": 0.8, "tanh(u(k-1))": 0.4},
            inputs=((-3.0, 3.0),),
            search=_LONGER | {"primitives": ("mul", "tanh")},
        ),
        "ratio": _law(
            terms={"y(k-1)": 0.8, "u1(k-1)/u2(k-1)": 0.3},
            inputs=((-1.0, 1.0), (0.5, 2.0)),
            search=_LONGER | {"primitives": ("mul", "div")},
        ),
        "exponential": _law(
            terms={"y(k-1)": 0.7, "exp(u(k-1))": 0.2, "1": -0.2},
            inputs=((-2.0, 2.0),),
            search=_LONGER | {"primitives": ("mul", "exp")},
        ),
        "pendulum": _law(
            terms={"y(k-1)": 1.8, "y(k-2)": -0.85, "sin(y(k-1))": -0.15, "u(k-1)": 0.3},
            search=_LONGER | {"primitives": ("mul", "sin")},
            noise="equation",
        ),
        "hysteresis": _law(
            terms={
                "y(k-1)": 1.0,
                "phi1(u(k-1), u(k-2))": 0.8,
                "y(k-1)*phi1(u(k-1), u(k-2))*phi2(u(k-1), u(k-2))": -0.4,
                "u(k-1)*phi1(u(k-1), u(k-2))*phi2(u(k-1), u(k-2))": 0.3,
            },
            slow=True,
            search={"preset": "hysteresis", "shooting": 100, "max_height": 5, "shifts": (1, 2)},
        ),
    }
)
