"""Linear models of any order, with dead times, of one or several outputs; see decision 0044."""
