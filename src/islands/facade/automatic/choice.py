"""Choice of the preset ``auto``, with the front of models from which it was made."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from islands.errors import IslandsError, SettingsError
from islands.estimation.estimator_table import Criterion
from islands.models.protocol import DynamicModel
from islands.persistence.models import model_from_json, model_json
from islands.records.split import Split
from islands.validation.assessment import Assessment, assess


@dataclass(frozen=True, slots=True)
class Choice:
    """Kind of record and dead times that the preset ``auto`` chose, with the models that it has compared.

    Attributes
    ----------
    kind : str
        An entry of ``KINDS``.
    delays : tuple of int
        Dead time of each input in samples of the record; empty if there is none.
    reasons : tuple of str
        What was chosen and why, in two sentences.
    errors : mapping
        Free-run RMSE on the validation data of the recommended model of each kind that was compared there,
        as a fraction of the output range of the estimation data, at least `RESOLUTION`. A kind is missing if
        it has no model with a finite error.
    trials : mapping
        The same of small models on held-out parts of the estimation data.
    data : mapping
        Sampling rate and inputs that are read early; see `PreparedData`.
    models : tuple of FrontModel
        Models that compete with those of a search for the kind.
    """

    kind: str
    delays: tuple[int, ...]
    reasons: tuple[str, ...]
    errors: Mapping[str, float]
    trials: Mapping[str, float]
    data: Mapping[str, Any]
    models: "tuple[FrontModel, ...]" = ()

    def to_document(self) -> dict[str, Any]:
        """Return the choice as JSON values, without the models."""
        return {
            "kind": self.kind,
            "delays": list(self.delays),
            "reasons": list(self.reasons),
            "errors": dict(self.errors),
            "trials": dict(self.trials),
            "data": dict(self.data),
        }

    def to_checkpoint(self) -> dict[str, Any]:
        """Return the choice with the models as JSON values."""
        return {**self.to_document(), "models": [each.to_document() for each in self.models]}

    def assess_models(self, split: Split, shooting: int, constraints: str) -> list[Assessment]:
        """Assess the models; see `assess`."""
        return [
            assess(each.model, split, shooting, each.warm_up, constraints, each.criterion)
            for each in self.models
        ]


@dataclass(frozen=True, slots=True)
class FrontModel:
    """A model of a front, with the error that its parameters minimise.

    Attributes
    ----------
    model : DynamicModel
    criterion : Criterion
    warm_up : int
        Number of samples before the first prediction.
    """

    model: DynamicModel
    criterion: Criterion
    warm_up: int

    def to_document(self) -> dict[str, Any]:
        """Return the model as JSON values."""
        return {
            "model": json.loads(model_json(self.model)),
            "estimator": self.criterion.estimator,
            "interval": self.criterion.interval,
            "warm_up": self.warm_up,
        }


def keep_models(models: Sequence[Assessment]) -> tuple[FrontModel, ...]:
    """Return assessed models as those of a choice."""
    return tuple(
        FrontModel(each.model, each.criterion, each.warm_up) for each in models if each.criterion is not None
    )


def choice_from_document(document: Mapping[str, Any]) -> Choice:
    """Return a choice from its JSON values.

    Raises
    ------
    SettingsError
        A value is missing or of another type.
    """
    try:
        return Choice(
            str(document["kind"]),
            tuple(map(int, document["delays"])),
            tuple(map(str, document["reasons"])),
            _read_errors(document["errors"]),
            _read_errors(document["trials"]),
            MappingProxyType(dict(document["data"])),
            tuple(map(_read_model, document.get("models", ()))),
        )
    except (KeyError, TypeError, ValueError, AttributeError, IslandsError) as error:
        raise SettingsError(
            f"the stored choice of a preset is damaged ({error!r}): start a new run"
        ) from error


def _read_errors(document: Mapping[str, Any]) -> Mapping[str, float]:
    return MappingProxyType({str(kind): float(error) for kind, error in document.items()})


def _read_model(document: Mapping[str, Any]) -> FrontModel:
    interval = document["interval"]
    criterion = Criterion(str(document["estimator"]), None if interval is None else int(interval))
    return FrontModel(model_from_json(json.dumps(document["model"])), criterion, int(document["warm_up"]))
