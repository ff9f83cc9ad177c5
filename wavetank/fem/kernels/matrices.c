/* ==== mass ==== */
/* A matrix-free mass matrix, of wavetank/fem/mass.py; follows cells.c.

FIELDS          fields of its density */
#define OF_FIELDS ((1 + GDIM) * FIELDS)

typedef struct {
    const double *constants;
    stored *weights;
} Weights;

INLINE void weigh_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    const Weights *weights = what;
    UNUSED const double *constants = weights->constants;
    v f[OF_FIELDS + 1], density;
    in_space(c, b, q, FIELDS, u, FIELDS, f);
    DENSITY
    weights->weights[b * POINTS + q] = measure_at(c, b, q) * density;
}

/* Set the weights from the fields: density at the points times quadrature weights. */
SHARED void weigh(const Mass *m)
{
    const Weights what = {m->constants, (stored *)m->weights};
    interlace(FIELDS, m->dofs, m->fields, m->rows);
    over_cells(m->cells, DIM, (Given){m->rows, FIELDS, FIELDS}, (Given){0}, 0, NULL, 0, weigh_at, &what);
}

INLINE void multiply_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    r[0] = ((const stored *)what)[b * POINTS + q] * u[0];
}

/* y += M x. */
SHARED void multiply(const Mass *m, const double *x, double *y)
{
    over_cells(m->cells, 0, (Given){x, 1, 1}, (Given){0}, 1, y, 1, multiply_at, m->weights);
}

/* Solve M x = b by conjugate gradients from x = 0. The preconditioner is the product with ``cells`` between products with the
   diagonal ``inverse``. Iterations end if the residual's energy is ``within``² times the first. Returns the iterations, or -1
   without convergence. */
SHARED int solve_by_cells(const Mass *m, const Mass *cells, const double *restrict inverse, const double *b, double within,
                          int most, double *restrict x, double *work)
{
    const long n = m->dofs;
    double *restrict r = work, *restrict z = r + n, *restrict p = z + n, *restrict image = p + n;
    double energy = 0.0, target = 0.0;
    memset(x, 0, sizeof(double) * n);
    memset(p, 0, sizeof(double) * n);
    memcpy(r, b, sizeof(double) * n);
    for (int k = 0;; ++k) {
        const double before = energy;
        double bend = 0.0;
        EACH(i, n)
            image[i] = r[i] * inverse[i], z[i] = 0.0;
        multiply(cells, image, z);
        energy = 0.0;
        EACH(i, n)
            z[i] *= inverse[i], energy += r[i] * z[i];
        target = k ? target : within * within * energy;
        if (fabs(energy) <= target)
            return k;
        if (k == most || !(energy > 0.0))
            return -1;
        EACH(i, n)
            p[i] = z[i] + (k ? energy / before : 0.0) * p[i], image[i] = 0.0;
        multiply(m, p, image);
        EACH(i, n)
            bend += p[i] * image[i];
        EACH(i, n)
            x[i] += energy / bend * p[i], r[i] -= energy / bend * image[i];
    }
}

/* The integral of the density. */
SHARED double total(const Mass *m)
{
    v sum = zero;
    double result = 0.0;
    weigh(m);
    EACH(k, m->cells->batches * POINTS)
        sum += ((const stored *)m->weights)[k];
    EACH(l, LANES)
        result += sum[l];
    return result;
}

/* ==== banded ==== */
/* Symmetric banded systems along a slice or ring, ABREAST systems in one vector; follows cells.c.

BAND            largest distance of coupled rows
ABREAST         systems in a vector
GROUPS          number of such vectors */

/* Order of operations: a row waits for its neighbour only in the last product. A single system subtracts the products in
   sequence, that of the farthest row first. */
#if __has_builtin(__builtin_assoc_barrier)
#define FIRST __builtin_assoc_barrier
#else
#define FIRST
#endif

#if ABREAST == 1
typedef REAL abreast;
#else
typedef REAL abreast __attribute__((vector_size(sizeof(REAL) * ABREAST), aligned(sizeof(REAL))));
#endif

