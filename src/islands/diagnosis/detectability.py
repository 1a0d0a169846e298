"""Detection limits and false-alarm rate of a diagnosis on its record.

``lab/diagnosis/self_test.py`` measures them in a checkout; results and reports have them.
"""

from collections.abc import Mapping
from dataclasses import dataclass

#: Misfits of the injections of an effect, in standard deviations of the residual.
STRENGTHS = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.4)

#: Label of a record without an injection, and of a diagnosis that finds no discrepancy.
NOTHING = "nothing"


@dataclass(frozen=True, slots=True)
class Injection:
    """An effect with values, injected into a surrogate of a record.

    Attributes
    ----------
    effect : str
        Name of the effect.
    values : tuple of float
        Values of its parameters.
    strength, unit : float, str
        Magnitude of the parameters that scale the effect, and their unit.
    misfit : float
        RMS change of the output over the estimation part, in standard deviations of the residual.
    """

    effect: str
    values: tuple[float, ...]
    strength: float
    unit: str
    misfit: float

    @property
    def cause(self) -> str:
        """Name of the effect in the catalogue, without a state or a parameter."""
        return self.effect.partition(":")[0]


@dataclass(frozen=True, slots=True)
class DetectionRate:
    """A proportion of surrogates, with its Clopper-Pearson 95 % interval."""

    value: float
    ci95: tuple[float, float]
    trials: int


@dataclass(frozen=True, slots=True, eq=False)
class SelfTest:
    """Detection limits and error rates of the diagnosis of a record.

    Attributes
    ----------
    detection_limits : mapping of str to Injection or None
        The smallest injection of each effect that is recognised; None if none is.
    false_alarm_rate : DetectionRate
        Proportion of clean surrogates for which a cause is named.
    p_value : float
        Probability under the null hypothesis of a candidate at least as good as the best one of the record.
    confusion : mapping of (str, str) to int
        Counts of ``(injected cause, first named cause)``.
    """

    detection_limits: Mapping[str, Injection | None]
    false_alarm_rate: DetectionRate
    p_value: float
    confusion: Mapping[tuple[str, str], int]
