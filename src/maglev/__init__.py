"""Dynamic reliability of high-speed EMS maglev trains on guideway bridges."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from maglev.config import load_config
    from maglev.errors import ConfigError, UserError
    from maglev.simulation import cost_of, simulate

__all__ = ["ConfigError", "UserError", "cost_of", "load_config", "simulate"]

_HOME = {
    "ConfigError": "maglev.errors",
    "UserError": "maglev.errors",
    "cost_of": "maglev.simulation",
    "load_config": "maglev.config",
    "simulate": "maglev.simulation",
}


def __getattr__(name: str) -> Any:
    """Import the public names when first used: compiled parts take seconds to import."""
    if name not in _HOME:
        raise AttributeError(f"module 'maglev' has no attribute '{name}'")
    from importlib import import_module

    return getattr(import_module(_HOME[name]), name)
