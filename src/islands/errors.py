"""Every deliberate error of the house. The message says what is wrong, where, and what to do."""


class IslandsError(Exception):
    """Base of all deliberate errors: catch this to catch them all."""


class RecordError(IslandsError):
    """A record cannot be used as it is: the message names row and column and says what to do."""


class ModelError(IslandsError):
    """A model, an expression or a model file is not what it should be."""


class SettingsError(IslandsError):
    """A setting is out of its range, unknown, or contradicts another one."""
