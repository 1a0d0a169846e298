"""Settings of a fit."""

from islands.errors import SettingsError, name_option
from islands.estimation.structure_selection.input_delays import Delays
from islands.evolution.settings import LATENT, NARX, Settings
from islands.models.candidate_library import LIBRARIES
from islands.models.latent import ZERO_BLOCKS
from islands.persistence.models import MODEL_CLASSES
from islands.records.averaging import AUTO, check_average
from islands.records.input_lead import check_feedthrough
from islands.settings_schema import Integer, list_changes, setting, setting_of, settings_class

#: Settings of models of every class.
_COMMON = frozenset({"model", "refit", "prefer"})


@settings_class
class FitSettings:
    """Settings of a fit."""

    model: str = setting(
        NARX,
        "Class of the models. Others than narx have named parameters and are fitted by the error of their "
        "free run; they have no other setting but `refit`, latent models also `structure` and `constraints`.",
        choices=MODEL_CLASSES,
        daily=True,
    )
    structure: str = setting(
        AUTO, "Structure of latent models, which has zeros; auto for any.", choices=ZERO_BLOCKS
    )
    library: str = setting(
        AUTO,
        "Candidate library, such as phi-polynomial for hysteresis or polynomial for smooth systems. auto "
        "fits several libraries and takes the best one, as the preset auto does; for several outputs it is "
        "polynomial.",
        choices=LIBRARIES,
        daily=True,
    )
    degree: Integer | None = setting(None, "Degree of the library; by default its own.", daily=True)
    lags: Integer | None = setting(None, "Lags of the library; by default its own.", daily=True)
    delays: Delays | None = setting(
        None,
        "Dead times in samples of the record: one, or one for each input. By default they are estimated with "
        "the library auto, and none with others.",
    )
    constraints: str | None = setting_of(Settings, "constraints", None, "that of the library")
    max_terms: Integer = setting(
        10, "Terms of the largest model, apart from a constant that an offset requires.", ge=1, daily=True
    )
    estimator: str = setting_of(Settings, "estimator", "")
    refit: str = setting_of(Settings, "refit", "none")
    prefer: str = setting_of(Settings, "prefer", daily=True)
    average: Integer | str = setting_of(Settings, "average", AUTO)
    feedthrough: str = setting_of(Settings, "feedthrough", AUTO)
    shooting: Integer | None = setting_of(Settings, "shooting", None)
    certificate: Integer = setting(
        10_000,
        "Nodes of the search for the best model of each size, and for the bound on the one-step-ahead error "
        "of all others; 0 for forward selection only.",
        ge=0,
    )

    def __post_init__(self) -> None:
        check_average(self.average)
        check_feedthrough(self.feedthrough)
        if self.structure != AUTO and self.model != LATENT:
            raise SettingsError(
                f"a structure is a setting of latent models: leave it out, or {name_option('model', LATENT)}"
            )
        applicable = _COMMON | ({"structure", "constraints"} if self.model == LATENT else set())
        if self.model != NARX and list_changes(self).keys() - applicable:
            raise SettingsError(
                f"library, max_terms and so on are settings of NARX models, not for the model {self.model}: "
                "leave them out"
            )

    @property
    def selecting_estimator(self) -> str:
        """Estimator of all structures; without a choice, the validation data decide on a refinement."""
        return self.estimator or "least-squares"
