"""The commands in docs/command_line.md run as they are printed, and it has every command and option."""

import re
from pathlib import Path

import pytest
from support.pages import ROOT, programs, run

from wive.cli import main

PAGE = "docs/command_line.md"
COMMANDS = re.findall(r"^wive (.+)$", (ROOT / PAGE).read_text(encoding="utf-8"), re.MULTILINE)
TETRAHEDRON = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 4
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
0 0 1
3 0 2 1
3 0 1 3
3 0 3 2
3 1 2 3
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files that the page names."""
    folder = tmp_path_factory.mktemp("page")
    (folder / "mesh.ply").write_text(TETRAHEDRON)
    (program,) = programs(PAGE)
    run(program, folder)
    return folder


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_run_as_they_are_printed(
    command: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("PIL")
    monkeypatch.chdir(folder)
    arguments = command.split()
    small = ["--width", "40", "--height", "30", "--spp", "1"] if "render" in arguments else []
    assert main(arguments + small) in (None, 0)
    if "-o" in arguments:
        assert (folder / arguments[arguments.index("-o") + 1]).stat().st_size > 0
    else:
        assert capsys.readouterr().out


def test_the_page_has_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    commands = re.search(r"COMMAND\n((?:    \w.*\n)+)", capsys.readouterr().out)
    assert commands is not None
    listed = {line.split()[0] for line in commands[1].splitlines()}
    assert listed == {command.split()[0] for command in COMMANDS}


@pytest.mark.parametrize("command", ["render", "trace", "info", "backends"])
def test_the_page_has_every_option(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main([command, "--help"])
    options = set(re.findall(r"^  .*?(--[\w-]+)", capsys.readouterr().out, re.MULTILINE))
    named = re.findall(r"`(--[\w-]+)`", (ROOT / PAGE).read_text(encoding="utf-8"))
    assert options - {"--help"} <= set(named)
