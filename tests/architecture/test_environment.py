"""Only one module reads environment variables, so that there are no undocumented settings.

Writing environment variables is allowed: it configures libraries and child processes.
"""

import ast

from support.repository import ROOT

READER = "services/islands_service/settings.py"

#: Names in `os` that read the environment.
NAMES = {"environ", "environb", "getenv", "getenvb"}

SOURCES = sorted(
    path.relative_to(ROOT).as_posix()
    for folder in ("services", "api", "src/islands/cli")
    for path in (ROOT / folder).rglob("*.py")
)


def reads(text):
    """Return the lines in which a module reads the environment, for any alias of `os`."""
    if not any(name in text for name in NAMES):
        return []
    tree = ast.parse(text)
    written = {id(node) for statement in ast.walk(tree) for node in _write_targets(statement)}
    return sorted(node.lineno for node in ast.walk(tree) if _is_environment(node) and id(node) not in written)


def _is_environment(node):
    match node:
        case ast.Attribute(attr=name) | ast.Constant(value=name):
            return isinstance(name, str) and name in NAMES
        case ast.ImportFrom(names=names):
            return bool({alias.name for alias in names} & NAMES)
    return False


def _write_targets(statement):
    """Return the nodes through which a statement writes the environment without reading it."""
    match statement:
        case ast.Expr(value=ast.Call(func=ast.Attribute(value=environment, attr="setdefault" | "update"))):
            return [environment]
        case ast.Assign(targets=targets):
            return [target.value for target in targets if isinstance(target, ast.Subscript)]
    return []


def test_only_the_settings_module_reads_the_environment():
    assert [path for path in SOURCES if reads((ROOT / path).read_text())] == [READER]
