"""Signatures of both clients, which are generated from the functions of `calls`."""

import inspect
from typing import Any

import pytest

from islands_api.client import AsyncClient, Client, upload_calls
from islands_api.dataset_schemas import DatasetView


def public_methods(kind: type) -> dict[str, Any]:
    """Return the public methods of a class, inherited ones too."""
    members = {name: getattr(kind, name) for name in dir(kind) if not name.startswith("_")}
    return {name: member for name, member in members.items() if inspect.isfunction(member)}


def test_both_clients_have_the_same_signatures() -> None:
    blocking, awaited = public_methods(Client), public_methods(AsyncClient)
    assert {"upload", "submit", "diagnose", "job", "export", "wait"} <= blocking.keys() == awaited.keys()
    for name, method in blocking.items():
        mine, other = inspect.signature(method), inspect.signature(awaited[name])
        assert mine.parameters == other.parameters, name
        if not inspect.isgeneratorfunction(method):
            assert mine.return_annotation == other.return_annotation, name
        assert method.__name__ == awaited[name].__name__ == name
        assert method.__doc__
    assert inspect.signature(Client) == inspect.signature(AsyncClient)
    assert all(
        inspect.iscoroutinefunction(method) or inspect.isasyncgenfunction(method)
        for method in awaited.values()
    )


@pytest.mark.parametrize("kind", [Client, AsyncClient])
def test_signatures_name_their_parameters(kind: type) -> None:
    variable = {
        (name, parameter.name)
        for name, method in public_methods(kind).items()
        for parameter in inspect.signature(method).parameters.values()
        if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
    }
    assert variable == {("submit", "settings")}
    assert inspect.signature(kind.upload) == inspect.Signature(  # type: ignore[attr-defined]
        [
            inspect.Parameter("self", inspect.Parameter.POSITIONAL_OR_KEYWORD),
            *inspect.signature(upload_calls.upload).parameters.values(),
        ],
        return_annotation=DatasetView,
    )
