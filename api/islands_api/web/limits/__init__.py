"""Limits of the requests of an owner: their rate, what is in progress, and turns for scarce work."""
