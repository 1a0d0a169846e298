"""What goes wrong with a cluster: apart, so that who waits for it need not import Ray."""

from islands.errors import IslandsError


class ClusterError(IslandsError):
    """There is no Ray to run on: the message says what to do."""
