"""Results of a search and their models, as objects of a run or of a result folder. Read `result` first."""
