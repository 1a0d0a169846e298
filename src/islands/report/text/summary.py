"""Texts of a result: the summary for a terminal, its table of models, and the method, a file only."""

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from islands.errors import ModelError
from islands.evolution.latent_variation import EFFECT_STEPS, FURTHER_STEPS, MOST_STATES, MOST_UNITS, STEPS
from islands.evolution.search_result import SearchResult
from islands.evolution.settings import LATENT
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import AnyModel, CoupledModel, list_models
from islands.models.equations import named_signals
from islands.models.latent import STRUCTURE_SUMMARIES, LatentModel
from islands.models.linearisation import find_rest
from islands.models.measured_signals import measured_block
from islands.models.narx import Model
from islands.persistence.saved_documents import find_recommended
from islands.report.text.facts import Document, ResultFacts, make_facts
from islands.report.text.layout import LEGEND, MARK, term_table, wrap
from islands.report.text.mode_tables import GAINS, MODES, align, list_gains, list_modes
from islands.sentences import write, write_one
from islands.validation.assessment import PARTS

#: Columns of every table.
_COLUMNS = ("rank", "terms", "MAPE est. %", "MAPE val. %", "R2 val.", "residuals")

#: Columns of models of hysteresis.
_HYSTERESIS_COLUMNS = ("drift %", "Property 1")


def summary(document: Document, model: AnyModel) -> str:
    """Return the summary as lines of at most 80 characters, unless a name is longer.

    Parameters
    ----------
    document : mapping
        Content of ``result.json``.
    model : DynamicModel or CoupledModel
        The recommended model.
    """
    facts = make_facts(document)
    lines = [
        *(line for sentence in facts.state("essence") for line in wrap(sentence)),
        "",
        *wrap(write_one("result", "choice", f=facts)),
        "",
        *_list_parameters(facts, model),
        *_describe_linear_part(document, model),
        "",
        *wrap(write_one("result", "units", f=facts)),
        *(line for sentence in facts.state("finding") for line in wrap(sentence)),
        "",
        *table(facts),
        *([] if facts.outputs[1:] else [LEGEND]),
    ]
    return "\n".join(lines) + "\n"


def _list_parameters(facts: ResultFacts, model: AnyModel) -> list[str]:
    """Return the terms of each equation, or the modes and gains of coordinates of states."""
    if not facts.quantities:
        tables = [term_table(single) for single in list_models(model)]
        return [line for each in tables for line in ["", *each]][1:]
    modes, gains = list_modes(facts.quantities), list_gains(facts.quantities, *facts.columns)
    return [*align(MODES, modes), "", *align(GAINS, gains)]


