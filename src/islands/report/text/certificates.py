"""Certificates of a result as JSON values and as text."""

from typing import Any

from islands.evolution.search_result import SearchResult


def certificates_document(found: SearchResult) -> list[dict[str, Any]]:
    """Return the certificate of every model's size, by size, and the gap of the model, as JSON values."""
    documents = []
    for entry in sorted(found.models, key=lambda each: each.model.size):
        certificate = found.search.certificates.get(entry.model.size)
        if certificate is not None:
            error = entry.metrics["estimation"]["one_step_ahead"].rmse
            documents.append(
                {
                    "terms": certificate.terms,
                    "bound": certificate.bound,
                    "gap_percent": 100.0 * certificate.gap(error),
                    "proved": certificate.proves(error),
                    "nodes": certificate.nodes,
                }
            )
    return documents


def summarise_certificates(found: SearchResult) -> list[str]:
    """Return the gap of every model as a line of text; no line without certificates."""
    gaps = [
        f"{entry['terms']} term{'s' if entry['terms'] > 1 else ''}: "
        + ("none" if entry["proved"] else f"{entry['gap_percent']:.1f} %")
        for entry in certificates_document(found)
    ]
    return (
        ["", f"possible reduction of the one-step error within the library: {', '.join(gaps)}"]
        if gaps
        else []
    )
