"""Linear identification on random plants, compared with a fit that begins at the truth."""
