"""Commands that need no service, one file each in `commands`. Read `app` first."""
