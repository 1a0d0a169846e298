"""Command line ``islands``: the commands of the core, of the service and of a checkout."""

from types import MappingProxyType

from islands.cli import app as core

#: Commands of a service; see `islands.cli.app.Command`.
SERVICE_COMMANDS = core.make_commands(
    "islands_api.cli.commands",
    {
        "serve": "Accept jobs over REST and run them. After Ctrl-C or SIGTERM they continue at the next "
        "start.",
        "jobs": "Jobs of a service: submit, diagnose, list, show, label, stop, resume, result.",
        "report": "Write the report of a result folder, of a job, or of a comparison of jobs as one HTML "
        "file.",
        "monitors": "Monitors of a service: create, add records, show, delete.",
        "keys": "API keys of a service: create, list, revoke.",
        "admin": "Operation of a service: audit, owners, jobs, backup, restore.",
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
