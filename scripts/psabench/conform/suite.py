"""All scenes, checks and trials that there are: importing their modules registers them."""

from __future__ import annotations

import pkgutil
from importlib import import_module

from psabench.conform import checks, scenes, trials


def load() -> None:
    """Import them all, in the order of their names."""
    for package in (scenes, checks, trials):
        for module in sorted(m.name for m in pkgutil.iter_modules(package.__path__)):
            import_module(f"{package.__name__}.{module}")
