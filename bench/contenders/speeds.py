"""Speeds of several ways to find closest hits, traced in turn."""

from collections.abc import Sequence

from bench.contenders.pareto_contenders import Array, Contender
from bench.support import report
from bench.support.timing import Effort, compare_in_turn, one_core, timed


def speeds(found: Sequence[Contender], rays: tuple[Array, Array], effort: Effort) -> dict[str, report.Row]:
    """Mray/s by contender, all traced in turn; `single` is None if a contender has no `trace_single`."""
    ways = [(one.name, "mrays", one.trace) for one in found]
    ways += [(one.name, "single", one.trace_single) for one in found if one.trace_single]
    rows: dict[str, report.Row] = {one.name: {"contender": one.name, "single": None} for one in found}
    runs = [timed(lambda trace=trace: trace(*rays)) for *_, trace in ways]  # type: ignore[misc]
    with one_core():
        for run in runs:
            run()
        outcomes = compare_in_turn(runs, effort)
    for (name, column, _), outcome in zip(ways, outcomes, strict=True):
        rows[name][column] = len(rays[0]) / outcome.our_seconds * 1e-6
        rows[name][f"{column}_ratio"] = outcome.ratio  # over the first contender's, wive fast in flight
    return rows
