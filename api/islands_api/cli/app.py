"""Command line ``islands``: the commands of the core, of the service and of a checkout."""

from types import MappingProxyType

from islands.cli import app as core

#: Commands of a service; see `islands.cli.app.Command`.
SERVICE_COMMANDS = core.make_commands(
    "islands_api.cli.commands",
    {
        "serve": "Accept jobs over REST and run them. After Ctrl-C or SIGTERM they continue at the next "
        "start.",
        "jobs": "Jobs of a service: submit, diagnose, show, change.",
        "monitors": "Monitors of a service: add, show, delete.",
        "admin": "Operation of a service: keys, owners, jobs, audit, backup.",
    },
)

#: All commands, in the order of the help.
COMMANDS = MappingProxyType({**core.COMMANDS, **SERVICE_COMMANDS, **core.MEASUREMENTS})


class AllCommands(core.Commands):
    """Group of all commands."""

    table = COMMANDS


app = core.make_app(AllCommands)


def main() -> None:
    """Run the command line."""
    core.run(app)
