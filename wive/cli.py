"""The command line: `wive render | trace | info | backends`."""

import argparse
import contextlib
import io
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

import wive
from wive._internal import commands
from wive._internal.picture import ALBEDOS, SHADINGS, SKIES, Settings
from wive._internal.pictures.image_files import FORMATS
from wive.backend import CPU_BACKENDS, WARP
from wive.streams import PIECE, PIECE_ALL, PIECE_PER_THREAD

BAD_INPUT = 2
INTERRUPTED = 130
BROKEN_PIPE = 141


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command in `argv` (default: the program's arguments) and return its exit status.

    0 is success, 2 bad input or usage (one line on stderr), 130 Ctrl-C, 141 if nobody reads what it prints.
    """
    try:
        options = _parser().parse_args(argv)
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            options.run(options)
        _print(printed.getvalue())
    except BrokenPipeError:  # as of `wive info ... | head -1`
        return BROKEN_PIPE
    except KeyboardInterrupt as kept:
        print(f"wive: interrupted: {kept}" if str(kept) else "wive: interrupted", file=sys.stderr)
        return INTERRUPTED
    except (ImportError, MemoryError, OSError, TypeError, ValueError) as error:
        print(f"wive: error: {' '.join(str(error).split()) or 'out of memory'}", file=sys.stderr)
        return BAD_INPUT
    return 0


def _print(text: str) -> None:
    """Print a command's text; OSError that names standard output if it can't be."""
    try:
        print(text, end="", flush=True)
    except OSError as error:
        # Python would write it once more at its end, and complain.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise OSError(error.errno, error.strerror, "standard output") from error


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"wive: error: {message} (see {self.prog} --help)\n")


class _Defaults(argparse.ArgumentDefaultsHelpFormatter):
    """Help with the default of each option that has one and doesn't tell it itself."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        has_one = action.default is not None and action.default is not False
        return super()._get_help_string(action) if has_one else action.help


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="wive", description="Fast ray queries on triangle meshes.")
    parser.add_argument("--version", action="version", version=f"wive {wive.__version__}")
    subparsers = parser.add_subparsers(required=True, metavar="COMMAND", parser_class=_Parser)
    _add_render(subparsers)
    _add_trace(subparsers)
    _add_info(subparsers)
    backends = subparsers.add_parser(
        "backends", help="list the backends and devices, and which can be used here"
    )
    backends.set_defaults(run=commands.list_backends)
    return parser


def _add_render(subparsers: "argparse._SubParsersAction[_Parser]") -> None:
    parser = subparsers.add_parser(
        "render",
        help="make a picture of a mesh",
        description="Make a picture of a mesh: path-traced by daylight, or by ambient occlusion if the "
        "camera stands inside.",
        formatter_class=_Defaults,
    )
    parser.add_argument(
        "mesh", nargs="?", metavar="MESH", help="mesh file or saved scene; default: real terrain"
    )
    parser.add_argument(
        "-o",
        "--output",
        default="wive.png",
        metavar="FILE",
        help=f"picture to write: {', '.join(FORMATS)}",
    )
    parser.add_argument(
        "--shading",
        choices=SHADINGS,
        default=Settings.shading,
        help="auto is path, or ao if the camera stands inside or no light gets in",
    )
    parser.add_argument("--width", type=int, default=Settings.width, help="pixels")
    parser.add_argument("--height", type=int, default=Settings.height, help="pixels")
    parser.add_argument("--spp", type=int, default=Settings.spp, help="samples per pixel")
    parser.add_argument(
        "--bounces", type=int, default=Settings.bounces, help="diffuse bounces after which a path ends"
    )
    parser.add_argument(
        "--albedo", choices=("file", *ALBEDOS), default="file", help="surface colour; file: those of the file"
    )
    parser.add_argument(
        "--sky", choices=SKIES, default=Settings.sky, help="light of paths; day has a sun on the left"
    )
    parser.add_argument(
        "--sun", type=float, nargs=3, metavar=("X", "Y", "Z"), help="direction towards the sun, in any sky"
    )
    parser.add_argument(
        "--exposure",
        type=_stops,
        default=Settings.exposure,
        metavar="STOPS",
        help="powers of two by which the picture is brighter, or auto",
    )
    parser.add_argument("--reach", type=float, help="distance from which surfaces do not occlude, of ao")
    for name, meaning in (
        ("eye", "where the camera is; default: where it sees most of the mesh"),
        ("target", "what is in the picture's middle; default: what shows most of the mesh"),
        ("up", "what is up in the picture; default: as the mesh seems to stand"),
    ):
        parser.add_argument(f"--{name}", type=float, nargs=3, metavar=("X", "Y", "Z"), help=meaning)
    parser.add_argument(
        "--fov", type=float, help="vertical field of view in degrees; default: 40, in rooms 65"
    )
    parser.add_argument("--seed", type=int, default=Settings.seed, help="of the random numbers")
    _add_scene_options(parser)
    parser.set_defaults(run=commands.render_picture)


