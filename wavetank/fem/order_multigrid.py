"""A multigrid cycle in the order p for the decoupled modes of a basin (``decoupled.py``).

Chebyshev-Jacobi smoothing at order p is matrix-free (``modes.c``). The coarse problem has elements of order 1; a cycle
of algebraic multigrid solves it. The cycle is a preconditioner of conjugate gradients. Therefore it is in single
precision, and its quadrature is exact only for coefficients that are constant in each cell.
"""

from collections.abc import Iterator

import numpy as np
from dolfinx.fem.petsc import interpolation_matrix
from numpy.typing import NDArray

from wavetank.base.arrays import Vector, summed
from wavetank.fem.cells import Cells
from wavetank.fem.codegen import Buffer, Unit, source
from wavetank.fem.conjugate_gradients import dot
from wavetank.fem.decoupled import LEVELS, Averages, LayerMatrices, Modes
from wavetank.fem.halo import Halo
from wavetank.fem.layers import Array, LayerDensity, LayerEnergy
from wavetank.fem.plane import Plane

Singles = NDArray[np.float32]

FEW = 4  # modes in one loop
NOTHING, NONE = 1e-30, 1e-3  # of single precision; of the largest eigenvalue: as small is as bad
LEAVES = 0.12  # of an error: what a cycle of multigrid does, and smoothing alone has to where it is all that is done
FUNCTIONS = "average", "multiply", "smooth", "transfer"


class LayerMeans:
    """The averages of a basin's layer at quadrature points, and its matrices on elements of order 1.

    Parameters
    ----------
    energy, density
        e(u, w, zeta), in UFL, and its density at a point.
    vertical_order
        n; the number of modes is n or n + 1.
    """

    def __init__(
        self,
        energy: LayerEnergy,
        density: LayerDensity,
        plane: Plane,
        *,
        vertical_order: int,
        unit: Unit | None = None,
    ):
        self.plane, self._density = plane, density
        self.linear = LayerMatrices(energy, Plane(plane.mesh, 1))
        cells = Cells(plane, 2 * plane.order + 1, real="float")
        sizes = {
            **cells.sizes,
            **density.sizes,
            "NUMBERS": vertical_order + 1,
            "LEVELS": len(LEVELS),
            "MOST": max(FEW, density.fields),
            "FEW": FEW,
            "NOTHING": f"{NOTHING}f",
        }
        self.instance = (unit or Unit(plane.comm)).add(
            "modes",
            source("cells.c") + source("layers.c", "layer") + source("modes.c", "average", "basin"),
            exports=FUNCTIONS,
            sizes=sizes,
            real="float",
            density=density,
            made={"HESSIAN": density.second},
        )
        self._cell_values, self.halo = cells, cells.halo
        self.cells = self.instance.struct("Cells", **cells.parts)
        self._constants = density.constants().astype(np.float32)
        levels = {"zeta": np.array(LEVELS), "weights": np.full(len(LEVELS), 1 / len(LEVELS))}
        layers = self.instance.struct("Layers", **levels, constants=self._constants)
        self._shape = cells.parts["batches"], len(cells.points), density.sizes["MEANS"], cells.lanes
        self.averages_size = int(np.prod(self._shape))
        fields, averages = Buffer(density.rows().size, np.float32), Buffer(self.averages_size, np.float32)
        self._average = self.instance.function("average", self.cells, layers, fields, averages)
        self._two = self.halo(2, np.float32)
        numbering = plane.V.dofmap.index_map
        self._work = np.zeros((2, (numbering.size_local + numbering.num_ghosts) * (vertical_order + 1)), np.float32)

    def assemble(self) -> "Means":
        """Return the second derivatives with respect to u and w, averaged over the depth, at points and as matrices."""
        self._constants[:] = self._density.constants()
        averages = np.empty(self._shape, dtype=np.float32)
        self._average(self._density.rows().astype(np.float32), averages)
        return averages, self.linear.assemble()

    def diagonals(self, averages: Singles) -> Singles:
        """Return the diagonals of S_u and S_w, shape (owned, 2); collective."""
        cells, last = self._cell_values, averages.shape[2] - 1
        parts = [cells.diagonal(averages[:, :, k], cells.squares[k]) for k in (slice(last), slice(last, None))]
        return np.asarray(self._two.collect(np.stack(parts, axis=1).astype(np.float32)))

    def modes(self, eigenvalues: Vector) -> "OrderMultigrid":
        """Return the decoupled problems of some modes; see ``LayerMatrices``."""
        return OrderMultigrid(self, eigenvalues)

    def work(self, rows: int, modes: int) -> Iterator[Singles]:
        """Yield two arrays of that shape for whoever is at work, the same for all."""
        return (one[: rows * modes].reshape(rows, modes) for one in self._work)


