"""The operator without matrices against the energy as dolfinx integrates it, on every kind of mesh and many ranks."""

import numpy as np
import pytest
import scipy.sparse as sparse
import ufl
from mpi4py import MPI
from test_basin import basin, bowed

from wavetank.base.errors import ConvergenceError
from wavetank.fem.decoupled import LayerMatrices
from wavetank.fem.forms import ScalarForm, VectorForm
from wavetank.fem.halo import Halo
from wavetank.fem.plane import Plane
from wavetank.tank.footprint import Ring
from wavetank.tank.walls import Wall
from wavetank.tank.waves import NonlinearWaves


def hilly(x, y):
    """Return a depth that varies along and across."""
    return 0.5 + 0.05 * np.sin(2.0 * x) * np.cos(1.5 * y)


def ring(order, n):
    """Return waves in a ring, whose mesh has one dimension in a plane of two."""
    footprint = Ring(3.0, 11, comm=MPI.COMM_WORLD)
    plane = Plane(footprint.mesh, order, footprint.chart)
    depth = lambda x, y: 0.5 + 0.05 * np.cos(2 * np.pi * x / 3.0)  # noqa: E731
    return NonlinearWaves(plane, depth=depth, wall=Wall(), vertical_order=n)


FEW = "few layers, many fields"
WATERS = {
    "ring": lambda: ring(3, 4),
    "quadrilaterals": lambda: basin(2.0, 0.6, (5, 3), order=3, n=4, motion=bowed(), depth=hilly, angle=0.3),
    FEW: lambda: basin(2.0, 0.6, (5, 3), order=2, n=1, motion=bowed(), depth=hilly),
    "triangles": lambda: basin(2.0, 0.6, (3, 2), kind="triangles", order=3, n=4, motion=bowed(), depth=hilly),
}
STILL = {
    "still quadrilaterals": lambda: basin(2.0, 0.6, (5, 3), order=3, n=4, angle=0.3),
    "still triangles": lambda: basin(2.0, 0.6, (3, 2), kind="triangles", order=3, n=4),
}


def moved(name):
    """Return waves with their wall and surface somewhere, and potentials, a smooth one and one like no other."""
    waves = (WATERS | STILL)[name]()
    x, y = waves.plane.places.T
    waves.set_time(0.7)
    waves.h.set(waves.bed.still + 0.06 * np.cos(3.0 * x + y))
    waves.operator.update()
    modes = np.arange(waves.vertical.n + 1)
    return waves, [np.sin(np.outer(x, 1 + modes) - y[:, None]), np.cos(1e4 * np.outer(1 + x + 2 * y, 1 + modes))]


def differences(name):
    """Return how far A x and the derivative by the column are from what dolfinx makes of K + V; collective."""
    waves, potentials = moved(name)
    phi, comm, n = waves.phi, waves.plane.comm, waves.vertical.n
    kinetic = waves.densities.kinetic(phi.function, waves.vertical) * waves.plane.dx
    both = kinetic + waves.densities.potential() * waves.plane.dx
    by_phi, by_h = (VectorForm(ufl.derivative(both, by)) for by in (phi.function, waves.h.function))
    energy, found = ScalarForm(kinetic, comm), []

    def apart(ours, theirs):
        most = comm.allreduce(float(np.abs(theirs).max(initial=0.0)), op=MPI.MAX)
        return comm.allreduce(float(np.abs(ours - theirs).max(initial=0.0)), op=MPI.MAX) / most

    for x in potentials:
        phi.owned[:] = x
        phi.function.x.scatter_forward()
        A_x = by_phi.assemble().reshape(-1, n + 1)
        found += [apart(waves.operator.apply(x), A_x), apart(waves.operator.derivative(x), by_h.assemble())]
        total = energy.assemble()
        found.append(abs(0.5 * waves.plane.sum(x * waves.operator.apply(x)) / total - 1))
    return found


def averaged(name):
    """Return how far products and diagonals of still water's decoupled modes are from those of matrices; collective."""
    waves, (x, _) = moved(name)
    waves.h.set(waves.bed.still)
    plane, layer, matrices = waves.plane, waves.layer, LayerMatrices(waves.densities.layer, waves.plane)
    eigenvalues, means = 1.0 + np.arange(x.shape[1], dtype=float), layer.assemble()
    S_u, S_w = (
        sparse.csr_matrix((entries, matrices.columns, matrices.row_pointers)) for entries in matrices.assemble()
    )
    reached = Halo(matrices.numbering, x.shape[1]).fetch(x)
    whole, found = S_u @ reached + (S_w @ reached) * eigenvalues, []
    for many in (x.shape[1] - 1, x.shape[1]):
        modes = layer.modes(eigenvalues[:many])
        modes.take(means)
        product = modes.product(x[:, :many].astype(np.float32))
        found.append(np.abs(product - whole[:, :many]).max(initial=0.0) / np.abs(whole).max(initial=1.0))
        diagonals = np.column_stack([S_u.diagonal(), S_w.diagonal()])[: plane.owned]
        found.append(np.abs(modes.diagonals / diagonals - 1).max(initial=0.0))
    return found


@pytest.mark.parametrize("name", ["still quadrilaterals", "still triangles"])
def test_decoupled_modes_of_still_water_are_those_of_its_matrices(name):
    """In single precision; over a flat bed, where their quadrature is exact."""
    assert max(averaged(name)) < 5e-6


@pytest.mark.parametrize("name", [pytest.param(one, marks=[pytest.mark.slow] * (one == FEW)) for one in WATERS])
def test_products_and_derivative_are_those_of_the_energy(name):
    assert max(differences(name)) < 1e-12


@pytest.mark.parametrize("name", ["quadrilaterals", pytest.param("triangles", marks=pytest.mark.slow)])
def test_three_ranks_have_the_same(on_ranks, name):
    assert max(max(found) for found in on_ranks(differences, name)) < 1e-12
    assert max(max(found) for found in on_ranks(averaged, f"still {name}")) < 5e-6


@pytest.mark.parametrize("inside", [0.01, 0.045])
def test_a_column_that_is_negative_between_its_nodes_has_no_minimum(inside):
    """At the inner two of four points it is inside - 0.1055 (0.5 - inside), of a cubic through 0.5 m at both ends."""
    waves = ring(3, 4)
    column = np.full(waves.plane.owned, 0.5)
    column[waves.plane.V.dofmap.list[:, 2:]] = inside
    with pytest.raises(ConvergenceError, match="not positive everywhere"):
        waves.evaluate(waves.mass.apply(column), np.cos(waves.plane.x), 0.0)
