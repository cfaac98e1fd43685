"""Checked access to the JSON of a glTF document: each function returns a value of the kind that it names.

Each raises ValueError with the place in the document, what was expected and what was found.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Fields = dict[str, Any]


def short(value: object) -> str:
    """A JSON value in a message, cut to a length that stays readable."""
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def whole(holder: Fields, key: str, place: str, default: int | None = None) -> int:
    """The whole number from 0 at `key`; JSON may write it with a fraction of zero, as in 3.0."""
    value = holder.get(key, default)
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if type(value) is not int or value < 0:
        found = "nothing" if value is None else short(value)
        raise ValueError(f"{place}: {key}: expected a whole number from 0, found {found}")
    return value


def index_of(holder: Fields, key: str, place: str) -> int | None:
    """The whole number at `key`, None if there is no such key."""
    return whole(holder, key, place) if key in holder else None


def members(holder: Fields, key: str, place: str) -> Fields:
    """The object at `key`, empty if there is no such key."""
    value = holder.get(key, {})
    if not isinstance(value, dict):
        raise ValueError(f"{place}: {key}: expected an object, found {short(value)}")
    return value


def listed(holder: Fields, key: str, place: str) -> list[Any]:
    """The array at `key`, empty if there is no such key."""
    value = holder.get(key, [])
    if not isinstance(value, list):
        raise ValueError(f"{place}: {key}: expected an array, found {short(value)}")
    return value


def indices(holder: Fields, key: str, place: str) -> list[int]:
    """The array of whole numbers at `key`, empty if there is no such key."""
    return [whole({key: value}, key, place) for value in listed(holder, key, place)]


def objects(holder: Fields, key: str, place: str) -> list[Fields]:
    """The array of objects at `key`, empty if there is no such key."""
    found = listed(holder, key, place)
    for at, value in enumerate(found):
        if not isinstance(value, dict):
            raise ValueError(f"{place}: {key}[{at}]: expected an object, found {short(value)}")
    return found


def numbers(holder: Fields, key: str, place: str, count: int | None) -> NDArray[np.float64]:
    """The array of finite numbers at `key`; of `count` numbers, unless that is None."""
    value = listed(holder, key, place)
    if all(type(item) in (int, float) for item in value) and count in (None, len(value)):
        try:
            array = np.array(value, np.float64)
        except OverflowError:
            array = np.array([np.inf])
        if np.isfinite(array).all():
            return array
    raise ValueError(
        f"{place}: {key}: expected {'' if count is None else f'{count} '}finite numbers, found {short(value)}"
    )
