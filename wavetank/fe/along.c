/* Interior potentials along a slice or ring, of wavetank/fe/along.py; layers.c stands before.

MODES, BAND     vertical modes; how far apart coupled rows can be

A chain is a matrix for each vertical mode, LANES modes at once: [row][distance to the column before][group][mode], rows
in the order in which degrees of freedom follow each other. A ring is cut: one of them borders the rest, and is last. */
#include <math.h>
#include <string.h>

#define MODES (NUMBERS - 1)
#define GROUPS ((MODES + LANES - 1) / LANES)
#define ROW (GROUPS * LANES)    /* a degree of freedom's modes, and what fills the last group */

typedef struct {
    int dofs, cut, groups;  /* cut: 1 of a ring, else 0; groups of modes */
    const int *order;       /* [row] degree of freedom */
    const int *row;         /* [degree of freedom] */
    const double *lambda;   /* [group][mode] eigenvalues of the vertical problem */
    double *L;              /* the matrices, then their factors L D L', the reciprocals of D on the diagonal */
    double *column;         /* [row][group][mode] of the border */
    double *reduced;        /* the rest's inverse times it */
    double *corner;         /* [group][mode] of the border; then the reciprocal of what the rest leaves of it */
} Chain;

static void factor(long rows, long stride, stored *restrict A)
{
    for (long i = 0; i < rows; ++i) {
        stored *row = A + i * (BAND + 1) * stride;
        v scaled[BAND + 1] = {zero}, rest = row[0];  /* entries of L D */
        for (int d = i < BAND ? i : BAND; d > 0; --d) {
            const stored *other = A + (i - d) * (BAND + 1) * stride;
            v sum = row[d * stride];
            for (int e = d + 1; e <= BAND && e <= i; ++e)
                sum -= scaled[e] * other[(e - d) * stride];
            scaled[d] = sum;
            row[d * stride] = sum * other[0];
            rest -= sum * row[d * stride];
        }
        EACH(l, LANES)
            ((double *)row)[l] = rest[l] > 0.0 ? 1.0 / rest[l] : NAN;
    }
}

/* x <- the inverse of the rest of b, both [degree of freedom][group][mode], by the rows' order. */
INLINE void forth_and_back(long rows, long stride, const int *restrict order,
                                                                 const stored *restrict L, const stored *b, stored *x)
{
    v last[BAND];
    EACH(d, BAND)
        last[d] = zero;
    for (long i = 0; i < rows; ++i) {
        const stored *row = L + i * (BAND + 1) * stride;
        v here = b[order[i] * stride];
        for (int d = BAND; d > 0; --d)
            here -= row[d * stride] * last[d - 1];
        for (int d = BAND - 1; d > 0; --d)
            last[d] = last[d - 1];
        last[0] = here;
        x[order[i] * stride] = here * row[0];
    }
    EACH(d, BAND)
        last[d] = zero;
    for (long i = rows - 1; i >= 0; --i) {
        v here = x[order[i] * stride];
        for (int d = BAND; d > 0; --d)
            here -= L[((i + d) * (BAND + 1) + d) * stride] * last[d - 1];  /* BAND rows of zeros follow the last one */
        for (int d = BAND - 1; d > 0; --d)
            last[d] = last[d - 1];
        last[0] = x[order[i] * stride] = here;
    }
}

/* x <- the inverse of b, which it may be. */
INLINE void solve_group(const Chain *c, long stride, int group, const double *b, double *x)
{
    const long rows = c->dofs - c->cut;
    const stored *L = (const stored *)c->L + group, *right = (const stored *)b + group;
    stored *left = (stored *)x + group;
    forth_and_back(rows, stride, c->order, L, right, left);
    if (c->cut) {
        const stored *column = (const stored *)c->column + group, *reduced = (const stored *)c->reduced + group;
        const long end = c->order[rows] * stride;
        v last = right[end];
        for (long i = 0; i < rows; ++i)
            last -= column[i * stride] * left[c->order[i] * stride];
        last *= ((const stored *)c->corner)[group];
        for (long i = 0; i < rows; ++i)
            left[c->order[i] * stride] -= reduced[i * stride] * last;
        left[end] = last;
    }
}

static void factorise(Chain *c, int group)
{
    const long rows = c->dofs - c->cut, stride = c->groups;
    const stored *column = (const stored *)c->column + group;
    stored *reduced = (stored *)c->reduced + group, *corner = (stored *)c->corner + group;
    factor(rows, stride, (stored *)c->L + group);
    if (!c->cut)
        return;
    int same[rows];
    EACH(i, rows)
        same[i] = i;
    forth_and_back(rows, stride, same, (const stored *)c->L + group, column, reduced);
    for (long i = 0; i < rows; ++i)
        *corner -= column[i * stride] * reduced[i * stride];
    EACH(l, LANES)
        ((double *)corner)[l] = (*corner)[l] > 0.0 ? 1.0 / (*corner)[l] : NAN;
}

