"""Command line ``islands``: commands of a service, one file each. Read `islands_api.cli.app` first."""

from islands_api.cli.app import main

__all__ = ["main"]
