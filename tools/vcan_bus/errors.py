"""What goes wrong before a command can be run."""


class NoBusError(Exception):
    """One line for people: what is missing, and what to do."""
