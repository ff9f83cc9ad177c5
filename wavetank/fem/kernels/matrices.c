/* ==== mass ==== */
/* A mass matrix without matrix, of wavetank/fem/mass.py; cells.c stands before.

FIELDS          that its density depends on */
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

/* Take over the fields as they are: find the density at the points, times all weights. */
SHARED void weigh(const Mass *m)
{
    const Weights what = {m->constants, (stored *)m->weights};
    EACH(f, FIELDS)
        EACH(i, m->dofs)
            m->rows[i * FIELDS + f] = m->fields[f][i];
    EACH(b, m->cells->batches) {
        v X[NODES * FIELDS + 1];
        gather(m->cells, b, FIELDS, m->rows, FIELDS, X);
        through(m->cells, b, DIM, FIELDS, X, 0, X, weigh_at, &what);
    }
}

INLINE void multiply_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    r[0] = ((const stored *)what)[b * POINTS + q] * u[0];
}

/* y += M x. */
SHARED void multiply(const Mass *m, const double *x, double *y)
{
    const Cells *c = m->cells;
    EACH(b, c->batches) {
        v X[NODES], Y[NODES];
        gather(c, b, 1, x, 1, X);
        clear(NODES, Y);
        through(c, b, 0, 1, X, 1, Y, multiply_at, m->weights);
        scatter(c, b, 1, Y, y, 1);
    }
}

/* The integral of the density of the fields as they are. */
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

/* y += the diagonal of M. */
SHARED void diagonal(const Mass *m, double *y)
{
    const Cells *c = m->cells;
    const double *squares = c->squares + DIM * (DIM + 1) / 2 * POINTS * NODES;
    EACH(b, c->batches) {
        v Y[NODES];
        clear(NODES, Y);
        EACH(q, POINTS)
            EACH(i, NODES)
                Y[i] += squares[q * NODES + i] * ((const stored *)m->weights)[(long)b * POINTS + q];
        scatter(c, b, 1, Y, y, 1);
    }
}

/* y += scale K x, cell by cell, K[node][node] or its factor along each edge; scale[batch][lane]. */
SHARED void cellwise(const Mass *m, const double *K, const double *scale, const double *x, double *y)
{
    const Cells *c = m->cells;
    EACH(b, c->batches) {
        const v s = ((const stored *)scale)[b];
        v X[NODES], Y[NODES];
        gather(c, b, 1, x, 1, X);
        clear(NODES, Y);
#if SIDE
        v T[NODES];
        clear(NODES, T);
        EACH(i, SIDE)
            EACH(k, SIDE)
                EACH(j, SIDE)
                    T[i * SIDE + k] += K[i * SIDE + j] * X[j * SIDE + k];
        EACH(i, SIDE)
            EACH(k, SIDE)
                EACH(j, SIDE)
                    Y[i * SIDE + k] += K[k * SIDE + j] * T[i * SIDE + j];
#else
        EACH(i, NODES)
            EACH(j, NODES)
                Y[i] += K[i * NODES + j] * X[j];
#endif
        EACH(i, NODES)
            Y[i] *= s;
        scatter(c, b, 1, Y, y, 1);
    }
}

/* ==== banded ==== */
/* Symmetric banded systems along a slice or ring, ABREAST of them at once; cells.c stands before.

BAND            how far apart coupled rows can be
ABREAST         systems in a vector
GROUPS          such vectors: systems are treated all at once, so that none waits for another */

/* What is to be found before what it stands beside: a row waits for its neighbour with one product alone. That of one system
   alone takes all its neighbours in turn, the furthest first, which is what it waits for least. */
#ifdef __has_builtin
#if __has_builtin(__builtin_assoc_barrier)
#define FIRST __builtin_assoc_barrier
#endif
#endif
#ifndef FIRST
#define FIRST
#endif

