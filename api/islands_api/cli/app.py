"""Command line ``islands``: the commands of the core and those of the service."""

from collections.abc import Mapping
from types import MappingProxyType

from islands.cli import app as core

#: Commands of a service and their descriptions; see `islands.cli.app.COMMANDS`.
SERVICE_COMMANDS: Mapping[str, str] = MappingProxyType(
    {
        "serve": "Accept jobs over REST and run them. After Ctrl-C or SIGTERM they continue at the next "
        "start.",
        "jobs": "Jobs of a service: submit, diagnose, list, show, watch, cancel, resume, result.",
        "monitors": "Monitors of a service: create, add records, list, show, delete.",
        "keys": "API keys of a service: create, list, revoke.",
        "admin": "Operation of a service: audit, owners, jobs, backup, restore.",
    }
)


#: All commands and their descriptions, in the order of the help.
COMMANDS: Mapping[str, str] = MappingProxyType({**core.COMMANDS, **SERVICE_COMMANDS})


class AllCommands(core.Commands):
    """Group of the commands of the core and of the service."""

    packages = MappingProxyType({**core.Commands.packages, "islands_api.cli.commands": SERVICE_COMMANDS})


app = core.make_app(AllCommands)


def main() -> None:
    """Run the command line."""
    core.run(app)
