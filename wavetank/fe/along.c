/* Interior potentials along a slice or ring, of wavetank/fe/along.py; layers.c stands before.

MODES, BAND     vertical modes; how far apart coupled rows can be

A chain is a matrix for each vertical mode, LANES modes at once: [group][row][distance to the column before][mode], rows
in the order in which degrees of freedom follow each other. A ring is cut: one of them borders the rest, and is last. */
#define MODES (NUMBERS - 1)
#include <math.h>
#include <string.h>

typedef struct {
    int dofs, cut, groups;  /* cut: 1 of a ring, else 0; groups of modes */
    const int *order;       /* [row] degree of freedom */
    const int *row;         /* [degree of freedom] */
    const double *lambda;   /* [mode] eigenvalues of the vertical problem */
    double *L;              /* the matrices, then their factors, the diagonal's reciprocals on the diagonal */
    double *column;         /* [group][row][mode] of the border */
    double *reduced;        /* the rest's inverse times it */
    double *corner;         /* [mode] of the border; then the reciprocal of what the rest leaves of it */
    double *work;           /* [row][mode of a group] */
} Chain;

static void factor(int rows, double *restrict A)
{
    for (int i = 0; i < rows; ++i) {
        double *row = A + (long)i * (BAND + 1) * LANES;
        for (int d = i < BAND ? i : BAND; d >= 0; --d) {
            const double *other = A + (long)(i - d) * (BAND + 1) * LANES;
            for (int e = d + 1; e <= BAND && e <= i; ++e)
                for (int m = 0; m < LANES; ++m)
                    row[d * LANES + m] -= row[e * LANES + m] * other[(e - d) * LANES + m];
            for (int m = 0; m < LANES; ++m)
                row[d * LANES + m] = d ? row[d * LANES + m] * other[m] : 1.0 / sqrt(row[m]);
        }
    }
}

static void forth_and_back(int rows, const double *restrict L, double *restrict x)
{
    for (int i = 0; i < rows; ++i) {
        const double *row = L + (long)i * (BAND + 1) * LANES;
        double *here = x + (long)i * LANES;
        for (int d = i < BAND ? i : BAND; d > 0; --d)
            for (int m = 0; m < LANES; ++m)
                here[m] -= row[d * LANES + m] * here[m - d * LANES];
        for (int m = 0; m < LANES; ++m)
            here[m] *= row[m];
    }
    for (int i = rows - 1; i >= 0; --i) {
        const double *row = L + (long)i * (BAND + 1) * LANES;
        double *here = x + (long)i * LANES;
        for (int m = 0; m < LANES; ++m)
            here[m] *= row[m];
        for (int d = 1; d <= BAND && d <= i; ++d)
            for (int m = 0; m < LANES; ++m)
                here[m - d * LANES] -= row[d * LANES + m] * here[m];
    }
}

static void factorise(Chain *c, int group)
{
    const long rows = c->dofs - c->cut;
    double *L = c->L + group * rows * (BAND + 1) * LANES, *corner = c->corner + group * LANES;
    double *column = c->column + group * rows * LANES, *reduced = c->reduced + group * rows * LANES;
    factor(rows, L);
    if (!c->cut)
        return;
    memcpy(reduced, column, sizeof(double) * rows * LANES);
    forth_and_back(rows, L, reduced);
    for (long i = 0; i < rows; ++i)
        for (int m = 0; m < LANES; ++m)
            corner[m] -= column[i * LANES + m] * reduced[i * LANES + m];
    for (int m = 0; m < LANES; ++m)
        corner[m] = 1.0 / corner[m];
}

/* x <- the inverse of x, [row][mode of a group]. */
static void solve(const Chain *c, int group, double *x)
{
    const long rows = c->dofs - c->cut;
    const double *L = c->L + group * rows * (BAND + 1) * LANES, *corner = c->corner + group * LANES;
    const double *column = c->column + group * rows * LANES, *reduced = c->reduced + group * rows * LANES;
    if (c->cut) {
        double *last = x + rows * LANES;
        for (long i = 0; i < rows; ++i)
            for (int m = 0; m < LANES; ++m)
                last[m] -= reduced[i * LANES + m] * x[i * LANES + m];
        for (int m = 0; m < LANES; ++m)
            last[m] *= corner[m];
        for (long i = 0; i < rows; ++i)
            for (int m = 0; m < LANES; ++m)
                x[i * LANES + m] -= column[i * LANES + m] * last[m];
    }
    forth_and_back(rows, L, x);
}

