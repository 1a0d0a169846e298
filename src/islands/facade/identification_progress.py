"""Progress of an identification: its phases with their measured times, and the time left of its search."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from islands.evolution.presets import AUTO, resolve_settings
from islands.evolution.settings import LATENT
from islands.progress import MIN_FRACTION, Phase, PhasedProgress, ProgressCallback

if TYPE_CHECKING:
    from islands.evolution.search_state import SearchState
    from islands.evolution.settings import Settings

#: Phase of the epochs, which report no messages.
SEARCH = "search"

#: Seconds of an individual of the search.
_INDIVIDUAL = 2e-4

#: Seconds of one core that a state space takes, for each sample of the estimation, of which there are at most
#: `_ESTIMATED_SAMPLES`, and for each sample of the record. Measured with 770 to 75 000 samples: 15 to 250 ms.
_STATE_SPACE, _ESTIMATED, _HELD_OUT = 5e-3, 1.5e-5, 1.5e-6
_ESTIMATED_SAMPLES = 6_000

#: Trials and fits of the preset auto, in seconds. They take about the same time for 500 and 20 000 samples.
_CHOICE = (Phase("preset auto: trial of", 2.6, 4), Phase("preset auto: fit of", 2.6, 3))

#: Trials and fits of the library auto, and the fit with one library, in seconds.
_TRIALS = (Phase("preset auto: trial of", 1.3, 4), Phase("preset auto: fit of", 2.1, 3))
_LIBRARY = (
    Phase("inner products of", 0.05),
    Phase("best subsets of", 0.6),
    Phase("estimation of", 0.05),
)

#: Seconds of the final models and of their bands for each sample, beyond a constant.
_FINAL, _BANDS = 3.6e-4, 3e-5

#: Phases of the fit of a class of models that has starting models, as shares.
_CLASS = (Phase("estimation from starting model", 0.9, 3), Phase("assessment of the model", 0.1))


def fit_phases(library: str, outputs: Sequence[str]) -> tuple[Phase, ...]:
    """Return the phases of a fit with a library, with times in seconds; see `identification_phases`."""
    phases = (
        *(_TRIALS if library == AUTO and len(outputs) < 2 else _LIBRARY),
        Phase("prediction bands", 0.1),
    )
    return _repeat(phases, outputs)


def class_phases(model: str, samples: int, outputs: Sequence[str] = ()) -> tuple[Phase, ...]:
    """Return the phases of the fit of a class of models to one output, or to each of several ones.

    Latent models are evolved.
    """
    if model == LATENT:
        return identification_phases(LATENT, samples, resolve_settings(LATENT, {}), outputs)
    return _repeat_searches(_CLASS, outputs)


def identification_phases(
    preset: object, samples: int, settings: "Settings", outputs: Sequence[str] = ()
) -> tuple[Phase, ...]:
    """Return the phases of an identification, with times in seconds of one core.

    The times are those of searches with the preset ``auto`` and 500, 2000 and 20 000 samples, and of one with
    ``narx`` and 3000 samples. ``lab/searches/phase_shares.py`` measures them.

    Parameters
    ----------
    preset : str or Choice
        As in `islands.identify`.
    samples : int
        Samples of the record.
    settings : Settings
        Settings of the search, of one kind of record for the preset ``auto``.
    outputs : sequence of str
        Names of the outputs; several are searched one after the other.
    """
    evaluations = settings.population * settings.islands * (settings.generations + 1)
    if settings.model_class == LATENT:
        searched = (
            Phase("linear model of order", 1.0 + 5e-5 * samples, 15),
            Phase(SEARCH, estimate_state_space_seconds(samples) * evaluations),
            Phase("final estimation of state spaces", 0.1 + _BANDS * samples),
            Phase("assessment of the models", 0.3),
            Phase("prediction bands", 0.1 + 1e-5 * samples),
        )
        return _repeat_searches(searched, outputs)
    phases = (
        *(_CHOICE if preset == AUTO and len(outputs) < 2 else ()),
        Phase("forward selection among", 0.1),
        Phase("swap search among", 0.6, 15),
        Phase(SEARCH, _INDIVIDUAL * evaluations),
        Phase("estimation of the final models", 1.4 + _FINAL * samples),
        Phase("assessment of the final models", 0.1),
        Phase("prediction bands", 0.2 + _BANDS * samples),
    )
    return _repeat(phases, outputs)


def estimate_state_space_seconds(samples: int) -> float:
    """Estimate the seconds of one core that the estimation of a state space takes."""
    return _STATE_SPACE + min(samples, _ESTIMATED_SAMPLES) * _ESTIMATED + samples * _HELD_OUT


def _repeat_searches(phases: Sequence[Phase], outputs: Sequence[str]) -> tuple[Phase, ...]:
    """Return the phases of each of several outputs, or those of one."""
    if len(outputs) < 2:
        return tuple(phases)
    return tuple(replace(each, beginning=f"{name}: {each.beginning}") for name in outputs for each in phases)


def _repeat(phases: Sequence[Phase], outputs: Sequence[str]) -> tuple[Phase, ...]:
    """Return the phases of each of several outputs and those of the common model, or those of one output."""
    if len(outputs) < 2:
        return tuple(phases)
    return (
        *_repeat_searches(phases, outputs),
        Phase("choice of the equations", 0.1),
        Phase("refinement of all equations", 0.1),
        *(each for each in phases if each.beginning == "prediction bands"),
    )


class IdentificationProgress(PhasedProgress):
    """Progress callback of an identification that adds completed fractions of the whole.

    Parameters
    ----------
    progress : ProgressCallback
        Receives messages with fractions of the whole.
    preset, samples, settings, outputs
        See `identification_phases`.
    """

    def __init__(
        self,
        progress: ProgressCallback,
        preset: object,
        samples: int,
        settings: "Settings",
        outputs: Sequence[str] = (),
    ) -> None:
        super().__init__(progress, identification_phases(preset, samples, settings, outputs))
        self._outputs, self._prefix = outputs, ""

    def __call__(self, message: str, fraction: float | None = None, /) -> None:
        """Report a message, with the completed part of its phase if it is known."""
        for name in self._outputs:
            if message.startswith(f"{name}: "):
                self._prefix = f"{name}: "
        super().__call__(message, fraction)

    def report_epoch(self, state: "SearchState", settings: "Settings", rate: float) -> float | None:
        """Report the present search, and return the seconds left by its speed, None in its first epochs.

        Parameters
        ----------
        rate : float
            Individuals per second; 0 if it is unknown.
        """
        done = (state.history[-1].generation + 1) / (settings.generations + 1)
        self(f"{self._prefix}{SEARCH}", done)
        whole = settings.population * settings.islands * (settings.generations + 1)
        is_known = rate > 0.0 and done >= MIN_FRACTION
        return whole / rate * (1.0 - done + self.rest) if is_known else None
