"""Texts of a result: the summary for a terminal, and the method, which is written to a file only."""

from contextlib import suppress

from islands.errors import ModelError
from islands.evolution.search_result import SearchResult
from islands.models.equations import named_signals
from islands.models.linearisation import find_rest
from islands.models.measured_signals import measured_block
from islands.models.narx import Model
from islands.models.protocol import DynamicModel
from islands.persistence.saved_documents import find_recommended
from islands.report.text.certificates import summarise_certificates
from islands.report.text.facts import Document
from islands.report.text.latent_method import describe_latent_search, is_latent
from islands.report.text.layout import LEGEND, term_table, wrap
from islands.report.text.model_table import table
from islands.report.text.statements import (
    describe_choice,
    describe_essence,
    describe_findings,
    describe_units,
)


def summary(document: Document, model: DynamicModel) -> str:
    """Return the summary as lines of at most 80 characters, unless a name is longer.

    Parameters
    ----------
    document : mapping
        Content of ``result.json``.
    model : DynamicModel
        The recommended model.
    """
    lines = [
        *(line for sentence in describe_essence(document) for line in wrap(sentence)),
        "",
        *wrap(describe_choice(document)),
        "",
        *term_table(model),
        *_describe_linear_part(document, model),
        "",
        *wrap(describe_units(document)),
        *(line for sentence in describe_findings(document) for line in wrap(sentence)),
        "",
        *table(document),
        LEGEND,
    ]
    return "\n".join(lines) + "\n"


def _describe_linear_part(document: Document, model: DynamicModel) -> list[str]:
    """State modes, dead times and gains of a NARX model in the middle of its data, if it rests there.

    The equation of a latent model states those at its operating point.
    """
    bands = find_recommended(document)["bands"] or {}
    if not isinstance(model, Model) or bands.get("range") is None:
        return []
    point = [0.5 * (low + high) for low, high in bands["range"]["inputs"]]
    with suppress(ModelError):
        y = find_rest(measured_block(model), point, tuple(bands["range"]["output"]))
        system = model.linearise(point, y)
        return wrap(f"Linear part about {system.describe_point()}: {'; '.join(system.describe())}.")
    return []


def method_text(found: SearchResult) -> str:
    """Return data, settings, number of models, bounds, and the equations of all models."""
    record, search = found.record, found.search
    outcomes = ", ".join(f"{count} {name}" for name, count in search.outcomes.items())
    lines = [
        f"{record.samples} samples, {record.dt:g} s: {', '.join(record.input_names)} to {record.output_name}",
        *wrap(_describe_settings(found)),
        f"{search.evaluations} models estimated: {outcomes}",
        *_describe_search(found),
        *(line for text in summarise_certificates(found) for line in wrap(text)),
        "",
        *wrap(_describe_names(found)),
        *(
            f"{rank:2d}  " + entry.final_model.equation().named.replace("\n", "\n    ")
            for rank, entry in enumerate(found.models, start=1)
        ),
    ]
    return "\n".join(lines) + "\n"


def _describe_search(found: SearchResult) -> list[str]:
    """Return the size of the full polynomial set, or how latent models were searched."""
    search, full = found.search, found.search.full_set
    if not is_latent(found.settings):
        return [
            f"full polynomial set: {full['candidates']} candidates, a matrix of {full['bytes'] / 1e6:.0f} MB"
        ]
    paragraphs = describe_latent_search(found.settings, search.generations or 0)
    return [line for text in paragraphs for line in ("", *wrap(text))]


def _describe_names(found: SearchResult) -> str:
    """Return the heading of the equations, with the signals that they read."""
    statement = named_signals(found.recommended.final_model)
    where = f", where {statement}" if statement else ""
    return f"Equations by rank, with the columns of the record{where}:"


def _describe_settings(found: SearchResult) -> str:
    hidden = ("own_primitives", "choice")
    settings = {name: value for name, value in found.settings.items() if name not in hidden}
    settings["seed"] = found.seed
    return ", ".join(f"{name} {_format_setting(name, value)}" for name, value in settings.items())


def _format_setting(name: str, value: object) -> str:
    text = " ".join(map(str, value)) if isinstance(value, tuple | list) else str(value)
    return text or ("by validation" if name == "estimator" else "none")