#define IN_TURN (ABREAST == 1)
#if ABREAST == 1
typedef REAL abreast;
typedef REAL beside __attribute__((vector_size(2 * sizeof(REAL)), aligned(sizeof(REAL))));  /* two right-hand sides */
#else
typedef REAL abreast __attribute__((vector_size(sizeof(REAL) * ABREAST), aligned(sizeof(REAL))));
typedef abreast beside;
#endif

/* Where the entries of two rows are, [group], the second not behind the first. */
INLINE abreast *entry(const Chain *c, long row, long other)
{
    const long rows = c->dofs - c->cut;
    return row < rows     ? (abreast *)c->L + (row * (BAND + 1) + row - other) * GROUPS
           : other < rows ? (abreast *)c->column + other * GROUPS
                          : (abreast *)c->corner;
}

/* From a row on. */
SHARED void clear_chain(const Chain *c, long first)
{
    const long rows = c->dofs - c->cut;
    memset((abreast *)c->L + first * (BAND + 1) * GROUPS, 0, sizeof(abreast) * (rows + BAND - first) * (BAND + 1) * GROUPS);
    memset(c->column, 0, sizeof(abreast) * c->cut * rows * GROUPS);
    memset(c->corner, 0, sizeof(abreast) * GROUPS);
}

INLINE abreast reciprocal(abreast of)
{
    EACH(l, ABREAST) {
        REAL *one = (REAL *)&of + l;
        *one = *one > 0.0 ? 1.0 / *one : NAN;
    }
    return of;
}

/* A <- its factors, of a group; the rows before the first have theirs. */
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

/* Numbers of a row and group are read and written, of one right-hand side or two; one stands in a vector all the same: what is
   found of it is the same beside another, and a vector is copied in no time, where a number is not. */
INLINE beside side_at(int sides, const abreast *b, long at)
{
    return sides > 1 ? ((const beside *)b)[at] : (beside){0.0} + b[at];
}

INLINE void put_side(int sides, abreast *x, long at, beside what)
{
    if (sides > 1)
        ((beside *)x)[at] = what;
    else
        x[at] = *(const abreast *)&what;
}

/* x <- the inverse of the rest of b, both [row][group][side]. */
INLINE void forth_and_back(int sides, long rows, const abreast *restrict L, const abreast *b, abreast *x)
{
    beside last[BAND][GROUPS] = {0};
    for (long i = 0; i < rows; ++i) {
        const abreast *row = L + i * (BAND + 1) * GROUPS;
        EACH(g, GROUPS) {
            beside here = side_at(sides, b, i * GROUPS + g);
            for (int d = BAND; d > 0; --d)
                here = (IN_TURN || d == 1 ? FIRST(here) : here) - row[d * GROUPS + g] * last[d - 1][g];
            for (int d = BAND - 1; d > 0; --d)
                last[d][g] = last[d - 1][g];
            last[0][g] = here;
            put_side(sides, x, i * GROUPS + g, here * row[g]);
        }
    }
    EACH(d, BAND)
        EACH(g, GROUPS)
            last[d][g] = (beside){0.0};
    for (long i = rows - 1; i >= 0; --i)
        EACH(g, GROUPS) {
            beside here = side_at(sides, x, i * GROUPS + g);
            for (int d = BAND; d > 0; --d)  /* BAND rows of zeros follow the last one */
                here = (IN_TURN || d == 1 ? FIRST(here) : here) - L[((i + d) * (BAND + 1) + d) * GROUPS + g] * last[d - 1][g];
            for (int d = BAND - 1; d > 0; --d)
                last[d][g] = last[d - 1][g];
            last[0][g] = here;
            put_side(sides, x, i * GROUPS + g, here);
        }
}

