"""Commands of the laboratory: ``python -m lab COMMAND``, which is ``islands COMMAND`` in a checkout."""

from islands.cli.app import MEASUREMENTS, Commands, make_app, run


class Measurements(Commands):
    """Group of the commands of the laboratory."""

    table = MEASUREMENTS


if __name__ == "__main__":
    run(make_app(Measurements))
