"""``python -m islands``: the command line of the installed package."""

from importlib.metadata import distribution

from islands.distribution import NAME

if __name__ == "__main__":
    # The core does not import the command line, which depends on it. Another distribution may have a command
    # of the same name.
    (command,) = distribution(NAME).entry_points.select(group="console_scripts", name="islands")
    command.load()()
