"""Models of the result of a job with their errors and bands, as `islands.load` opens them from a folder."""

from collections.abc import Mapping
from typing import Any

from islands.errors import ModelError
from islands.facade.results.fitted_model import FittedModel
from islands.facade.results.reader import read_entry
from islands.persistence.ensembles import ensemble_from_document
from islands.persistence.models import any_model_from_json


def read_fitted(job: str, file: str, entry: Mapping[str, Any], document: Mapping[str, Any]) -> FittedModel:
    """Return a model of a job.

    Parameters
    ----------
    job : str
        Id of the job, for messages.
    file : str
        Model file as text.
    entry : mapping
        Entry of the model in the result.
    document : mapping
        Result document of the job; its models are not read.

    Raises
    ------
    ModelError
        The model or the document is damaged.
    """
    model = any_model_from_json(file, f"a model of job {job}")
    try:
        ensemble = ensemble_from_document(document["ensemble"], model)
        return read_entry(model, entry, document, ensemble)
    except (KeyError, TypeError, ValueError) as error:
        raise ModelError(f"the result of job {job} is damaged: {error!r} is missing or wrong") from error