/* Take over the modes of layers that are averaged over the depth. */
static void decouple(const Cells *cells, const double *hessians, Chain *c)
{
    const long rows = c->dofs - c->cut, all = c->groups * LANES;
    memset(c->L, 0, sizeof(double) * rows * (BAND + 1) * all);
    memset(c->column, 0, sizeof(double) * c->cut * rows * all);
    memset(c->corner, 0, sizeof(double) * all);
    for (int b = 0; b < cells->batches; ++b) {
        v A[NODES][NODES] = {{{0.0}}}, B[NODES][NODES] = {{{0.0}}};
        for (int q = 0; q < POINTS; ++q) {
            const stored *k = (const stored *)hessians + ((long)b * POINTS + q) * LEVELS * HESSIANS;
            v along = zero, up = zero;
            for (int z = 0; z < LEVELS; ++z, k += HESSIANS)
                along += k[0], up += k[HESSIANS - 1];
            for (int i = 0; i < NODES; ++i)
                for (int j = 0; j < NODES; ++j) {
                    A[i][j] += cells->slopes[q * NODES + i] * cells->slopes[q * NODES + j] * along;
                    B[i][j] += cells->values[q * NODES + i] * cells->values[q * NODES + j] * up;
                }
        }
        for (int i = 0; i < NODES; ++i)
            for (int j = 0; j < NODES; ++j)
                for (int l = 0; l < LANES; ++l) {
                    const int row = c->row[cells->dofs[(b * NODES + i) * LANES + l]];
                    const int other = c->row[cells->dofs[(b * NODES + j) * LANES + l]];
                    if (other > row)
                        continue;
                    for (int group = 0; group < c->groups; ++group) {
                        double *entry = row < rows ? c->L + ((group * rows + row) * (BAND + 1) + row - other) * LANES
                                        : other < rows ? c->column + (group * rows + other) * LANES
                                                       : c->corner + group * LANES;
                        const double *lambda = c->lambda + group * LANES;
                        for (int m = 0; m < LANES; ++m)
                            entry[m] += ((double *)&A[i][j])[l] + lambda[m] * ((double *)&B[i][j])[l];
                    }
                }
    }
    for (int group = 0; group < c->groups; ++group)
        factorise(c, group);
}

static double inner(long size, const double *a, const double *b)
{
    double sum = 0.0;
    for (long i = 0; i < size; ++i)
        sum += a[i] * b[i];
    return sum;
}

/* z = the modes' inverse of r, both [dof][mode]; z may be r. */
static void precondition(const Chain *c, int modes, const double *r, double *z)
{
    for (int group = 0; group < c->groups; ++group) {
        const int first = group * LANES, few = modes - first < LANES ? modes - first : LANES;
        memset(c->work, 0, sizeof(double) * c->dofs * LANES);
        for (long i = 0; i < c->dofs; ++i)
            memcpy(c->work + i * LANES, r + (long)c->order[i] * modes + first, sizeof(double) * few);
        solve(c, group, c->work);
        for (long i = 0; i < c->dofs; ++i)
            memcpy(z + (long)c->order[i] * modes + first, c->work + i * LANES, sizeof(double) * few);
    }
}

/* Conjugate gradients: find the interior part of phi, [dof][number], for its last column, the surface potential, and
   what the wall adds, [dof][number]; flow is the last column of A phi, [dof]. The residual's energy falls below
   tolerance² that of phi. Returns the iterations, -1 after ``most`` of them, -2 where A or the modes are not positive; ``steps`` has the length of each and how
   much of its direction the next keeps. */
static int find_interior(const Cells *cells, const Layers *layers, const double *hessians, const Chain *c, const double *wall, double *phi,
                  double *flow, double tolerance, int most, double *steps, double *work)
{
    const long all = (long)c->dofs * NUMBERS, interior = (long)c->dofs * MODES;
    double *p = work, *Ap = p + all, *r = Ap + all, *z = r + interior;
    memset(Ap, 0, sizeof(double) * all);
    product(cells, layers, hessians, phi, Ap);
    const double kinetic = inner(all, phi, Ap);
    for (long i = 0; i < c->dofs; ++i) {
        flow[i] = Ap[i * NUMBERS + MODES];
        for (int m = 0; m < MODES; ++m)
            r[i * MODES + m] = -Ap[i * NUMBERS + m] - wall[i * NUMBERS + m];
    }
    precondition(c, MODES, r, z);
    double rz = inner(interior, r, z), beta = 0.0;
    const double target = tolerance * tolerance * (kinetic + rz);
    memset(p, 0, sizeof(double) * all);
    for (int iterations = 0; iterations <= most; ++iterations) {
        if (rz < 0.0)
            return -2;
        if (!(rz > target))
            return iterations;
        for (long i = 0; i < c->dofs; ++i)
            for (int m = 0; m < MODES; ++m)
                p[i * NUMBERS + m] = z[i * MODES + m] + beta * p[i * NUMBERS + m];
        memset(Ap, 0, sizeof(double) * all);
        product(cells, layers, hessians, p, Ap);
        const double bend = inner(all, p, Ap), alpha = rz / bend;
        if (!(bend > 0.0))
            return -2;
        for (long i = 0; i < c->dofs; ++i) {
            flow[i] += alpha * Ap[i * NUMBERS + MODES];
            for (int m = 0; m < MODES; ++m) {
                phi[i * NUMBERS + m] += alpha * p[i * NUMBERS + m];
                r[i * MODES + m] -= alpha * Ap[i * NUMBERS + m];
            }
        }
        precondition(c, MODES, r, z);
        const double before = rz;
        rz = inner(interior, r, z);
        beta = rz / before;
        steps[2 * iterations] = alpha, steps[2 * iterations + 1] = beta;
    }
    return -1;
}
