"""Commands of the command line, one file each, listed in `islands_api.cli.app`."""
