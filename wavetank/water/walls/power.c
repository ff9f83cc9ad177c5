/* The power of a vertical paddle along a slice, of wavetank/water/walls/power.py.

NODES, POINTS   of a cell, its points four at a time: GROUPS of them
LEVELS, NUMBERS of the column, and of the potential in each node
WIDTH           groups of numbers that values and rises at all levels are */
#include <string.h>

typedef double v __attribute__((vector_size(32)));
typedef double stored __attribute__((vector_size(32), aligned(8)));

#define POINTS (4 * GROUPS)
#define EACH(i, most) _Pragma("GCC unroll 16") for (int i = 0; i < (most); ++i)

typedef union {
    v groups[WIDTH];
    double of[2][LEVELS];   /* value and rise, d/dzeta, at the levels, each times the root of its share */
} Column;

enum { H = NUMBERS, MU, OF_A_NODE };    /* behind the potential's numbers */

/* Take over what is at nodes, one after the other, or its mean with what is held. */
static inline __attribute__((always_inline)) void take(const Strip *s, const double *mu, int between, double *restrict rows)
{
    const double *phi = s->phi, *column = s->column, *held = s->held;
    const int nodes = s->nodes, *dofs = s->dofs;
    for (int k = 0; k < nodes; ++k, rows += OF_A_NODE, held += OF_A_NODE) {
        EACH(j, NUMBERS)
            rows[j] = phi[(long)dofs[k] * NUMBERS + j];
        rows[H] = column[dofs[k]], rows[MU] = mu[dofs[k]];
        if (between)
            EACH(j, OF_A_NODE)
                rows[j] = 0.5 * (rows[j] + held[j]);
    }
}

/* Hold the point as it is, for what is between that and another. */
void hold(const Strip *s, const double *mu)
{
    take(s, mu, 0, s->held);
}

/* The potential over a node, whose sums stand in registers. */
static inline __attribute__((always_inline)) void over(const v upwards[NUMBERS][WIDTH], const double *row, Column *c)
{
    v sums[WIDTH] = {{0.0}};
    for (int j = 0; j < NUMBERS; ++j)
        EACH(z, WIDTH)
            sums[z] += row[j] * upwards[j][z];
    EACH(z, WIDTH)
        c->groups[z] = sums[z];
}

/* Sets dH/dt as the paddle goes on at its velocity, and dH/dX', at the point as it is, or at its mean with the one held. */
void push(const Strip *s, double position, double speed, const double *mu, int between, double *found)
{
    const stored *values = (const stored *)s->values, *slopes = (const stored *)s->slopes;
    Column c[NODES];
    v going = {0.0}, sped = {0.0}, upwards[NUMBERS][WIDTH];
    memcpy(upwards, s->upwards, sizeof(upwards)); /* where none is in two lines of the cache */
    take(s, mu, between, s->rows);
    over(upwards, s->rows, c + NODES - 1);
    for (int cell = 0; cell < s->cells; ++cell) {
        const double *rows = s->rows + cell * (NODES - 1) * OF_A_NODE;
        const double per_metre = 1.0 / s->lengths[cell];
        c[0] = c[NODES - 1];
        for (int i = 1; i < NODES; ++i)
            over(upwards, rows + i * OF_A_NODE, c + i);
        for (int g = 0; g < GROUPS; ++g) {
            const int at = cell * GROUPS + g;
            v h = {0.0}, h_x = {0.0}, psi_x = {0.0}, by_column = {0.0}, up = {0.0}, along = {0.0}, both = {0.0};
            v value[NODES], slope[NODES];
            EACH(i, NODES) {
                const double *at_node = rows + i * OF_A_NODE;
                value[i] = values[i * GROUPS + g], slope[i] = slopes[i * GROUPS + g] * per_metre;
                h += value[i] * at_node[H];
                h_x += slope[i] * at_node[H];
                psi_x += slope[i] * at_node[NUMBERS - 1];
                by_column += value[i] * at_node[MU];
            }
            const v per_column = 1.0 / h, rising = h_x * per_column, sloping = ((const stored *)s->depth_x)[at] * per_column;
            for (int z = 0; z < LEVELS; ++z) {
                v S = {0.0}, w = {0.0};
                EACH(i, NODES) {
                    S += slope[i] * c[i].of[0][z];
                    w += value[i] * c[i].of[1][z];
                }
                S -= (s->zeta[z] * rising - sloping) * w;
                up += w * w, along += S * S, both += S * w;
            }
            const v stretch = ((const stored *)s->stretch)[at], J = 1.0 + stretch * position, per_J = 1.0 / J;
            const v eta = h - ((const stored *)s->depth)[at], J_t = stretch * speed;
            const v density = 0.5 * (up * per_column - h * along * per_J * per_J + s->gravity * eta * eta) - h * by_column;
            const v by_bed = both * ((const stored *)s->sinking_x)[at] * per_J
                             - s->gravity * J * eta * ((const stored *)s->sinking)[at];
            going += ((const stored *)s->measure)[at] * (J_t * density + by_bed);
            sped -= ((const stored *)s->measure)[at] * (h * psi_x * ((const stored *)s->share)[at]);
        }
    }
    double mean = 0.0;      /* of the potential at the paddle, less that at the surface */
    const double *at_paddle = s->rows + s->paddle * OF_A_NODE;
    for (int j = 0; j < NUMBERS - 1; ++j)
        mean += at_paddle[j] * s->means[j];
    found[0] = going[0] + going[1] + going[2] + going[3];
    found[1] = sped[0] + sped[1] + sped[2] + sped[3] + at_paddle[H] * mean;
}
