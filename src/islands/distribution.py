"""The distribution that contains the packages: its name, its version, and how its extras are installed."""

import re

#: Name of the distribution. It differs from that of the import package, which is free in the public index of
#: packages, so that another project may take it. Until it is published, users install a wheel or a checkout.
NAME = "islands-sysid"

#: A requirement of the distribution: the name of a package, and the extra that needs it.
_REQUIREMENT = re.compile(r"([\w.-]+)(?:[^\w.;-][^;]*)?(?:;\s*extra\s*==\s*['\"]([\w-]+)['\"]\s*)?")


def read_version() -> str:
    """Return the version of the installed distribution."""
    # The import takes a tenth of the start-up time of a command.
    from importlib.metadata import version  # noqa: PLC0415

    return version(NAME)


def list_missing_packages(extra: str) -> tuple[str, ...]:
    """Return the packages that the distribution needs with an extra, and that are not installed.

    Parameters
    ----------
    extra : str
        Extra of ``pyproject.toml``.
    """
    from importlib.metadata import requires  # noqa: PLC0415

    found = (_REQUIREMENT.fullmatch(each) for each in requires(NAME) or ())
    needed = [each[1] for each in found if each is not None and each[2] in (None, extra)]
    return tuple(name for name in dict.fromkeys(needed) if not _is_installed(name))


def _is_installed(package: str) -> bool:
    from importlib.metadata import PackageNotFoundError, distribution  # noqa: PLC0415

    try:
        distribution(package)
    except PackageNotFoundError:
        return False
    return True


def describe_missing_extra(user: str, *extras: str) -> str:
    """Return a sentence on extras that are not installed: what needs them, and how they are installed.

    It names the file of the wheel. With the name of the distribution, pip would install what another project
    has published under this name.

    Parameters
    ----------
    user : str
        What needs the extras.
    *extras : str
        Extras of ``pyproject.toml``.
    """
    wheel = f"{NAME.replace('-', '_')}-{read_version()}-py3-none-any.whl"
    named = f"extra{'s' if len(extras) > 1 else ''} {' and '.join(map(repr, extras))}"
    return (
        f"{user} needs the {named}: pip install 'FOLDER/{wheel}[{','.join(extras)}]', "
        f"or in a checkout: python3 deploy/packages/install.py .venv --extra {' --extra '.join(extras)}"
    )