INLINE abreast reciprocal(abreast of)
{
    EACH(l, ABREAST) {
        REAL *one = (REAL *)&of + l;
        *one = *one > 0.0 ? 1.0 / *one : NAN;
    }
    return of;
}

/* A <- its factors, for a group; rows before ``first`` are factorised already. */
SHARED void factor_rows(long first, long rows, abreast *restrict A)
{
    for (long i = first; i < rows; ++i) {
        abreast *row = A + i * (BAND + 1) * GROUPS;
        abreast scaled[BAND + 1] = {0}, rest = row[0];  /* entries of L D */
        for (int d = i < BAND ? i : BAND; d > 0; --d) {
            const abreast *other = A + (i - d) * (BAND + 1) * GROUPS;
            abreast sum = row[d * GROUPS];
            for (int e = d + 1; e <= BAND && e <= i; ++e)
                sum -= scaled[e] * other[(e - d) * GROUPS];
            scaled[d] = sum;
            row[d * GROUPS] = sum * other[0];
            rest -= sum * row[d * GROUPS];
        }
        row[0] = reciprocal(rest);
    }
}

/* A row minus the products with the preceding rows ``last`` (following ones with stride -1); it becomes the last. */
INLINE abreast eliminate(abreast here, const abreast *entry, int stride, abreast (*last)[GROUPS], int g)
{
    for (int d = BAND; d > 0; --d)
        here = (ABREAST == 1 || d == 1 ? FIRST(here) : here) - entry[d * stride] * last[d - 1][g];
    for (int d = BAND - 1; d > 0; --d)
        last[d][g] = last[d - 1][g];
    return last[0][g] = here;
}

/* x <- the inverse of the band times b, both [row][group]. */
INLINE void forth_and_back(long rows, const abreast *restrict L, const abreast *b, abreast *x)
{
    const int width = (BAND + 1) * GROUPS;
    abreast last[BAND][GROUPS] = {0};
    for (long i = 0; i < rows; ++i)
        EACH(g, GROUPS)
            x[i * GROUPS + g] = eliminate(b[i * GROUPS + g], L + i * width + g, GROUPS, last, g) * L[i * width + g];
    memset(last, 0, sizeof last);
    for (long i = rows - 1; i >= 0; --i)  /* BAND rows of zeros follow the last one */
        EACH(g, GROUPS)
            x[i * GROUPS + g] = eliminate(x[i * GROUPS + g], L + i * width + g, width + GROUPS, last, g);
}

/* x <- A^-1 b, both [row][group]; x may be b. */
INLINE void solve_chain(const Chain *c, const abreast *b, abreast *x)
{
    const long rows = c->dofs - c->cut;
    abreast border[GROUPS];
    EACH(g, GROUPS)
        border[g] = c->cut ? b[rows * GROUPS + g] : (abreast){0.0};
    forth_and_back(rows, (const abreast *)c->L, b, x);
    if (c->cut)
        EACH(g, GROUPS) {
            const abreast *column = (const abreast *)c->column + g, *reduced = (const abreast *)c->reduced + g;
            abreast last = border[g];
            for (long i = 0; i < rows; ++i)
                last -= column[i * GROUPS] * x[i * GROUPS + g];
            last *= ((const abreast *)c->corner)[g];
            for (long i = 0; i < rows; ++i)
                x[i * GROUPS + g] -= reduced[i * GROUPS] * last;
            x[rows * GROUPS + g] = last;
        }
}

SHARED void factorise(const Chain *c, long first)
{
    const long rows = c->dofs - c->cut;
    const abreast *column = (const abreast *)c->column;
    abreast *reduced = (abreast *)c->reduced, *corner = (abreast *)c->corner;
    EACH(g, GROUPS)
        factor_rows(first, rows, (abreast *)c->L + g);
    if (!c->cut)
        return;
    forth_and_back(rows, (const abreast *)c->L, column, reduced);
    EACH(g, GROUPS) {
        for (long i = 0; i < rows; ++i)
            corner[g] -= column[i * GROUPS + g] * reduced[i * GROUPS + g];
        corner[g] = reciprocal(corner[g]);
    }
}

/* ==== factors ==== */
/* Factors of a mass matrix along a slice or ring, with a gradient-jump penalty or without, of wavetank/fem/mass.py; follows
cells.c and the section banded. */

