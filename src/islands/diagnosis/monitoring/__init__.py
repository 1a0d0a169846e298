"""Monitoring: states of the effects of a simulation from record to record, and changes of them."""
