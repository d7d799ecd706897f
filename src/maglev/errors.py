"""Mistakes of a user, apart from faults of the program.

Whoever refuses what a user has given raises a `UserError` of one sentence: what is wrong, what was
expected, what came, what to do.  The command line prints the sentence.  Any other exception is a
fault of the program and shows where it happened.
"""

from __future__ import annotations


class UserError(ValueError):
    """What a user has given cannot be used, for the reason that its sentence tells."""


class ConfigError(UserError):
    """A mistake in a configuration, told in one sentence that names the key or the file."""
