"""Results as JSON: the folder of an identification, diagnoses, plans and states of monitoring."""
