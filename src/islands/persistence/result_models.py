"""What readers need of ``result.json``: outputs, shooting, criterion."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from islands.errors import ModelError
from islands.estimation.estimator_table import Criterion


def check_single_output(document: Mapping[str, Any], folder: Path) -> None:
    """Check that ``result.json`` is the result of one output.

    Raises
    ------
    ModelError
        It is a result of several outputs; the message names their folders.
    """
    if str(document.get("schema", "")).startswith("islands.coupled-result/"):
        raise ModelError(
            f"{folder} has a model of several outputs, which islands.load and read_coupled_model open: give "
            f"the result of one output, as {folder / 'outputs' / '1-NAME'}"
        )


def read_shooting_interval(document: Mapping[str, Any]) -> int:
    """Return the steps of the models of a result in an interval of multiple shooting."""
    return int(document["preprocessing"]["shooting_interval"])


def read_criterion(entry: Mapping[str, Any]) -> Criterion | None:
    """Return the error that the parameters of a model minimise; None if its entry does not state it."""
    found = entry["criterion"]
    return None if found is None else Criterion(found["estimator"], found["interval"])
