"""Commands, one file each; their table is in `islands.cli.app`."""
