"""Migration between islands: topology, policies, schedule. Read `topology` first."""
