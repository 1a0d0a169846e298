"""Gross error of a record, with the calibrated simulation of the corrected record."""

from dataclasses import dataclass, replace

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.diagnosis.gross_errors.correction import Correction
from islands.diagnosis.gross_errors.record_finding import RecordFinding


@dataclass(frozen=True, slots=True, eq=False)
class GrossError:
    """A gross error of a record that explains nearly all of its misfit.

    Attributes
    ----------
    correction : Correction
    fit : CalibrationResult
        Calibrated simulation of the corrected record.
    error, error_before : float
        RMS errors of that simulation and of the calibrated simulation as given, each relative to the standard
        deviation of its output over the estimation part.
    cost : float
        Minus twice the log-likelihood relative to that of the record as given, plus the penalty of the
        tolerances.
    """

    correction: Correction
    fit: CalibrationResult
    error: float
    error_before: float
    cost: float

    @property
    def name(self) -> str:
        """Name of the error."""
        return self.correction.name

    @property
    def score(self) -> float:
        """Decrease of minus twice the log-likelihood; 0 if the record as given fits as well."""
        return -self.cost

    @property
    def explained_fraction(self) -> float:
        """Fraction of the misfit that the correction removes; 1 if a calibration hides the error."""
        return 1.0 - (self.error / self.error_before) ** 2 if self.error < self.error_before else 1.0

    @property
    def rmse(self) -> float:
        """RMS error of the corrected simulation over the estimation part, in the unit of the record."""
        return float(np.sqrt(self.fit.mean_square)) / abs(self.correction.scale)

    @property
    def fit_of_record(self) -> CalibrationResult | None:
        """The corrected simulation as one of the recorded output; None if that is another signal."""
        if self.correction.has_other_output:
            return None
        return replace(self.fit, output=self.correction.restore(self.fit.output))

    @property
    def finding(self) -> RecordFinding:
        """The finding for reports."""
        correction, description = self.correction, self.correction.description
        if self.error < self.error_before:
            description += (
                f" The error of the calibrated simulation is {100 * self.error_before:.3g} % of the standard "
                f"deviation of the output, and {100 * self.error:.3g} % after the correction."
            )
        return RecordFinding(
            correction.name,
            description,
            correction.advice,
            correction.parameters,
            (self.error_before, self.error),
        )
