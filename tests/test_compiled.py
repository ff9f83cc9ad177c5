"""Compiled code is complete or absent, whoever compiles, is killed or may not write.

Oracle: the form's value, 1, and the compiler's own record of how often it ran.
"""

import os
import subprocess
import sys
import sysconfig
import weakref
from contextlib import ExitStack
from pathlib import Path
from time import sleep

import numpy as np
import pytest
from mpi4py import MPI
from ranks import CHECKOUT, begun, on
from recorded_runs import BASIN, FLAP, SLICE, case_of

from wavetank.base.errors import WavetankError
from wavetank.base.toml import toml
from wavetank.fem import codegen, compiled
from wavetank.fem.codegen import FLAGS, Buffer, Unit, source
from wavetank.simulation.build import build_run

FORM = """
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from wavetank.fem.forms import ScalarForm
line = mesh.create_unit_interval(MPI.COMM_WORLD, 4)
print(ScalarForm(fem.Constant(line, 1.0) * ufl.dx, MPI.COMM_WORLD).assemble())
"""
KERNEL = """
from mpi4py import MPI
from wavetank.fem.codegen import Unit
code = "static double one(void)\\n{ return 1.0; }"
print(Unit(MPI.COMM_WORLD).add("unit", code, exports=["one"]).function("one")())
"""
CODE = pytest.mark.parametrize(  # both are stored alike
    "code", [pytest.param(FORM, id="form", marks=pytest.mark.slow), pytest.param(KERNEL, id="kernel")]
)
CACHE = "Süd & Co."  # whatever a folder is called


@pytest.fixture
def world(tmp_path):
    """Return the environment of a new user, whose compiler writes a line in ``compiled`` each time it runs."""
    compiler = tmp_path / "cc"
    compiler.write_text(f'#!/bin/sh\necho "$*" >>{tmp_path}/compiled\nsleep $SLOW\nexec gcc "$@"\n')
    compiler.chmod(0o755)
    (tmp_path / "tmp").mkdir()
    cache, temporary = f"{tmp_path}/{CACHE}", f"{tmp_path}/tmp"
    return {**os.environ, "XDG_CACHE_HOME": cache, "TMPDIR": temporary, "CC": str(compiler), "SLOW": "0"}


