"""HTML reports of identifications, diagnoses and comparisons, each a single file with embedded figures."""
