"""The tables and figures of the paper, computed by this package. Read `tasks` and `section` first."""