/* x <- the inverse of b, both [row][group]; x may be b. */
INLINE void solve_chain(const Chain *c, const abreast *b, abreast *x)
{
    const long rows = c->dofs - c->cut;
    abreast border[GROUPS];
    EACH(g, GROUPS)
        border[g] = c->cut ? b[rows * GROUPS + g] : (abreast){0.0};
    forth_and_back(1, rows, (const abreast *)c->L, b, x);
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
    forth_and_back(1, rows, (const abreast *)c->L, column, reduced);
    EACH(g, GROUPS) {
        for (long i = 0; i < rows; ++i)
            corner[g] -= column[i * GROUPS + g] * reduced[i * GROUPS + g];
        corner[g] = reciprocal(corner[g]);
    }
}

/* ==== factors ==== */
/* Factors of a mass matrix along a slice or ring, of wavetank/fem/mass.py and gradient_jumps.py; cells.c and banded
systems stand before.

JUMPS           whether this is the matrix M_J + N of the gradient-jump penalty, of the bandwidth of two cells */

/* The first row that other weights than those ``kept``, which become these, change; how many there are if none does. */
SHARED long first_changed(const Cells *cells, const double *weights, double *kept, const Chain *c)
{
    const size_t batch = sizeof(stored) * POINTS;
    long first = c->dofs - c->cut;
    EACH(b, cells->batches)
        if (memcmp((const char *)weights + b * batch, (const char *)kept + b * batch, batch)) {
            memcpy((char *)kept + b * batch, (const char *)weights + b * batch, batch);
            EACH(i, NODES * LANES) {
                const long row = c->cut ? 0 : c->row[cells->dofs[b * NODES * LANES + i]];
                first = row < first ? row : first;
            }
        }
    return first;
}

/* Whether one of some degrees of freedom has that row, or one behind. */
INLINE int reaches(const Chain *c, long first, const int *dofs, int count)
{
    int any = 0;
    EACH(i, count)
        any |= c->row[dofs[i]] >= first;
    return any;
}

/* Add the mass matrix from a row on. */
SHARED void add_mass(const Cells *cells, const double *weights, long first, const Chain *c)
{
    EACH(b, cells->batches) {
        const int *dofs = cells->dofs + b * NODES * LANES;
        if (!reaches(c, first, dofs, NODES * LANES))
            continue;
        v A[NODES][NODES] = {{{0.0}}};
        EACH(q, POINTS) {
            const v weight = ((const stored *)weights)[(long)b * POINTS + q];
            EACH(i, NODES)
                EACH(j, NODES)
                    A[i][j] += cells->values[q * NODES + i] * cells->values[q * NODES + j] * weight;
        }
        EACH(i, NODES)
            EACH(j, NODES)
                EACH(l, LANES) {
                    const long row = c->row[dofs[i * LANES + l]], other = c->row[dofs[j * LANES + l]];
                    if (other <= row && row >= first)
                        *entry(c, row, other) += A[i][j][l];
                }
    }
}

/* x <- the inverse of b, both [degree of freedom]; x may be b. */
SHARED void solve_one(const Chain *c, const double *b, double *x, double *work)
{
    EACH(i, c->dofs)
        work[c->row[i]] = b[i];
    solve_chain(c, work, work);
    EACH(i, c->dofs)
        x[i] = work[c->row[i]];
}

/* The same of two at once, x of b and y of d, bit for bit: in a slice what one waits for leaves time for the other. */
SHARED void solve_two(const Chain *c, const double *b, const double *d, double *x, double *y, double *work)
{
    if (c->cut) {
        solve_one(c, b, x, work);
        solve_one(c, d, y, work);
        return;
    }
    EACH(i, c->dofs)
        work[2 * c->row[i]] = b[i], work[2 * c->row[i] + 1] = d[i];
    forth_and_back(2, c->dofs, c->L, work, work);
    EACH(i, c->dofs)
        x[i] = work[2 * c->row[i]], y[i] = work[2 * c->row[i] + 1];
}

#if !JUMPS
/* The factors of other weights than those ``kept``; rows before the first that they change stay. */
SHARED void factor(const Mass *m)
{
    const long first = first_changed(m->cells, m->weights, m->factored, m->factors);
    if (first == m->factors->dofs - m->factors->cut)
        return;
    clear_chain(m->factors, first);
    add_mass(m->cells, m->weights, first, m->factors);
    factorise(m->factors, first);
}