/* Take over the modes of layers that are averaged over the depth. */
static void decouple(const Cells *cells, const double *hessians, Chain *c)
{
    const long rows = c->dofs - c->cut, stride = c->groups;
    memset(c->L, 0, sizeof(v) * rows * (BAND + 1) * stride);
    memset(c->column, 0, sizeof(v) * c->cut * rows * stride);
    memset(c->corner, 0, sizeof(v) * stride);
    EACH(b, cells->batches) {
        v A[NODES][NODES] = {{{0.0}}}, B[NODES][NODES] = {{{0.0}}};
        EACH(q, POINTS) {
            const stored *k = (const stored *)hessians + ((long)b * POINTS + q) * LEVELS * HESSIANS;
            v along = zero, up = zero;
            for (int z = 0; z < LEVELS; ++z, k += HESSIANS)
                along += k[0], up += k[HESSIANS - 1];
            EACH(i, NODES)
                EACH(j, NODES) {
                    A[i][j] += cells->slopes[q * NODES + i] * cells->slopes[q * NODES + j] * along;
                    B[i][j] += cells->values[q * NODES + i] * cells->values[q * NODES + j] * up;
                }
        }
        EACH(i, NODES)
            EACH(j, NODES)
                EACH(l, LANES) {
                    const long row = c->row[cells->dofs[(b * NODES + i) * LANES + l]];
                    const long other = c->row[cells->dofs[(b * NODES + j) * LANES + l]];
                    if (other > row)
                        continue;
                    stored *entry = row < rows     ? (stored *)c->L + (row * (BAND + 1) + row - other) * stride
                                    : other < rows ? (stored *)c->column + other * stride
                                                   : (stored *)c->corner;
                    EACH(group, stride)
                        entry[group] += A[i][j][l] + ((const stored *)c->lambda)[group] * B[i][j][l];
                }
    }
    EACH(group, stride)
        factorise(c, group);
}

/* x <- the inverse of x, [dof][group][mode]. */
static void solve_chain(const Chain *c, double *x)
{
    EACH(group, c->groups)
        solve_group(c, c->groups, group, x, x);
}

static double inner(long size, const double *restrict a, const double *restrict b)
{
    double sum = 0.0;
    for (long i = 0; i < size; ++i)
        sum += a[i] * b[i];
    return sum;
}

/* Conjugate gradients: find the interior part of phi, [dof][number], for its last column, the surface potential, and
   what the wall adds, [dof][number]; flow is the last column of A phi, [dof]. The residual's energy falls below
   tolerance² that of phi. Returns the iterations, -1 after ``most`` of them, -2 where A or the modes are not positive;
   ``steps`` has the length of each and how much of its direction the next keeps. */
static int find_interior(const Cells *cells, const Layers *layers, const double *hessians, const Chain *c,
                         const double *wall, double *restrict phi, double *restrict flow, double tolerance, int most,
                         double *steps, double *work)
{
    const long all = (long)c->dofs * NUMBERS, interior = (long)c->dofs * ROW;
    double *restrict p = work, *restrict Ap = p + all, *restrict r = Ap + all, *restrict z = r + interior;
    memset(work, 0, sizeof(double) * 2 * (all + interior));
    product(cells, layers, hessians, phi, Ap);
    const double kinetic = inner(all, phi, Ap);
    for (long i = 0; i < c->dofs; ++i) {
        flow[i] = Ap[i * NUMBERS + MODES];
        EACH(m, MODES)
            r[i * ROW + m] = -Ap[i * NUMBERS + m] - wall[i * NUMBERS + m];
    }
    double target = tolerance * tolerance * kinetic, before = 0.0;
    for (int iterations = 0; iterations <= most; ++iterations) {
        EACH(group, GROUPS)
            solve_group(c, GROUPS, group, r, z);
        const double rz = inner(interior, r, z), beta = iterations ? rz / before : 0.0;
        if (iterations)
            steps[2 * iterations - 1] = beta;
        else
            target += tolerance * tolerance * rz;
        if (rz < 0.0)
            return -2;
        if (!(rz > target))
            return iterations;
        for (long i = 0; i < c->dofs; ++i)
            EACH(m, MODES)
                p[i * NUMBERS + m] = z[i * ROW + m] + beta * p[i * NUMBERS + m];
        memset(Ap, 0, sizeof(double) * all);
        product(cells, layers, hessians, p, Ap);
        const double bend = inner(all, p, Ap), alpha = rz / bend;
        if (!(bend > 0.0))
            return -2;
        for (long i = 0; i < c->dofs; ++i) {
            flow[i] += alpha * Ap[i * NUMBERS + MODES];
            EACH(m, MODES) {
                phi[i * NUMBERS + m] += alpha * p[i * NUMBERS + m];
                r[i * ROW + m] -= alpha * Ap[i * NUMBERS + m];
            }
        }
        steps[2 * iterations] = alpha, before = rz;
    }
    return -1;
}
