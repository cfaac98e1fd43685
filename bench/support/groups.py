"""Rows with the same values in some columns, taken together."""

from collections.abc import Iterator, Sequence
from typing import Any

from bench.support.report import Row
from bench.support.timing import geometric_mean


def distinct(rows: Sequence[Row], *keys: str) -> list[tuple[Any, ...]]:
    """The combinations of values in these columns, in order of appearance."""
    return list(dict.fromkeys(tuple(row[key] for key in keys) for row in rows))


def grouped(rows: Sequence[Row], keys: Sequence[str]) -> Iterator[tuple[Row, list[Row]]]:
    """Each of the `distinct` combinations, as columns and their values, and the rows that have it."""
    for values in distinct(rows, *keys):
        key = dict(zip(keys, values, strict=True))
        yield key, [row for row in rows if all(row[name] == value for name, value in key.items())]


def mean_rows(rows: Sequence[Row], keys: Sequence[str], columns: Sequence[str]) -> list[Row]:
    """Geometric means of some columns, per combination of the keys."""
    return [
        {**key, **{column: geometric_mean([row[column] for row in group]) for column in columns}}
        for key, group in grouped(rows, keys)
    ]
