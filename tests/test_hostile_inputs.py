"""Files of somebody else: no command executes code from them, or writes outside its own directory."""

import pytest
from mpi4py import MPI

from wavetank.cli import main
from wavetank.fe.layout_mesh import read_layout

SQUARE = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
2
1 1 "paddle"
2 2 "water"
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
$EndNodes
$Elements
3
1 1 2 1 1 4 1
2 2 2 2 1 1 2 3
3 2 2 2 1 1 3 4
$EndElements
"""
BASIN = """
[tank]
type = "basin"
depth = 0.5
layout = { type = "file", file = "foreign.msh" }
[run]
duration = 0.1
"""


def refusal(capfd: pytest.CaptureFixture[str], *words: object) -> str:
    """Return the one sentence with which a command is refused."""
    capfd.readouterr()
    code, printed = main([str(word) for word in words]), capfd.readouterr()
    assert code == 2, printed
    (line,) = printed.err.splitlines()
    return line


@pytest.mark.parametrize("begins", ["$", "$MeshFormat;", "$MeshFormat "])
def test_run_refuses_a_mesh_file_of_gmsh_commands(begins, tmp_path, capfd):
    """Twice: gmsh's parser executes the rest of a file when it opens the next."""
    mark = tmp_path / "executed"
    (tmp_path / "foreign.msh").write_text(f'{begins}SystemCall "touch {mark}";\n{SQUARE}')
    (tmp_path / "case.toml").write_text(BASIN)
    for _ in range(2):
        said = refusal(capfd, "run", tmp_path / "case.toml", "--out", tmp_path / "run")
        assert "foreign.msh: is not in gmsh's mesh format" in said
    assert not mark.exists() and not (tmp_path / "run").exists()


def test_mesh_is_read_without_executing_its_option_file(tmp_path):
    mark, mesh = tmp_path / "executed", tmp_path / "foreign.msh"
    mesh.write_text(SQUARE)
    (tmp_path / "foreign.msh.opt").write_text(f'SystemCall "touch {mark}";\n')
    assert read_layout(mesh, MPI.COMM_SELF).mesh.topology.index_map(2).size_local == 2
    assert not mark.exists()
