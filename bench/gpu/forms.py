"""Which kernels `bench gpu` measures: trees, lane forms and block sizes."""

from collections.abc import Iterator
from typing import NamedTuple

from bench.gpu.session import Lanes, Session


class Options(NamedTuple):
    """The options of one tree."""

    precision: str
    accuracy: str
    nodes: str


class Form(NamedTuple):
    """How a kernel is launched."""

    lanes: Lanes
    block: int


USUAL_FORMS = (Form(1, 64), Form(8, 128))  # the block sizes that launches choose by themselves
# Compared with each other and with the usual ones, on float32 watertight trees.
FAST_FORMS = (Form(8, 128), Form(8, 64), Form(8, 256), Form(1, 64), Form(1, 128))
SMALL_FORMS = (Form(1, 64), Form(1, 128), Form(8, 32), Form(8, 128))

WATERTIGHT = Options("float32", "watertight", "float32")
FAST_TREES = (
    WATERTIGHT,
    Options("float32", "watertight", "compressed"),
    Options("float32", "fast", "float32"),
)

# Section `right`: every combination on a small mesh, and those that large meshes test harder.
EVERY = tuple(
    Options(precision, accuracy, nodes)
    for precision, accuracies in (
        ("float32", ("fast", "watertight", "exact")),
        ("float64", ("fast", "watertight")),
    )
    for accuracy in accuracies
    for nodes in ("float32", "compressed")
)
RIGHT_TREES = {
    "living_room": EVERY[:6],
    "terrain_jacksboro": EVERY[2:4],
    "city_san_francisco": EVERY[6:],
    "bathroom_salledebain": (EVERY[2], EVERY[4]),
}


def right_trees(session: Session) -> Iterator[tuple[str, Options]]:
    """Scenes and tree options whose hits are compared; every combination on a scene not listed."""
    for name in session.names:
        for options in (WATERTIGHT,) if session.quick else RIGHT_TREES.get(name, EVERY):
            yield name, options


def forms(session: Session, wanted: tuple[Form, ...]) -> tuple[Form, ...]:
    """The forms wanted; on the CPU device only eight lanes, as one lane is slow there and for tests."""
    return wanted if session.on_gpu else (Form(8, 128),)


def fast_forms(session: Session, options: Options) -> tuple[Form, ...]:
    """The forms that section `fast` compares on a tree."""
    return forms(session, FAST_FORMS if options == WATERTIGHT else USUAL_FORMS)