def table(facts: ResultFacts) -> list[str]:
    """Return the table of models, or of several outputs, as lines of equal width, with free-run errors."""
    lines = [columns(facts), *rows(facts)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return ["  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)) for line in lines]


def columns(facts: ResultFacts) -> tuple[str, ...]:
    """Return the headings; those of holds only if a model claims hysteresis."""
    rank, size, *errors, residuals = _COLUMNS
    if facts.outputs[1:]:
        return "output", *errors, residuals
    counted = ("form", "parameters") if _has_forms(facts) else (size,)
    return rank, *counted, *errors, *(_HYSTERESIS_COLUMNS if facts.claims_hysteresis else ()), residuals


def _has_forms(facts: ResultFacts) -> bool:
    """Return whether a result has other models than equations."""
    return any("kind" in entry for entry in facts.document["models"])


def rows(facts: ResultFacts) -> list[tuple[str, ...]]:
    """Return the cells of every model, in the order of the ranks, or of each of several outputs."""
    if facts.outputs[1:]:
        return [(each.name, *_list_errors(each.metrics), each.verdict) for each in facts.outputs]
    has_forms = _has_forms(facts)
    return [
        (
            f"{entry['rank']}{MARK if entry['recommended'] else ' '}",
            *([entry.get("form", "")] if has_forms else []),
            str(entry["size"]),
            *_list_errors(entry["metrics"]),
            *(_describe_claims(entry["physics"]) if facts.claims_hysteresis else ()),
            entry["residual_tests"]["verdict"],
        )
        for entry in facts.document["models"]
    ]


def _list_errors(metrics: Document) -> list[str]:
    estimation, validation = (metrics[part]["free_run"] for part in PARTS)
    return [
        number(each[key], form, each["rmse"] is not None)
        for each, key, form in (
            (estimation, "mape", "{:.4f}"),
            (validation, "mape", "{:.4f}"),
            (validation, "r2", "{:.5f}"),
        )
    ]


def _describe_claims(physics: Document) -> tuple[str, str]:
    bounded = all(hold["bounded"] for hold in physics["holds"])
    drift = number(physics["hold_drift_percent"], "{:.3f}", bounded)
    return drift, "yes" if physics["property_1"] else "no"


def number(value: float | None, form: str, bounded: bool) -> str:
    """Format a number. Return "diverged" if its simulation diverged and "-" if there is no number."""
    if not bounded:
        return "diverged"
    return "-" if value is None else form.format(value)


def _describe_linear_part(document: Document, model: AnyModel) -> list[str]:
    """State modes, dead times and gains of a NARX model in the middle of its data, if it rests there.

    The equation of a latent model states those at its operating point. The outputs of a model have the same
    inputs.
    """
    (entry, *_) = document["outputs"] if isinstance(model, CoupledModel) else [find_recommended(document)]
    bands = entry["bands"] or {}
    if isinstance(model, LatentModel | CoupledLatentModel) or bands.get("range") is None:
        return []
    point = [0.5 * (low + high) for low, high in bands["range"]["inputs"]]
    with suppress(ModelError):
        y = None
        if isinstance(model, Model):
            y = find_rest(measured_block(model), point, tuple(bands["range"]["output"]))
        system = model.linearise(point, y)
        return wrap(
            write_one("result", "linear_part", point=system.describe_point(), parts=system.describe())
        )
    return []


def method_text(found: SearchResult) -> str:
    """Return data, settings, number of models, bounds, and the equations of all models."""
    facts = {
        "record": found.record,
        "search": found.search,
        "settings": _list_settings(found),
        "latent": _describe_latent_search(found.settings, found.search.generations or 0),
        "certificates": certificates_document(found),
        "signals": named_signals(found.recommended.final_model),
    }
    lines = [
        *(line for text in write("method", "run", **facts) for line in wrap(text)),
        *(line for text in write("method", "search", **facts) for line in ("", *wrap(text))),
        "",
        *wrap(write_one("method", "names", **facts)),
        *(
            f"{rank:2d}  " + entry.final_model.equation().named.replace("\n", "\n    ")
            for rank, entry in enumerate(found.models, start=1)
        ),
    ]
    return "\n".join(lines) + "\n"


def certificates_document(found: SearchResult) -> list[dict[str, Any]]:
    """Return the certificate of every size, and the gap of the best equation of that size, as JSON values.

    An equation whose error is below the bound has terms of another library.
    """
    documents = []
    for terms, certificate in sorted(found.search.certificates.items()):
        errors = [
            entry.metrics["estimation"]["one_step_ahead"].rmse
            for entry in found.models
            if isinstance(entry.model, Model) and entry.model.size == terms
        ]
        possible = [error for error in errors if certificate.permits(error)]
        if possible:
            error = min(possible)
            documents.append(
                {
                    "terms": terms,
                    "bound": certificate.bound,
                    "gap_percent": 100.0 * certificate.gap(error),
                    "proved": certificate.proves(error),
                    "nodes": certificate.nodes,
                }
            )
    return documents


def _describe_latent_search(settings: Mapping[str, Any], generations: int) -> dict[str, Any] | None:
    """Return the numbers of a search for latent models; None for another one."""
    if settings.get("model_class") != LATENT:
        return None
    constraints = [each.strip() for each in settings.get("constraints", "none").split(";")]
    return {
        **settings,
        "generations": generations,
        "most_states": MOST_STATES,
        "most_units": MOST_UNITS,
        "structure_summary": STRUCTURE_SUMMARIES[settings["structure"]],
        "steps": STEPS,
        "effect_steps": EFFECT_STEPS,
        "further_steps": FURTHER_STEPS,
        "elite": max(1, round(settings["elite"] * settings["population"])),
        "migrates": settings["islands"] > 1,
        "is_odd": "odd" in constraints,
        "statics": [each for each in constraints if each not in {"odd", "none"}],
    }


def _list_settings(found: SearchResult) -> list[str]:
    hidden = ("own_primitives", "choice")
    settings = {name: value for name, value in found.settings.items() if name not in hidden}
    settings["seed"] = found.seed
    return [f"{name} {_format_setting(name, value)}" for name, value in settings.items()]


def _format_setting(name: str, value: object) -> str:
    text = " ".join(map(str, value)) if isinstance(value, tuple | list) else str(value)
    return text or ("by validation" if name == "estimator" else "none")
