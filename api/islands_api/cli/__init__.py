"""Command line ``islands``: one file per command. Read `islands_api.cli.app` first."""

from islands_api.cli.app import main

__all__ = ["main"]
