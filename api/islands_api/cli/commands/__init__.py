"""Commands of a service, one file each; their table is in `islands_api.cli.app`."""
