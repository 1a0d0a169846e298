"""Generated reference of the REST API: endpoints and schemas of the OpenAPI document, and problem types."""

import inspect
from http import HTTPStatus
from typing import Any

from tables import code, escape, page, section, summarise, table

from islands_api.web.app import create_app
from islands_api.web.problems import PROBLEMS
from islands_service.settings import ServiceSettings


def rest() -> str:
    """Return the page of the endpoints."""
    document = create_app(ServiceSettings()).openapi()
    by_tag: dict[str, list[str]] = {}
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            title = f"{method.upper()} {path}"
            by_tag.setdefault(operation["tags"][0], []).append(_operation(title, operation))
    schemas = document["components"]["schemas"]
    return page(
        "REST API",
        "Endpoints of the service, from the OpenAPI document that a service offers at `/openapi.json`.",
        "Every response that is not a success is a [problem](problems.md).\n",
        *(section(tag.capitalize(), *operations) for tag, operations in by_tag.items()),
        section("Schemas", *(_schema(name, schema) for name, schema in schemas.items())),
    )


def _operation(title: str, operation: dict[str, Any]) -> str:
    parts = [operation.get("description", "")]
    rows = [
        (code(each["name"]), each["in"], _type(each["schema"]), escape(each.get("description", "")))
        for each in operation.get("parameters", ())
    ]
    if rows:
        parts.append(table(("Parameter", "In", "Type", "Meaning"), rows))
    for media, content in operation.get("requestBody", {}).get("content", {}).items():
        parts.append(f"Body: {code(media)}, {_type(content['schema'])}")
    rows = [
        (code(status), escape(_response(status, each)), _content(each))
        for status, each in sorted(operation["responses"].items())
    ]
    parts.append(table(("Status", "Meaning", "Content"), rows))
    return section(f"`{title}`", *parts, level=3)


def _response(status: str, response: dict[str, Any]) -> str:
    text = str(response["description"])
    return HTTPStatus(int(status)).phrase if text == "Successful Response" else text


def _content(response: dict[str, Any]) -> str:
    found = response.get("content", {})
    return "<br>".join(
        f"{code(media)} {_type(content.get('schema', {}))}" for media, content in found.items()
    )


def _schema(name: str, schema: dict[str, Any]) -> str:
    required = schema.get("required", ())
    rows = [
        (code(field), _type(each), "yes" if field in required else "", escape(each.get("description", "")))
        for field, each in schema.get("properties", {}).items()
    ]
    parts = [inspect.cleandoc(schema.get("description", ""))]
    if values := schema.get("enum"):
        parts.append(", ".join(map(code, values)))
    if rows:
        parts.append(table(("Field", "Type", "Required", "Meaning"), rows))
    return section(name, *parts, level=3)


def _type(schema: dict[str, Any]) -> str:
    """Return the type of a schema, with a link for each schema that has a name."""
    match schema:
        case {"$ref": reference}:
            name = reference.rpartition("/")[2]
            return f"[{name}](#{name.lower()})"
        case {"anyOf": kinds} | {"oneOf": kinds} | {"allOf": kinds}:
            return " or ".join(dict.fromkeys(map(_type, kinds)))
        case {"const": value}:
            return code(value)
        case {"enum": values}:
            return " or ".join(map(code, values))
        case {"type": "array", "items": items}:
            return f"array of {_type(items)}"
        case {"type": kind}:
            return str(kind)
    return "any"


def problems() -> str:
    """Return the page of the problem types."""
    rows = (
        (code(each.type), str(each.status.value), each.title, escape(summarise(error)))
        for error, each in sorted(PROBLEMS.items(), key=lambda item: item[1].status)
    )
    return page(
        "Problem types",
        "Values of `type` in problem documents (RFC 9457), as `/problems/TYPE`. They never change.",
        table(("Type", "Status", "Title", "Meaning"), rows),
    )