/* Return the first row whose weights differ from the factorised ones, or the number of rows; the present weights are stored. */
INLINE long first_changed(const Mass *m)
{
    const Chain *c = m->factors;
    const size_t batch = sizeof(stored) * POINTS;
    long first = c->dofs - c->cut;
    EACH(b, m->cells->batches) {
        char *weights = (char *)m->weights + b * batch, *factored = (char *)m->factored + b * batch;
        if (memcmp(weights, factored, batch)) {
            memcpy(factored, weights, batch);
            EACH(i, NODES * LANES) {
                const long row = c->cut ? 0 : c->row[m->cells->dofs[b * NODES * LANES + i]];
                first = row < first ? row : first;
            }
        }
    }
    return first;
}

/* Add to the entry of two degrees of freedom, if its row is ``first`` or later; only the lower half is stored. */
INLINE void add_entry(const Chain *c, long first, int dof, int other_dof, double value)
{
    const long row = c->row[dof], other = c->row[other_dof], rows = c->dofs - c->cut;
    if (other > row || row < first)
        return;
    if (row < rows)
        c->L[row * (BAND + 1) + row - other] += value;
    else if (other < rows)
        c->column[other] += value;
    else
        *c->corner += value;
}

/* Add the mass matrix, from a row on. */
INLINE void add_mass(const Mass *m, long first)
{
    const Cells *cells = m->cells;
    EACH(b, cells->batches) {
        const int *dofs = cells->dofs + b * NODES * LANES;
        int any = 0;
        EACH(i, NODES * LANES)
            any |= m->factors->row[dofs[i]] >= first;
        if (!any)
            continue;
        v A[NODES][NODES] = {{{0.0}}};
        EACH(q, POINTS) {
            const v weight = ((const stored *)m->weights)[(long)b * POINTS + q];
            EACH(i, NODES)
                EACH(j, NODES)
                    A[i][j] += cells->values[q * NODES + i] * cells->values[q * NODES + j] * weight;
        }
        EACH(i, NODES)
            EACH(j, NODES)
                EACH(l, LANES)
                    add_entry(m->factors, first, dofs[i * LANES + l], dofs[j * LANES + l], A[i][j][l]);
    }
}

#define SIDES (2 * NODES)

/* y <- N v = strength sum of jumps (jumps . v). */
SHARED void apply_penalty(const Penalty *N, long dofs, const double *x, double *y)
{
    memset(y, 0, sizeof(double) * dofs);
    EACH(f, N->facets) {
        const int *at = N->dofs + f * SIDES;
        const double *jumps = N->jumps + f * SIDES;
        double jump = 0.0;
        EACH(i, SIDES)
            jump += jumps[i] * x[at[i]];
        EACH(i, SIDES)
            y[at[i]] += N->strength * jump * jumps[i];
    }
}

/* Factorise for the present weights, from the first row that has changed. */
SHARED void factor(const Mass *m)
{
    const Chain *c = m->factors;
    const Penalty *N = m->penalty;
    const long rows = c->dofs - c->cut, first = first_changed(m);
    if (first == rows)
        return;
    memset(c->L + first * (BAND + 1), 0, sizeof(double) * (rows + BAND - first) * (BAND + 1));
    memset(c->column, 0, sizeof(double) * c->cut * rows);
    *c->corner = 0.0;
    add_mass(m, first);
    EACH(f, N ? N->facets : 0) {
        const int *at = N->dofs + f * SIDES;
        const double *jumps = N->jumps + f * SIDES;
        EACH(i, SIDES)
            EACH(j, SIDES)
                add_entry(c, first, at[i], at[j], N->strength * jumps[i] * jumps[j]);
    }
    factorise(c, first);
}

/* x <- A^-1 b, both [degree of freedom]; x may be b. */
SHARED void solve(const Mass *m, const double *b, double *x)
{
    const Chain *c = m->factors;
    EACH(i, c->dofs)
        m->work[c->row[i]] = b[i];
    solve_chain(c, m->work, m->work);
    EACH(i, c->dofs)
        x[i] = m->work[c->row[i]];
}
