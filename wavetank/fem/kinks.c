/* What takes kinks between cells along a slice, of wavetank/fem/kinks.py; cells.c, chain.c and banded_mass.c stand before. */
#include <stdint.h>

#define SIDES (2 * NODES)

typedef void Multiply(const void *cells, const double *weights, const double *x, double *y);

typedef struct {
    int facets;
    double strength;
    const int *dofs;        /* [facet][of the cell before it, and of that behind] */
    const double *slopes;   /* of these, there, in the reference tank; those before with the other sign */
    const double *shift;    /* by which the wall has carried degrees of freedom, or null */
    double *jumps;          /* what the slope jumps by, of each of these */
} Kinks;

typedef struct {
    void *multiply, *mass_cells;
    const double *weights;
    double *resting, *eta, *work;   /* room: for masses of still water, an elevation, and two solves */
} Mass;

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

/* Q <- Q - N eta', eta' = (M_J + N)^-1 (Q - M_J d) over still water of depth d, and psi <- psi - (M_J + N)^-1 N psi of
   points [Q, psi]. */
static void smooth(const Kinks *k, const Chain *c, const Mass *m, const double *still, int points, const double *pairs,
                   double *found)
{
    const long n = c->dofs;
    memset(m->resting, 0, sizeof(double) * n);
    ((Multiply *)m->multiply)(m->mass_cells, m->weights, still, m->resting);
    EACH(point, points) {
        const double *q = pairs + 2 * n * point, *psi = q + n;
        double *q_after = found + 2 * n * point, *psi_after = q_after + n;
        EACH(i, n)
            m->eta[i] = q[i] - m->resting[i];
        kinks_of(k, n, psi, psi_after);
        solve_both(c, m->eta, psi_after, m->eta, psi_after, m->work);
        kinks_of(k, n, m->eta, q_after);
        EACH(i, n)
            q_after[i] = q[i] - q_after[i], psi_after[i] = psi[i] - psi_after[i];
    }
}
