"""``python -m islands``: the command line of the installed package."""

from importlib.metadata import entry_points

if __name__ == "__main__":
    # The core does not import the command line, which depends on it.
    (command,) = entry_points(group="console_scripts", name="islands")
    command.load()()
