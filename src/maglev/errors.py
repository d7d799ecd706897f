"""Mistakes of a user, apart from faults of the program.

A function that refuses a user's value raises a `UserError` of one sentence: what is wrong, what
was expected, what was given, what to do.  The command line prints the sentence.  Any other
exception is a fault of the program and shows where it happened.
"""

from __future__ import annotations


class UserError(ValueError):
    """A mistake of the user, told in one sentence: the thing, the expected value, the given one."""


class ConfigError(UserError):
    """A mistake in a configuration, told in one sentence that names the key or the file."""


class StepTooLarge(UserError):
    """A time step beyond the stability limit of a system."""
