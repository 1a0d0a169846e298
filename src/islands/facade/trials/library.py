"""Candidate library of trial models, which decide on a setting of the search."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from islands.errors import check_integers
from islands.estimation.parameter_constraints import constraint
from islands.estimation.structure_selection.input_ranking import screen_candidates
from islands.evolution.settings import Settings
from islands.models.candidate_library import get_library
from islands.models.regressor import Regressor
from islands.records.averaging import count_means
from islands.records.dataset import Dataset


@dataclass(frozen=True, slots=True)
class TrialLibrary:
    """Candidate library and constraints of models that compare sampling rates, inputs or kinds of records.

    ``shooting`` is the interval over which the search refines parameters, in samples of the data; None if it
    does not refine them. ``delays`` are dead times in samples of the data.
    """

    name: str
    degree: int
    lags: int
    constraints: str
    shooting: int | None = None
    delays: tuple[int, ...] = ()

    def at_rate(self, count: int) -> "TrialLibrary":
        """Return the library for means of ``count`` samples, with the same intervals of time."""
        shooting = None if self.shooting is None else count_means(self.shooting, count)
        return replace(self, shooting=shooting, delays=tuple(delay // count for delay in self.delays))

    def with_delays(self, delays: Sequence[int]) -> "TrialLibrary":
        """Return the library with other dead times."""
        return replace(self, delays=tuple(delays))

    def screen(self, record: Dataset) -> tuple[Regressor, ...]:
        """Return the regressors of the library for a record."""
        return screen_candidates(self.name, self.degree, self.lags, record, self.constraints, self.delays)

    def make_settings(self, max_terms: int, shooting: int) -> Settings:
        """Return the settings of a swap search over the library.

        Parameters
        ----------
        max_terms : int
            Terms of the largest model.
        shooting : int
            Samples of a shooting interval.
        """
        return Settings(
            library=self.name,
            library_degree=self.degree,
            library_lags=self.lags,
            library_delays=self.delays,
            shifts=(),
            max_terms=max_terms,
            initial_terms=(1, max_terms),
            constraints=self.constraints,
            shooting=shooting,
        )


def make_trial_library(settings: Settings) -> TrialLibrary:
    """Return the library of an evolution; without one, the default library of its constraints."""
    if settings.library:
        name, degree, lags = settings.library, settings.library_degree, settings.library_lags
    else:
        name = "phi-polynomial" if constraint(settings.constraints).sums else "polynomial"
        degree, lags = get_library(name).degree, get_library(name).lags
    shooting = settings.shooting if settings.refine else None
    return TrialLibrary(name, degree, lags, settings.constraints, shooting, settings.library_delays)


def take_library(
    name: str, degree: int | None, lags: int | None, constraints: str | None, delays: Sequence[int] = ()
) -> TrialLibrary:
    """Return a library, with its own degree, lags and constraints where these are None.

    Raises
    ------
    SettingsError
        The library is unknown.
    """
    entry = get_library(name)
    check_integers(degree=degree, lags=lags)
    return TrialLibrary(
        name,
        entry.degree if degree is None else degree,
        entry.lags if lags is None else lags,
        entry.constraints if constraints is None else constraints,
        delays=tuple(delays),
    )
