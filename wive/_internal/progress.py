"""A progress bar by tqdm if it is installed: on stderr, or in a notebook as a widget."""

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress_bar(
    total: int, unit: str, title: str, *, show: bool = True
) -> Iterator[Callable[[int], object]]:
    """Show a bar while the block runs; the function it yields advances it by a number of units.

    Without tqdm (extra `render`) the work goes on with no bar.
    """
    if show:
        try:
            with warnings.catch_warnings():  # a notebook without widgets has a bar of text
                warnings.simplefilter("ignore")
                from tqdm.auto import tqdm
        except ImportError:
            show = False
    if not show:
        yield lambda units: None
        return
    with tqdm(total=total, unit=unit, unit_scale=total >= 100_000, desc=title) as bar:
        yield bar.update