def started(code, world, *, ranks=1, **variables):
    command = on(ranks, [sys.executable, "-c", code])
    return begun(command, env={**world, **variables}, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def ran(code, world, **more):
    """Return what is printed, as output and as errors."""
    with started(code, world, **more) as process:
        return process.communicate()


def compilations(folder: Path) -> int:
    return sum(" -c " in line for line in (folder / "compiled").read_text().splitlines())


@CODE
def test_process_that_is_killed_while_compiling_blocks_no_other(code, world, tmp_path):
    with started(code, world, SLOW="300") as killed:
        while not (tmp_path / "compiled").exists():
            assert killed.poll() is None
            sleep(0.05)
        killed.kill()
        killed.wait()
        out, err = ran(code, world)  # while the compiler of the one that was killed goes on
        assert out == "1.0\n", err
        assert not list((tmp_path / CACHE / "wavetank" / "compiled").glob("*.*"))  # no lock, nothing half done


@CODE
def test_two_processes_at_once_and_a_later_one_compile_once(code, world, tmp_path):
    with started(code, world, SLOW="2") as first, started(code, world, SLOW="2") as second:
        for one in (first, second):
            out, err = one.communicate()
            assert out == "1.0\n", err
    ran(code, world)
    assert compilations(tmp_path) == 1


def test_process_that_waits_for_another_compiler_prints_it(world, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", world["XDG_CACHE_HOME"])
    wanted = 'compiled(MPI.COMM_SELF, "code", build=None)'
    code = f"from mpi4py import MPI; from wavetank.fem.compiled import compiled; print({wanted})"
    with ExitStack() as others:
        other = []

        def build(folder):
            other.append(others.enter_context(started(code, world)))
            assert "what is needed here: waiting for it." in other[0].stderr.readline()

        path = compiled.compiled(MPI.COMM_SELF, "code", build=build)
        assert other[0].communicate()[0] == f"{path}\n"


def test_cache_that_cannot_be_written_is_replaced_with_a_warning(world, tmp_path):
    (tmp_path / "file").touch()  # where root cannot write either
    world["HOME"] = f"{tmp_path}/file"
    del world["XDG_CACHE_HOME"]
    out, err = ran(FORM + KERNEL, world, ranks=2)
    assert out.count("1.0") == 4, err  # lines of two ranks may run into one another
    assert err.count("set XDG_CACHE_HOME to a folder that can be written.") == 1
    assert compilations(tmp_path) == 2
    assert ran(FORM + KERNEL, world) == ("1.0\n1.0\n", "")


def test_code_that_others_can_write_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    path = compiled.compiled(MPI.COMM_SELF, "code", build=lambda folder: None)
    assert compiled.compiled(MPI.COMM_SELF, "code", build=None) == path
    path.chmod(0o777)
    sentence = f"{path}: other users own it or can write there; XDG_CACHE_HOME must name another folder."
    with pytest.raises(WavetankError, match=sentence):
        compiled.compiled(MPI.COMM_SELF, "code", build=None)


def test_all_ranks_name_a_cache_that_cannot_be_written_or_a_missing_compiler(world, tmp_path):
    (tmp_path / CACHE).write_text("a file in the folder's place")
    code = f"""
from wavetank.base.errors import WavetankError
try:
    exec({FORM!r})
except WavetankError as error:
    print("RANK", MPI.COMM_WORLD.rank, error)
"""
    (tmp_path / "tmp" / f"wavetank-{os.getuid()}").write_text("another's")
    for variables, sentence in (
        ({}, "XDG_CACHE_HOME must name a folder that can be written."),
        ({"XDG_CACHE_HOME": f"{tmp_path}/other", "CC": "false"}, "a C compiler is needed"),
    ):
        out, _ = ran(code, world, ranks=2, **variables)
        assert out.count(sentence) == out.count("RANK") == 2
    assert not list((tmp_path / "other" / "wavetank" / "compiled").glob("*.part-*"))


def test_code_for_this_processor_is_not_used_on_another(tmp_path, monkeypatch):
    kinds = ["model name\t: Intel\nflags\t\t: fpu sse2 avx512f", "model name\t: Intel\nflags\t\t: fpu sse2 avx"]
    kinds += ["Features : sve"]
    for name, kind, megahertz in zip(("0", "1", "2", "warmer"), (*kinds, kinds[0]), range(4), strict=True):
        (tmp_path / name).write_text(f"processor\t: 0\n{kind}\ncpu MHz\t: {megahertz}\n\nprocessor\t: 1\n")
    found = [compiled.processor(tmp_path / name) for name in ("0", "1", "2", "missing", "warmer")]
    assert len({*found}) == 4
    assert found[4] == found[0]
    assert [*map(compiled.vector_size, found)] == [64, 32, 16, 16, 64]

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folders = set()
    for kind in found:
        monkeypatch.setattr(compiled, "processor", lambda kind=kind: kind)
        folders.add(compiled.compiled(MPI.COMM_SELF, "code", build=lambda folder: None))
    assert len(folders) == 4


def errors_of_last(cache: str) -> list[str]:
    """Return the errors where the last rank alone can store nothing, and where it cannot load the code; collective."""
    comm, errors, code = MPI.COMM_WORLD, [], "static double two(void)\n{ return 2.0; }"

    def full(**names):
        raise OSError(28, "No space left on device")

    def barred(file):
        raise ImportError("failed to map segment from shared object")

    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("XDG_CACHE_HOME", f"{cache}/{comm.rank}")  # each its own
        for module, name, fails in ((compiled, "mkdtemp", full), (codegen, "_module", barred)):
            with patched.context() as there:
                if comm.rank == comm.size - 1:
                    there.setattr(module, name, fails)
                with pytest.raises(WavetankError) as error:
                    Unit(comm).add("unit", code, exports=["two"]).function("two")()
            errors.append(str(error.value))
    return errors


def test_failure_of_one_rank_to_store_or_load_code_ends_all_with_one_sentence(on_ranks, tmp_path):
    for full, barred in on_ranks(errors_of_last, str(tmp_path)):
        assert full == f"nothing can be kept in {tmp_path}/2/wavetank/compiled (No space left on device)."
        assert barred.startswith(f"what is compiled in {tmp_path}/2/wavetank/compiled/")
        assert "cannot be loaded (failed to map segment from shared object); if no program may be run there" in barred


ROWS = """
typedef struct {
    int count;
    const double **rows;
} Rows;

static double total(const Rows *r, const double *weights)
{
    double sum = 0.0;
    for (int k = 0; k < r->count; ++k)
        sum += weights[k] * r->rows[k][0];
    return sum;
}
"""


def test_struct_holds_references_to_its_arrays():
    """On two ranks the lengths of paddles were freed, and the evaluation of the surface crashed."""
    instance = Unit(MPI.COMM_SELF, "rows").add("rows", ROWS, exports=["total"])
    rows = [np.ones(2), np.arange(3)]  # the latter is copied as doubles
    struct, reference = instance.struct("Rows", count=2, rows=rows), weakref.ref(rows[0])
    total = instance.function("total", struct, Buffer(2))
    assert total(np.array([2.0, 3.0])) == 2.0
    del rows
    assert reference() is not None
    del struct, total
    assert reference() is None


@pytest.mark.parametrize("given", [np.zeros(3), np.zeros(2, dtype=np.float32)], ids=["size", "type"])
def test_functions_refuse_arrays_of_another_size_or_type(given):
    instance = Unit(MPI.COMM_SELF, "rows").add("rows", ROWS, exports=["total"])
    total = instance.function("total", instance.struct("Rows", count=0, rows=[]), Buffer(2))
    with pytest.raises(TypeError, match="rows_total: an array of"):
        total(given)


ZERO = """
int main(void)
{
    double gram[1] = {0}, products[2] = {0}, solution[1] = {0}, y[1] = {1};
    float steps[1] = {0};
    nearest(0, 0, gram, products, 1e-13, gram);
    Guesses one = {.rows = 1, .numbers = 1, .shortest = 1e-13, .gram = gram, .products = products, .solution = solution,
                   .solution_steps = steps};
    const int began = guess(&one, 0, 1, y);
    one.numbers = 0;
    guess(&one, 0, 1, y);
    Mixing none = {.size = 0, .most = 0, .gram = gram, .products = products};
    combine(&none, 0, 0.0, gram, products);
    return !(began && y[0] == 0);
}
"""


def test_kernels_of_initial_guesses_take_arrays_of_length_zero(tmp_path):
    """A rank may own no degree of freedom, and nothing is recorded at first. Oracle: the sanitizer of array bounds."""
    code = "\n".join([source("tank.h").replace("REAL", "double"), source("projection.c"), ZERO])
    (tmp_path / "zero.c").write_text(code)
    compiler = sysconfig.get_config_var("CC").split()
    options = ["-w", "-fsanitize=undefined", "-fsanitize-undefined-trap-on-error", "zero.c", "-lm", "-o", "zero"]
    subprocess.run([*compiler, *options], cwd=tmp_path, check=True)
    assert subprocess.run([tmp_path / "zero"]).returncode == 0


CASES = pytest.mark.parametrize("parts", [SLICE, FLAP, BASIN], ids=["slice", "flap", "basin"])


@CASES
@pytest.mark.parametrize("order", [{}, pytest.param({"vertical_order": 1}, marks=pytest.mark.slow, id="order 1")])
def test_compiler_accepts_kernels_without_a_warning(parts, order, tmp_path, monkeypatch):
    """Oracle: the compiler's front end; warnings of its optimiser depend on the processor."""
    units = []
    monkeypatch.setattr(Unit, "add", lambda unit, *a, add=Unit.add, **k: units.append(unit) or add(unit, *a, **k))
    build_run(case_of(parts | {"numerics": parts["numerics"] | order}), MPI.COMM_SELF)
    options = ["-Wall", "-Wextra", "-Werror", "-Wno-unused-parameter", "-Wno-psabi"]
    for unit in set(units):
        (tmp_path / "tank.c").write_text(unit._code()[1])
        subprocess.run(["gcc", *FLAGS[:-1], *options, "-fsyntax-only", "tank.c"], cwd=tmp_path, check=True)


SANITIZED = """
from wavetank.cli import main
from wavetank.fem.codegen import FLAGS, Unit
checks = ["-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=undefined"]
Unit.__init__.__kwdefaults__["flags"] = [*FLAGS, *checks]
print("exit code", main(["run", "case.toml", "--no-plots", "--out", "run"]))
"""


@pytest.mark.slow
@CASES
def test_kernels_read_and_write_within_their_arrays(parts, tmp_path):
    """Oracle: the address and undefined-behaviour sanitizers."""
    finding = [["gcc", f"-print-file-name={name}"] for name in ("libasan.so", "libubsan.so")]
    libraries = [subprocess.run(one, capture_output=True, text=True, check=True).stdout.strip() for one in finding]
    options = {
        "LD_PRELOAD": ":".join(libraries),
        "ASAN_OPTIONS": "detect_leaks=0:detect_stack_use_after_return=0",  # whose stack is not aligned to vectors
        "PETSC_OPTIONS": "-no_signal_handler",
        "XDG_CACHE_HOME": str(tmp_path),
        "PYTHONPATH": str(CHECKOUT),
    }
    (tmp_path / "case.toml").write_text(toml(parts))
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with begun([sys.executable, "-c", SANITIZED], env={**os.environ, **options}, cwd=tmp_path, **pipes) as process:
        out, err = process.communicate()
    assert "exit code 0" in out and "ERROR" not in err and "runtime error" not in err, err
