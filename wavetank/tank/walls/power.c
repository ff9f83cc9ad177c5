/* The power of a paddle along a slice, of wavetank/tank/walls/power.py.

NODES, POINTS   of a cell, its points four at a time: GROUPS of them
LEVELS, NUMBERS of the column, and of the potential in each node
WIDTH           groups of numbers that values and rises at all levels are
DEGREE          of the shape's polynomial, 0 of a vertical paddle
AT_PADDLE       levels of the rule over the column at the paddle */
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

/* A polynomial of points four at a time. */
static inline __attribute__((always_inline)) v horner(const double *c, int degree, v x)
{
    v sum = c[degree] + (v){0.0};
    for (int k = degree - 1; k >= 0; --k)
        sum = c[k] + x * sum;
    return sum;
}

/* Sets dH/dt as the paddle goes on at its velocity, and dH/dX', at the point as it is, or at its mean with the one held. */
void push(const Strip *s, double position, double speed, const double *mu, int between, double *found)
{
    const stored *values = (const stored *)s->values, *slopes = (const stored *)s->slopes;
    Column c[NODES];
    v going = {0.0}, sped = {0.0}, upwards[NUMBERS][WIDTH];
    const v none = {0.0};
    const double per_unit = 1.0 / s->unit;
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
            v h = {0.0}, h_x = {0.0}, psi_x = {0.0}, by_column = {0.0}, up = {0.0}, along = {0.0}, both = {0.0}, kinetic = {0.0};
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
            const v still = ((const stored *)s->depth)[at], eta = h - still, measure = ((const stored *)s->measure)[at];
            const v share = ((const stored *)s->share)[at], stretch = ((const stored *)s->stretch)[at];
            for (int z = 0; z < LEVELS; ++z) {
                v S = {0.0}, w = {0.0};
                EACH(i, NODES) {
                    S += slope[i] * c[i].of[0][z];
                    w += value[i] * c[i].of[1][z];
                }
                S -= (s->zeta[z] * rising - sloping) * w;
#if DEGREE
                const v down = (still - s->zeta[z] * h) * per_unit, f = horner(s->shape, DEGREE, down);
                const v lean = share * per_unit * horner(s->slope, DEGREE - 1, down);
                S /= 1.0 + position * stretch * f, w = w * per_column - position * lean * S; /* the velocity */
                kinetic += h * (0.5 * stretch * f * (w * w - S * S) - lean * S * w);
#else
                up += w * w, along += S * S, both += S * w;
#endif
            }
#if !DEGREE
            const v J = 1.0 + stretch * position, per_J = 1.0 / J;
            kinetic = 0.5 * stretch * (up * per_column - h * along * per_J * per_J);
            going += measure * (both * ((const stored *)s->sinking_x)[at] * per_J
                                - s->gravity * J * eta * ((const stored *)s->sinking)[at]);
#endif
            const v down = -eta * per_unit, R = s->mean * still + eta * horner(s->integral, DEGREE, down);
            const v potential = 0.5 * s->gravity * eta * eta * horner(s->moment, DEGREE, down);
            going += measure * speed * (kinetic + stretch * (potential - R * by_column));
            sped -= measure * share * R * psi_x;
        }
    }
    const double *at_paddle = s->rows + s->paddle * OF_A_NODE;
    for (int l = 0; l < AT_PADDLE; ++l) {
        double mean = 0.0; /* of the potential there, less that at the surface */
        for (int j = 0; j < NUMBERS - 1; ++j)
            mean += at_paddle[j] * s->means[l * (NUMBERS - 1) + j];
        sped[0] += at_paddle[H] * mean * horner(s->shape, DEGREE, none + (s->still - s->levels[l] * at_paddle[H]) * per_unit)[0];
    }
    found[0] = going[0] + going[1] + going[2] + going[3];
    found[1] = sped[0] + sped[1] + sped[2] + sped[3];
}
