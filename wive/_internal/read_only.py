"""Objects whose attributes are set once."""

from __future__ import annotations

from typing import Any, NoReturn


class ReadOnly:
    """Attributes are set by `__init__`, through `vars(self)`, and can't be changed afterwards."""

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        """Raise AttributeError."""
        raise AttributeError(f"{type(self).__name__}.{name} can't be set: results are read-only")

    def __delattr__(self, name: str) -> NoReturn:
        """Raise AttributeError."""
        raise AttributeError(f"{type(self).__name__}.{name} can't be deleted: results are read-only")
