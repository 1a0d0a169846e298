"""Jobs and their specifications as values, without a database. Read `job` first."""
