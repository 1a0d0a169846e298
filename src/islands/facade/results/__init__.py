"""Results of searches and diagnoses and their models, new or read from a folder. Read `result` first."""
