"""The distribution that contains the packages: its name, its version, and how its extras are installed."""

#: Name of the distribution. It differs from that of the import package, which is free in the public index of
#: packages, so that another project may take it. Nothing is published: users install a wheel or a checkout.
NAME = "islands-sysid"


def read_version() -> str:
    """Return the version of the installed distribution."""
    # The import takes a tenth of the start-up time of a command.
    from importlib.metadata import version  # noqa: PLC0415

    return version(NAME)


def describe_missing_extra(user: str, extra: str) -> str:
    """Return a sentence on an extra that is not installed: what needs it, and how it is installed.

    It names the file of the wheel. With the name of the distribution, pip would install what another project
    has published under this name.

    Parameters
    ----------
    user : str
        What needs the extra.
    extra : str
        Extra of ``pyproject.toml``.
    """
    wheel = f"{NAME.replace('-', '_')}-{read_version()}-py3-none-any.whl"
    return (
        f"{user} needs the extra {extra!r}: pip install 'FOLDER/{wheel}[{extra}]', "
        f"or in a checkout: python3 deploy/packages/install.py .venv --extra {extra}"
    )
