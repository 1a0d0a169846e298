"""Table of the commands that measure."""

from islands.cli.app import make_commands

#: Commands of the measurements, in the order of the help; see `islands.cli.app.Command`.
COMMANDS = make_commands(
    "islands_measurements",
    {
        "bench": "Measure evaluations, kernels and whole searches on this machine, which should be otherwise "
        "idle.",
        "trials": "Inject effects into simulated records, diagnose them, and count how often they are found "
        "and named.",
    },
)
