"""Entries of the appendix: the record and the settings of a result."""

from typing import Any

from islands.report.text.facts import Document


def list_record(record: Document) -> list[tuple[str, Any]]:
    """Return the samples, sampling time, columns and hash of a record, as ``result.json`` describes it."""
    names = record["names"]
    outputs = names.get("outputs", [names.get("output")])
    return [
        ("samples", record["samples"]),
        ("sampling time", f"{record['dt']:g} s"),
        ("inputs", ", ".join(names["inputs"])),
        ("output" if len(outputs) == 1 else "outputs", ", ".join(outputs)),
        ("SHA-256", record["sha256"]),
    ]


def list_settings(document: Document) -> list[tuple[str, Any]]:
    """Return the settings of a search, without those of the choice of a preset."""
    return [
        (name, ", ".join(map(str, value)) if isinstance(value, list | tuple) else value)
        for name, value in document["settings"].items()
        if not isinstance(value, dict)
    ]
