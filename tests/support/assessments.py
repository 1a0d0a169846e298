"""Assessments of models with other checks than those of the model."""

from dataclasses import replace
from types import SimpleNamespace


class StatedChecks(SimpleNamespace):
    """Stated results of checks, which are compared by their identity."""

    __hash__ = object.__hash__


def with_changes(entry, physics=None, residual_tests=None, residual_structure=None, **changes):
    """Return an assessment with other values of its fields, and with other results of its checks."""
    residual = residual_tests or entry.residual_tests, residual_structure or entry.residual_structure
    checks = StatedChecks(
        split=entry.checks.split,
        physics=physics or entry.physics,
        residual=residual,
        has_estimated_start=entry.has_estimated_start,
        laws=entry.checks.laws,
    )
    return replace(entry, checks=checks, **changes)
