"""HTML reports of identifications and diagnoses, each a single file with embedded figures."""