Means = tuple[Singles, Averages]  # at the points, and on elements of order 1


class OrderMultigrid(Modes):
    """The decoupled problems of some modes; see ``Modes``.

    High modes are similar to mass matrices. The smoother reduces errors of all their eigenvalues, so that they need no
    coarse problem.

    Attributes
    ----------
    steps
        Smoothing steps before and after the coarse problem.
    spread
        Ratio of the largest to the smallest eigenvalue that is smoothed; elements of order 1 represent the others.
    low
        Number of modes with a coarse problem.
    diagonals
        Diagonals of S_u and S_w, shape (owned, 2).
    """

    lanczos = 10  # steps; the error of the largest eigenvalue is a few per cent
    margin = 1.1  # over what they see, and below

    def __init__(self, layer: LayerMeans, eigenvalues: Vector):
        self._layer, self._eigenvalues, p = layer, eigenvalues.astype(np.float32), layer.plane.order
        self.steps, self.spread, self.low = max(2, (p + 1) // 2), max(8.0, p**2 / 2), eigenvalues.size
        self._halo = layer.halo(eigenvalues.size, np.float32)
        self._image, direction = layer.work(self._halo.size, eigenvalues.size)
        self._direction = direction[: layer.plane.owned]
        self._of_low = dict[int, LinearModes]()
        function, owned, modes = layer.instance.function, layer.plane.owned, self._eigenvalues
        layered, rows = (Buffer(count * modes.size, np.float32) for count in (self._halo.size, owned))
        averages = Buffer(layer.averages_size, np.float32)
        self._multiply = function("multiply", layer.cells, averages, modes, int, modes.size, layered, layered)
        self.diagonals = np.empty((owned, 2), dtype=np.float32)
        self._lengths = np.empty((2 * self.steps + 1, 2, modes.size), dtype=np.float32)  # see ``_chebyshev``
        self._smoothers = [
            function(
                "smooth", owned, self.diagonals, modes, *lengths, modes.size, self._image, rows, self._direction, rows
            )
            for lengths in self._lengths
        ]

    def take(self, averages: Means) -> None:
        """Set S_u and S_w; see ``Modes``."""
        self._averages, linear = averages
        self.diagonals[:] = self._layer.diagonals(self._averages)
        smallest, largest = self._ends_of_spectra()
        tops = self.margin * largest
        bottoms = np.maximum(smallest / self.margin, NONE * tops)
        reduction = 1 / np.cosh((self.steps + 1) * np.arccosh((tops + bottoms) / (tops - bottoms)))
        self.low = low = 1 + max(map(int, np.flatnonzero(reduction > LEAVES)), default=0)
        if low not in self._of_low:
            self._of_low[low] = LinearModes(
                self._layer, self._eigenvalues[:low].astype(np.float64), modes=self._eigenvalues.size
            )
        self._of_low[low].take(linear)
        tops[:low] = tops.max()
        bottoms[:low] = tops.max() / self.spread
        before = _chebyshev(bottoms, tops, self.steps + 1)
        after = before[:-1].copy()
        before[-1, :, :low] = after[:, :, low:] = 0.0  # only the residual changes there
        self._lengths[:] = *before, *after

    def _ends_of_spectra(self) -> tuple[Vector, Vector]:
        """Return the extreme eigenvalues of each mode with the Jacobi preconditioner, by Lanczos; collective."""
        of_u, of_w = self.diagonals.T
        scale, modes = (of_u[:, None] + of_w[:, None] * self._eigenvalues) ** -0.5, self._eigenvalues.size

        def inner(a: Vector, b: Vector) -> Vector:
            return summed(self._layer.plane.comm, np.asarray((a * b).sum(axis=0), dtype=np.float64))

        v = np.repeat(np.sin(1e5 * self._layer.plane.coordinates() @ [1.0, np.sqrt(2.0), 0.0])[:, None], modes, axis=1)
        v, before = (v / np.sqrt(inner(v, v))).astype(np.float32), np.zeros(v.shape, dtype=np.float32)
        beta: Vector = np.zeros(modes)
        projected = np.zeros((modes, self.lanczos, self.lanczos))
        for k in range(self.lanczos):
            w = scale * self.product(scale * v) - beta.astype(np.float32) * before
            projected[:, k, k] = alpha = inner(w, v)
            w -= alpha.astype(np.float32) * v
            before, beta = v, np.sqrt(inner(w, w))
            if k + 1 == self.lanczos or beta.min() < 1e-4:  # the Krylov space of a mesh of few cells is exhausted
                break
            projected[:, k, k + 1] = projected[:, k + 1, k] = beta
            v = w / beta.astype(np.float32)
        values = np.asarray(np.linalg.eigvalsh(projected[:, : k + 1, : k + 1]), dtype=np.float64)
        return values[:, 0], values[:, -1]

    def product(self, x: Singles, *, many: int | None = None) -> Singles:
        """Return (S_u + Lambda_j S_w) x_j in single precision, shape (owned, m); collective.

        ``many`` limits it to the first modes. The array is reused by the next call.
        """
        self._image.fill(0.0)
        many = self._eigenvalues.size if many is None else many
        self._multiply.call(self._averages, many, self._halo.fetch(x), self._image)
        return self._halo.collect(self._image)

    def _cycle(self, r: Singles) -> Singles:
        """Return the result of a cycle for a residual, which is overwritten; collective.

        A step of the Chebyshev semi-iteration (Saad, Iterative Methods for Sparse Linear Systems, 2003, algorithm 12.1)
        subtracts the product with the last change of x from r, and changes x by ``_direction``.
        """
        x, change = np.zeros_like(r), self._direction
        change.fill(0.0)
        self._image.fill(0.0)
        for smooth in self._smoothers[: self.steps]:
            smooth.call(r, x)
            self.product(change)
        self._smoothers[self.steps].call(r, x)
        change = self._of_low[self.low].correction(r)
        x += change
        for smooth in self._smoothers[self.steps + 1 :]:
            self.product(change, many=self.low)
            smooth.call(r, x)
            change = self._direction
        return x

    def solve(self, right: Array, *, cycles: int = 1) -> Array:
        """Return a for r; see ``Modes``. Several cycles are combined by conjugate gradients."""
        r: Singles = right.astype(np.float32)
        if cycles == 1:
            return self._cycle(r)
        x, p = np.zeros_like(r), np.zeros_like(r)
        before = np.inf
        for _ in range(cycles):
            z = self._cycle(r.copy())
            energy = self._inner(r, z)
            if not energy > 0.0:
                break
            p *= energy / before
            p += z
            image = self.product(p)
            length = np.float32(energy / self._inner(p, image))
            x += length * p
            r -= length * image
            before = energy
        return x

    def _inner(self, a: Singles, b: Singles) -> float:
        return summed(self._layer.plane.comm, dot(a, b))


class LinearModes:
    """The problems of some modes on elements of order 1, with one cycle of algebraic multigrid.

    PETSc's objects are created once: on several ranks, objects that Python releases exist until all ranks collect them.
    """

    def __init__(self, layer: LayerMeans, eigenvalues: Vector, *, modes: int):
        linear, fine = layer.linear, layer.plane
        numbering = linear.plane.V.dofmap.index_map
        interpolation = interpolation_matrix(linear.plane.V, fine.V)
        interpolation.assemble()
        pointers, columns, weights = interpolation.getValuesCSR()
        here = numbering.global_to_local(columns.astype(np.int64))
        self._halo, self._many = Halo(numbering, eigenvalues.size, np.float32, reached=here), eigenvalues.size
        rows, few = fine.owned, eigenvalues.size
        interpolation = rows, pointers.astype(np.int32), here.astype(np.int32), weights.astype(np.float32), few, modes
        all_of_fine, coarse = Buffer(rows * modes, np.float32), Buffer(self._halo.size * few, np.float32)
        self._interpolate, self._restrict = (
            layer.instance.function("transfer", to_fine, *interpolation, all_of_fine, coarse) for to_fine in (1, 0)
        )
        self._modes = linear.modes(eigenvalues)

    def take(self, averages: Averages) -> None:
        """Set S_u and S_w on elements of order 1; collective."""
        self._modes.take(averages)

    def correction(self, residual: Singles) -> Singles:
        """Return the correction for a residual, both (owned, m), zero without a coarse problem; collective."""
        right, fine = np.zeros((self._halo.size, self._many), dtype=np.float32), np.zeros_like(residual)
        self._restrict(residual, right)
        coarse = self._halo.fetch(self._modes.solve(self._halo.collect(right)).astype(np.float32))
        self._interpolate(fine, coarse)
        return fine


def _chebyshev(bottoms: Vector, tops: Vector, steps: int) -> Singles:
    """Return the coefficients of directions and residuals in each step, (steps, 2, modes), for given spectra."""
    centre, radius = (tops + bottoms) / 2, (tops - bottoms) / 2
    lengths, ratio = [(0 * centre, 1 / centre)], radius / centre
    for _ in range(steps - 1):
        after = 1 / (2 * centre / radius - ratio)
        lengths.append((after * ratio, 2 * after / radius))
        ratio = after
    return np.array(lengths, dtype=np.float32)
