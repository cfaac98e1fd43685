"""Checks on single values that users pass. Errors are one line: the argument, what it must be, what came."""

import operator
from collections.abc import Iterable

import numpy as np

MOST_COUNT = 2**31 - 1  # the core takes 32-bit counts

# What float() takes and is no real number.
NOT_REAL = str, bytes, bytearray, bool, np.bool_, np.complexfloating


def choice(name: str, value: object, allowed: Iterable[str]) -> None:
    """Raise ValueError unless `value` is one of the allowed names."""
    allowed = tuple(allowed)
    if not isinstance(value, str) or value not in allowed:
        raise ValueError(
            f"{name} must be one of {', '.join(allowed)} in this version of wive, got {shown(value)}"
        )


def integer(name: str, value: object, lowest: int, highest: int = MOST_COUNT) -> int:
    """`value` as an int within [lowest, highest]."""
    try:
        if isinstance(value, bool):
            raise TypeError
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise TypeError(f"{name} must be an integer, got {described(value)}") from None
    if not lowest <= number <= highest:
        raise ValueError(f"{name} must be from {lowest} to {highest}, got {shown(number)}")
    return number


def flag(name: str, value: object) -> bool:
    """`value` as a bool."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name} must be True or False, got {described(value)}")
    return bool(value)


def real(name: str, value: object) -> float:
    """`value` as a finite float."""
    try:
        # float() also takes arrays of one number, with a warning.
        is_masked = np.any(getattr(value, "mask", False))
        if isinstance(value, NOT_REAL) or np.ndim(value) > 0 or is_masked:  # type: ignore[arg-type]
            raise TypeError
        number = float(value)  # type: ignore[arg-type]
    except OverflowError:
        raise ValueError(f"{name} must be finite, got {shown(value)}") from None
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be a real number, got {described(value)}") from None
    if not np.isfinite(number):
        raise ValueError(f"{name} must be finite, got {number}")
    return number


def unreadable(name: str, value: object, error: Exception) -> TypeError:
    """The error for an array that its library can't convert, with the library's reason."""
    reason = " ".join(str(error).split()) or type(error).__name__
    return TypeError(
        f"{name} must be an array that NumPy can read, got {type(value).__name__} ({reason:.120}): "
        "convert it first"
    )


def described(value: object) -> str:
    """A value and its type."""
    return f"{type(value).__name__} {shown(value)}"


def shown(value: object) -> str:
    """`value` in one line of at most 60 characters."""
    try:
        return f"{' '.join(repr(value).split()):.60}"
    except Exception:  # of a repr that is not ours; Python refuses to write integers of thousands of digits
        return f"of type {type(value).__name__}"
