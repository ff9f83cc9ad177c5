"""Compiled forms. Each is compiled once, with the fastest flags, and assembled into its own storage.

On forms with many vertical components GCC's -O2 takes a minute, -O3 seconds. -ffast-math halves the time of the kernels
and changes results by round-off.
"""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ffcx
import numpy as np
import ufl
from dolfinx import default_scalar_type, fem, jit, la, mesh
from ffcx.naming import compute_signature
from mpi4py import MPI
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives

from wavetank.base.arrays import Vector, summed
from wavetank.fem.compiled import COMPILER_FLAGS, compiled, loaded

JIT_OPTIONS = {"cffi_extra_compile_args": COMPILER_FLAGS, "cffi_debug": False, "cffi_libraries": None}


def compile_form(form: ufl.Form) -> Any:
    """Return the compiled form; collective."""
    comm = form.ufl_domain().ufl_cargo().comm
    options = _cache_options(form, comm)
    return loaded(comm, lambda: fem.form(form, jit_options=options), options["cache_dir"])


def compile_expression(expression: Any, points: Vector, comm: MPI.Comm) -> fem.Expression:
    """Return the compiled expression at points of the reference cell, shape (N, dimensions); collective."""
    options = _cache_options((expression, points), comm)
    return loaded(comm, lambda: fem.Expression(expression, points, jit_options=options), options["cache_dir"])


def _set_readable_config_home() -> None:
    """Set the folder of settings of FFCx and dolfinx to the current one if the user's home is not accessible."""
    try:
        (Path(os.environ.get("XDG_CONFIG_HOME", "~/.config")).expanduser() / "ffcx").stat()
    except FileNotFoundError:
        pass
    except OSError:
        os.environ["XDG_CONFIG_HOME"] = os.getcwd()


def _cache_options(ufl_object: Any, comm: MPI.Comm) -> dict[str, Any]:
    """Return dolfinx's options to load a form or expression from the cache, compiled if missing; collective."""
    _set_readable_config_home()
    scalar = {"scalar_type": default_scalar_type}

    def build(folder: Path) -> None:
        jit.ffcx_jit(
            MPI.COMM_SELF, ufl_object, form_compiler_options=scalar, jit_options={**JIT_OPTIONS, "cache_dir": folder}
        )

    signature = compute_signature([ufl_object], f"{JIT_OPTIONS} {sorted(ffcx.get_options(scalar).items())}")
    return {**JIT_OPTIONS, "cache_dir": compiled(comm, signature, build=build)}


def derivative_at_zero(f: Callable[[Any], Any], plan_mesh: mesh.Mesh) -> Any:
    """Return the derivative of a density f(x) with respect to a number x at x = 0, in UFL, without zero terms."""
    x = ufl.variable(ufl.Constant(plan_mesh.ufl_domain()))
    derivative = apply_derivatives(apply_algebra_lowering(ufl.diff(apply_algebra_lowering(f(x)), x)))
    return ufl.replace(derivative, {x: ufl.as_ufl(0)})


class ScalarForm:
    """A functional, such as an energy."""

    def __init__(self, form: ufl.Form, comm: MPI.Comm):
        self._form, self._comm = compile_form(form), comm

    def assemble(self) -> float:
        """Return its value, summed over ranks; collective."""
        return summed(self._comm, float(fem.assemble_scalar(self._form)))


class VectorForm:
    """A linear form, such as a derivative of the energy."""

    def __init__(self, form: ufl.Form):
        self._form = compile_form(form)
        space = self._form.function_spaces[0].dofmap
        self._vector = la.vector(space.index_map, space.index_map_bs)
        self._values: Vector = self._vector.array
        self._owned: Vector = self._values[: space.index_map.size_local * space.index_map_bs]
        self._alone = space.index_map.size_local == space.index_map.size_global

    def assemble(self) -> Vector:
        """Return the owned values, shape (owned,); collective. The array is reused by the next call."""
        self._values[:] = 0.0
        fem.assemble_vector(self._values, self._form)
        if not self._alone:
            self._vector.scatter_reverse(la.InsertMode.add)
        return self._owned


def owned_rows(matrix: Any) -> tuple[Vector, Any, Any]:
    """Return values, column indices (local, with ghosts) and row pointers of the owned rows."""
    rows = matrix.index_map(0).size_local
    indptr = matrix.indptr[: rows + 1]
    entries = int(indptr[-1])
    block = int(np.prod(matrix.block_size))
    return matrix.data[: entries * block].reshape(entries, block), matrix.indices[:entries], indptr
