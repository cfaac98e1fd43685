"""A file that does not fit into memory is a MemoryError that names it, never another error or half a mesh."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support import dae_files, gltf_files, mesh_files, scene_files, threemf_files

import wive

COUNT = 4000
READ = """
import os, resource, sys
import wive

def outcome(work, room):
    used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + room, resource.RLIM_INFINITY))
    try:
        work()
        return "done"
    except BaseException as error:
        return f"{type(error).__name__}: {error}"
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))

for small, large in zip(sys.argv[1::2], sys.argv[2::2]):
    read = wive.load if large.endswith("wive") else wive.load_mesh
    read(small)  # what is imported and kept
    for step in range(8):
        if os.fork() == 0:  # so that each begins without memory that another gave back
            print(large, outcome(lambda: read(large), step**3 * os.path.getsize(large) // 5), flush=True)
            os._exit(0)
        os.wait()
"""


def large_files() -> dict[str, bytes]:
    points = np.random.default_rng(1).random((3 * COUNT, 3)).astype(np.float32)
    faces = np.arange(3 * COUNT).reshape(-1, 3)
    rows, corners = points.tolist(), faces.tolist()
    model = gltf_files.Model()
    shape = gltf_files.primitive(model.array(points, "f4"), model.array(faces.ravel(), "u4"))
    model.node(mesh=model.mesh(shape), scale=[2, 2, 2])
    package = threemf_files.model({"1": threemf_files.mesh(points, corners)}, ['objectid="1"'])
    geometry = dae_files.geometry("a", points, dae_files.primitive("triangles", faces.ravel().tolist()))
    lines = "".join(f"v {a} {b} {c}\n" for a, b, c in rows)
    off = f"OFF {len(rows)} {COUNT} 0\n" + lines.replace("v ", "")
    return {
        "obj": (lines + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in corners)).encode(),
        "off": (off + "".join(f"3 {a} {b} {c}\n" for a, b, c in corners)).encode(),
        "stl": mesh_files.stl_binary(4 * COUNT),
        "glb": model.glb(),
        "3mf": threemf_files.package(package),
        "dae": dae_files.document(geometry, dae_files.node(dae_files.draw("a"))).encode(),
    }


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_with_any_limit_of_the_address_space_a_file_is_read_or_a_memory_error(tmp_path: Path) -> None:
    names = []
    small = {kind: seeds[0] for kind, seeds in mesh_files.WHOLE.items()}
    small |= {kind: make() for kind, make in scene_files.FILES.values()}
    for kind, data in large_files().items():
        for size, content in (("small", small[kind]), ("large", data)):
            names.append(f"{size}.{kind}")
            (tmp_path / names[-1]).write_bytes(content)
    for size, repeated in (("small", 1), ("large", 20 * COUNT)):
        names.append(f"{size}.wive")
        wive.Scene(np.eye(3, dtype=np.float32), [[0, 1, 2]] * repeated).save(tmp_path / names[-1])
    ran = subprocess.run([sys.executable, "-c", READ, *names], cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    outcomes: dict[str, set[str]] = {}
    for line in ran.stdout.splitlines():
        name, _, found = line.partition(" ")
        kind, _, text = found.partition(": ")
        assert kind in ("done", "MemoryError"), line
        # The tree of a scene takes memory after the file was read.
        assert kind == "done" or text.startswith((f"{name}: ", "not enough memory: ")), line
        outcomes.setdefault(name, set()).add(kind)
    assert outcomes == {name: {"done", "MemoryError"} for name in names[1::2]}
