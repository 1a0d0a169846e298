"""The database's clock: the only one that all coordinators of a cluster agree about."""

from typing import Any

from sqlalchemy import Float
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.functions import FunctionElement


class now(FunctionElement[float]):  # noqa: N801 - a function of SQL
    """Seconds since 1970, as the database reads them while it carries out the statement."""

    type = Float()
    inherit_cache = True


@compiles(now, "sqlite")
def _sqlite(_element: now, _compiler: Any, **_: Any) -> str:
    return "((julianday('now') - 2440587.5) * 86400.0)"


@compiles(now, "postgresql")
def _postgresql(_element: now, _compiler: Any, **_: Any) -> str:
    # Not SQL's own now(), which stands still in a transaction: a group of commits may take a while.
    return "EXTRACT(EPOCH FROM clock_timestamp())::float8"
