"""The command line ``islands``: each command is one file, listed in `islands_api.cli.app`."""

from islands_api.cli.app import main

__all__ = ["main"]
