"""Types of which effects are made. Read `effect` first."""
