"""What the core is compiled for: refusals of cpu/supported.cmake, kernels, and the Pythons of wheels."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import wive

ROOT = Path(__file__).resolve().parents[2]
CMAKE = shutil.which("cmake") or shutil.which("cmake", path=str(Path(sys.executable).parent))


def configure(**variables: str) -> tuple[int, str]:
    """The exit status and the words of cpu/supported.cmake for what CMake found."""
    settings = [f"-D{name}={value}" for name, value in variables.items()]
    script = ROOT / "cpu" / "supported.cmake"
    done = subprocess.run(
        [str(CMAKE), *settings, "-P", str(script)], capture_output=True, text=True, check=False
    )
    return done.returncode, " ".join(done.stderr.split())


@pytest.mark.skipif(CMAKE is None, reason="needs CMake")
@pytest.mark.parametrize(
    ("found", "words"),
    [
        ({"CMAKE_CXX_COMPILER_ID": "MSVC", "CMAKE_CXX_BYTE_ORDER": "LITTLE_ENDIAN"}, "got MSVC's cl,"),
        (
            {"CMAKE_CXX_BYTE_ORDER": "BIG_ENDIAN", "CMAKE_SYSTEM_PROCESSOR": "s390x"},
            "got s390x, which is big-endian",
        ),
        ({"CMAKE_SIZEOF_VOID_P": "4", "CMAKE_SYSTEM_PROCESSOR": "i686"}, "got i686 with pointers of 4 bytes"),
    ],
    ids=["MSVC", "big-endian", "32-bit"],
)
def test_a_target_without_a_form_of_the_core_is_refused_in_a_line(found: dict[str, str], words: str) -> None:
    status, text = configure(**found)
    assert status != 0
    assert text.count("wive: expected") == 1 and words in text


@pytest.mark.skipif(CMAKE is None, reason="needs CMake")
@pytest.mark.parametrize("compiler", ["GNU", "Clang", "AppleClang"])
def test_a_64_bit_little_endian_target_is_taken(compiler: str) -> None:
    assert configure(
        CMAKE_CXX_COMPILER_ID=compiler, CMAKE_CXX_BYTE_ORDER="LITTLE_ENDIAN", CMAKE_SIZEOF_VOID_P="8"
    ) == (0, "")


def test_the_build_begins_with_these_refusals() -> None:
    statements = (ROOT / "CMakeLists.txt").read_text().splitlines()
    assert statements[:3] == [
        "cmake_minimum_required(VERSION 3.20)",
        "project(wive LANGUAGES CXX)",
        "include(cpu/supported.cmake)",
    ]


def test_wheels_are_made_for_every_python_that_is_supported() -> None:
    tomllib = pytest.importorskip("tomllib", reason="Python 3.10 can't read TOML")
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    project, wheels = settings["project"], settings["tool"]["cibuildwheel"]
    minors = re.findall(r"Python :: 3\.(\d+)", "\n".join(project["classifiers"]))
    assert project["requires-python"] == f">=3.{minors[0]}"
    assert wheels["build"].split() == [*(f"cp3{minor}-*" for minor in minors), "cp314t-*"]
    for arch in ("x86_64", "aarch64"):
        assert wheels["linux"][f"manylinux-{arch}-image"] == "manylinux_2_28"
    assert f"Python :: 3.{sys.version_info.minor}" in "\n".join(project["classifiers"])


def test_the_conda_package_imports_only_what_it_depends_on(tmp_path: Path) -> None:
    listed = re.search(r"imports:\n((?: {8}- \S+\n)+)", (ROOT / "recipe" / "recipe.yaml").read_text())
    assert listed is not None
    modules = listed[1].replace("-", "").split()
    extras = dict.fromkeys(("warp", "trimesh", "dask", "matplotlib", "PIL", "tqdm"))
    program = f"import sys; sys.modules |= {extras}; import {', '.join(modules)}"
    subprocess.run([sys.executable, "-c", program], check=True, cwd=tmp_path)


def test_this_machine_s_kernels_are_those_that_its_system_names() -> None:
    """The core asks by CPUID: the compiler's own function says no with some run-time libraries."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = re.findall(r"^flags\s*: (.*)$", cpuinfo.read_text(), re.MULTILINE) if cpuinfo.exists() else []
    if not lines:
        pytest.skip("the system names no flags of this processor")
    flags = set(lines[0].split())
    needed = {"avx2": {"avx2", "fma", "bmi1", "bmi2", "abm", "popcnt"}}
    needed["avx512"] = needed["avx2"] | {"avx512f", "avx512vl", "avx512dq", "avx512bw"}
    for name, names in needed.items():
        assert wive.backends()[name].usable == (names <= flags), name
