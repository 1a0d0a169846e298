"""Models published in the paper: equations (12)-(14) with the parameters of Table 2.

The terms are written as in the paper. The models contain their canonical form, so the sign of a parameter
differs if the paper writes a difference in the opposite order.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from islands.errors import lookup
from islands.expressions.parsing import parse
from islands.models.narx import Model, make_model


@dataclass(frozen=True, slots=True)
class Published:
    """A published model and its free-run errors from Table 1.

    Attributes
    ----------
    model : Model
        Model with the published parameters, which are rounded to three digits.
    terms : mapping
        Terms and parameters as printed, in the order of Table 2.
    source : str
        Equation, method and data.
    mape, r2 : tuple of float
        Errors on the estimation data and on the validation data; MAPE in per cent.
    """

    model: Model
    terms: Mapping[str, float]
    source: str
    mape: tuple[float, float]
    r2: tuple[float, float]


def _make_published_model(terms: Mapping[str, float], dt: float) -> Model:
    return make_model(((parse(text), value) for text, value in terms.items()), ("u_V",), "y_um", dt)


_MODEL_12 = {
    "y(k-1)": 1.00,
    "phi1(u(k-1), u(k-2))": 0.77,
    "u(k-2)*phi2(u(k-2), u(k-3))*phi1(u(k-2), u(k-3))": 1.44e-2,
    "y(k-1)*phi2(u(k-2), u(k-3))*phi1(u(k-2), u(k-3))": -9.60e-3,
    "u(k-2)^2*phi1(u(k-2), u(k-3))": 3.15e-4,
    "u(k-2)*y(k-1)*phi1(u(k-2), u(k-3))": -2.46e-4,
}

_MODEL_13 = {
    "y(k-1)": 1.00,
    "u(k-1)*phi1(u(k-12), u(k-1))*phi2(u(k-4), u(k-1))": 1.35e-3,
    "phi1(u(k-9), u(k-13))": -4.17e-1,
    "y(k-2)*phi1(u(k-12), u(k-10))*phi2(u(k-6), u(k-1))": -5.09e-3,
    "y(k-8)*u(k-8)*phi1(u(k-1), u(k-4))": -1.17e-4,
    "phi1(u(k-10), u(k-6))": -2.08e-1,
    "phi1(u(k-1), u(k-13))": 1.31e-1,
    "phi2(u(k-15), u(k-12))": -1.87e-4,
    "u(k-1)*u(k-12)*phi1(u(k-2), u(k-1))": -4.36e-4,
}

_MODEL_14 = {
    "phi2(u(k-5), u(k-10))": 2.10e-2,
    "phi2(u(k-1), u(k-3))": 2.35e-2,
    "y(k-6)*u(k-10)": 1.52e-4,
    "y(k-1)*u(k-4)": -1.52e-4,
    "u(k-9)": 3.14,
    "u(k-7)": -3.14,
    "phi2(u(k-9), u(k-2))": -2.15e-2,
    "phi1(u(k-5), u(k-6))": 1.38e1,
    "y(k-1)": 1.00,
}

PUBLISHED: Mapping[str, Published] = MappingProxyType(
    {
        "12": Published(
            _make_published_model(_MODEL_12, 1e-3),
            MappingProxyType(_MODEL_12),
            "equation (12), after Martins and Aguirre: ERR, AIC and constraints",
            (0.32874, 0.33374),
            (0.99940, 0.99984),
        ),
        "13": Published(
            _make_published_model(_MODEL_13, 1e-3),
            MappingProxyType(_MODEL_13),
            "equation (13), case 1: MGGP/FROE on the Bouc-Wen piezo",
            (0.31189, 0.25250),
            (0.99940, 0.99990),
        ),
        "14": Published(
            _make_published_model(_MODEL_14, 5e-5),
            MappingProxyType(_MODEL_14),
            "equation (14), case 2: MGGP/FROE on the measured micromanipulator at 5 V and 300 Hz",
            (1.01111, 1.01039),
            (0.99888, 0.99887),
        ),
    }
)


def get_published_model(number: str) -> Published:
    """Return a published model by its equation number.

    Raises
    ------
    SettingsError
        No published model has that number.
    """
    return lookup(PUBLISHED, number, "published model")
