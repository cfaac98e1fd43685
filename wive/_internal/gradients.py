"""A warning to those who ask for gradients through a query, which carries none."""

from __future__ import annotations

import sys
import warnings
from typing import Any

PACKAGE = __name__.partition(".")[0]


def warn_of_lost_gradients(method: str, **values: Any) -> None:
    """Warn, at the caller's line, of the first value that is a tensor of PyTorch with a gradient to be had.

    Results of `method` have none, and autograd would take that for zero.
    """
    torch = sys.modules.get("torch")
    if torch is None or not torch.is_grad_enabled():
        return
    for name, value in values.items():
        if isinstance(value, torch.Tensor) and value.requires_grad:
            instead = "use wive.torch.intersect, or " if method == "intersect" else ""
            warnings.warn(
                f"{name} requires gradients, which {method} does not carry: {instead}pass {name}.detach()",
                stacklevel=_levels_to_caller(),
            )
            return


def _levels_to_caller() -> int:
    """How many frames above `warn_of_lost_gradients` the first one outside of wive is, as `warn` counts."""
    frame, levels = sys._getframe(1), 1
    while frame.f_back and frame.f_globals.get("__name__", "").partition(".")[0] == PACKAGE:
        frame, levels = frame.f_back, levels + 1
    return levels