def _stops(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text  # "auto", or refused by its name


def _add_trace(subparsers: "argparse._SubParsersAction[_Parser]") -> None:
    parser = subparsers.add_parser(
        "trace",
        help="closest hits of rays from a file, or all",
        description="Find the closest hit of each ray; write arrays t, prim and uv. With --all, find every "
        "hit: those of ray i are rows offsets[i] to offsets[i+1], by ascending t. Rays are read, traced and "
        "written a piece at a time, so there may be more than fit into memory.",
        formatter_class=_Defaults,
    )
    parser.add_argument("mesh", metavar="MESH", help="mesh file or saved scene")
    parser.add_argument(
        "rays",
        metavar="RAYS",
        help=".npy of shape (n,6): origin, direction; or (n,8): with tmin, tmax; "
        "or .npz of origins, directions and maybe tmin, tmax; or a raw file, see --raw",
    )
    parser.add_argument(
        "-o",
        "--output",
        required=True,
        metavar="HITS",
        help="hits to write: an .npz file, or a name that ends in / for a folder of .npy files",
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="go on with a run that was interrupted or killed, if there is one",
    )
    parser.add_argument(
        "--raw", metavar="DTYPE", help="RAYS holds numbers of this dtype alone, such as float32 or >f8"
    )
    parser.add_argument(
        "--columns",
        metavar="NAMES",
        help="with --raw: what the numbers of a ray are, _ for others; default: ox,oy,oz,dx,dy,dz, and there "
        "may be tmin,tmax",
    )
    parser.add_argument(
        "--piece",
        type=int,
        metavar="RAYS",
        help=f"rays per piece; default: {PIECE_PER_THREAD:,} per thread, {PIECE:,} at most; "
        f"with --all {PIECE_ALL:,}",
    )
    parser.add_argument("--all", action="store_true", help="every hit of each ray; also writes offsets")
    parser.add_argument(
        "--max-bytes",
        type=int,
        metavar="BYTES",
        help="with --all: what the hits of a piece may take; "
        "default: three quarters of the memory that is available",
    )
    parser.add_argument(
        "--touching",
        action="store_true",
        help="with --all: every triangle touched at an edge or a vertex, not every crossing of the surface",
    )
    _add_scene_options(parser)
    _add_precision(parser)
    parser.set_defaults(run=commands.trace_rays)


def _add_info(subparsers: "argparse._SubParsersAction[_Parser]") -> None:
    parser = subparsers.add_parser(
        "info",
        help="a mesh and its tree in numbers",
        formatter_class=_Defaults,
    )
    parser.add_argument("mesh", metavar="MESH", help="mesh file or saved scene")
    _add_scene_options(parser, threads=False)
    _add_precision(parser)
    parser.set_defaults(run=commands.describe_mesh)


def _add_scene_options(parser: argparse.ArgumentParser, threads: bool = True) -> None:
    own = "; a saved scene has its own"
    parser.add_argument("--backend", help=f"auto, {', '.join(CPU_BACKENDS)}, {WARP} (default: auto){own}")
    parser.add_argument("--device", help="Warp device such as cuda:0 or cpu; implies --backend warp")
    parser.add_argument("--accuracy", help=f"fast, watertight or exact (default: watertight){own}")
    parser.add_argument("--nodes", help=f"float32 or compressed (default: float32){own}")
    if threads:
        parser.add_argument("--threads", type=int, help="default: every core")


def _add_precision(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--precision",
        choices=("float32", "float64"),
        help="of coordinates and t; float64 if the file has finer ones (default: float32); a saved scene has "
        "its own",
    )
