/* What takes kinks between cells along a slice, of wavetank/fe/kinks.py; cells.c, chain.c and banded_mass.c stand before. */
#include <stdint.h>

#define SIDES (2 * NODES)

typedef void Solve(const void *chain, const double *b, double *x, double *work);

typedef struct {
    int facets;
    double strength;
    const int *dofs;        /* [facet][of the cell before it, and of that behind] */
    const double *slopes;   /* of these, there, in the reference tank; those before with the other sign */
    const double *shift;    /* by which the wall has carried degrees of freedom, or null */
    double *jumps;          /* what the slope jumps by, of each of these */
} Kinks;

/* y <- N v = strength sum of jumps (jumps . v). */
static void kinks_of(const Kinks *k, int dofs, const double *x, double *y)
{
    memset(y, 0, sizeof(double) * dofs);
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
static void factor_kinks(const Kinks *k, const Cells *cells, const double *weights, double *kept, const Chain *c)
{
    const long first = first_changed(cells, weights, kept, c);
    if (first == c->dofs)
        return;
    clear_chain(c, first);
    add_mass(cells, weights, first, c);
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

/* y <- v' = (M_J + N)^-1 M_J v = v - (M_J + N)^-1 N v. */
static void smooth(const Kinks *k, const Chain *c, const double *x, double *y, double *work)
{
    kinks_of(k, c->dofs, x, y);
    solve_mass(c, y, y, work);
    EACH(i, c->dofs)
        y[i] = x[i] - y[i];
}

/* Q <- Q - N eta' of the elevation eta = M_J^-1 Q - d over still water of depth d. */
static void smooth_masses(const Kinks *k, const Chain *c, uintptr_t solve, uintptr_t mass, const double *still, const double *q,
                          double *found, double *eta, double *work)
{
    ((Solve *)solve)((const void *)mass, q, found, work);
    EACH(i, c->dofs)
        found[i] -= still[i];
    smooth(k, c, found, eta, work);
    kinks_of(k, c->dofs, eta, found);
    EACH(i, c->dofs)
        found[i] = q[i] - found[i];
}
