"""Commands, one file each; the table of commands is in `islands_api.cli.app`."""
