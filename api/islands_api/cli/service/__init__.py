"""Commands for a service: views of its jobs, and options of commands that open its database."""
