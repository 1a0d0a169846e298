"""Migration between islands: topology, selection and replacement policies, schedule."""
