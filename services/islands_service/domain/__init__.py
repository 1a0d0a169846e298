"""Jobs and their specifications as values, without a database. Read `jobs` first."""
