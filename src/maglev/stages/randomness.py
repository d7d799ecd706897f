"""Random numbers of the stages: an independent stream for each purpose."""

from __future__ import annotations

import zlib

import numpy as np


def generator(seed: int, *key: str | int) -> np.random.Generator:
    """Stream for inputs of the model: points, candidates, tracks, rounds.

    Parameters
    ----------
    seed
        Seed of the configuration.
    key
        Words and numbers; the same key gives the same numbers.
    """
    words = [list(part.encode()) if isinstance(part, str) else [part] for part in key]
    return np.random.default_rng([seed, *(number for word in words for number in word)])


def generator_of_statistics(seed: int, purpose: str) -> np.random.Generator:
    """Stream for statistics of finished runs: populations, bootstraps, borders.

    The seed is the CRC-32 of the purpose, not its letters as in `generator`: the printed numbers
    were drawn that way.

    Parameters
    ----------
    seed
        Seed of the configuration.
    purpose
        Purpose of the numbers; the same words give the same numbers.
    """
    return np.random.default_rng([seed, zlib.crc32(purpose.encode())])
