"""Physical simulators and the signals that excite them: where records with a known truth come from."""