/* x <- the inverse of b, both [degree of freedom]; x may be b. */
SHARED void solve(const Mass *m, const double *b, double *x)
{
    solve_one(m->factors, b, x, m->work);
}
#endif

#if JUMPS
#define SIDES (2 * NODES)

typedef struct {
    int facets;
    double strength;
    const int *dofs;        /* [facet][of the cell before it, and of that behind] */
    const double *slopes;   /* of these, there, in the reference tank; those before with the other sign */
    const double *shift;    /* displacement of the degrees of freedom by the wall, or null */
    double *jumps;          /* of the slope, of each of these */
    const Mass *mass;
    const Chain *factors;   /* of M_J + N */
    double *factored;       /* the weights that they are of */
    double *eta, *work;     /* [degree of freedom], [2][degree of freedom] */
} Jumps;

/* y <- N v = strength sum of jumps (jumps . v). */
SHARED void jumps_of(const Jumps *k, const double *x, double *y)
{
    memset(y, 0, sizeof(double) * k->factors->dofs);
    EACH(f, k->facets) {
        const int *at = k->dofs + f * SIDES;
        const double *jumps = k->jumps + f * SIDES;
        double jump = 0.0;
        EACH(i, SIDES)
            jump += jumps[i] * x[at[i]];
        jump *= k->strength;
        EACH(i, SIDES)
            y[at[i]] += jump * jumps[i];
    }
}

/* The factors of M_J + N as the wall stands, as of M_J alone. */
SHARED void factor_jumps(const Jumps *k)
{
    const Mass *m = k->mass;
    const Chain *c = k->factors;
    const long first = first_changed(m->cells, m->weights, k->factored, c);
    if (first == c->dofs)
        return;
    clear_chain(c, first);
    add_mass(m->cells, m->weights, first, c);
    EACH(f, k->facets) {
        const int *at = k->dofs + f * SIDES;
        double *jumps = k->jumps + f * SIDES;
        if (!reaches(c, first, at, SIDES))  /* rows follow each other backwards */
            break;
        EACH(side, 2) {
            const double *slopes = k->slopes + f * SIDES + side * NODES;
            double stretch = 0.0;
            EACH(i, NODES)
                stretch += k->shift ? slopes[i] * k->shift[at[side * NODES + i]] : 0.0;
            EACH(i, NODES)
                jumps[side * NODES + i] = slopes[i] / (side ? 1.0 + stretch : 1.0 - stretch);
        }
        EACH(i, SIDES)
            EACH(j, SIDES) {
                const long row = c->row[at[i]], other = c->row[at[j]];
                if (other <= row && row >= first)
                    *entry(c, row, other) += k->strength * jumps[i] * jumps[j];
            }
    }
    factorise(c, first);
}

/* Q <- Q - N eta', eta' = (M_J + N)^-1 (Q - M_J d) of points [Q, psi] over ``resting`` M_J d, masses of still water, and
   psi <- psi - (M_J + N)^-1 N psi. */
SHARED void smooth(const Jumps *k, const double *resting, int points, const double *pairs, double *found)
{
    const Chain *c = k->factors;
    const long n = c->dofs;
    EACH(point, points) {
        const double *q = pairs + 2 * n * point, *psi = q + n;
        double *q_after = found + 2 * n * point, *psi_after = q_after + n;
        EACH(i, n)
            k->eta[i] = q[i] - resting[i];
        jumps_of(k, psi, psi_after);
        solve_two(c, k->eta, psi_after, k->eta, psi_after, k->work);
        jumps_of(k, k->eta, q_after);
        EACH(i, n)
            q_after[i] = q[i] - q_after[i], psi_after[i] = psi[i] - psi_after[i];
    }
}
#endif
