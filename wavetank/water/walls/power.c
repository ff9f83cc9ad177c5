/* The power of a vertical paddle along a slice, of wavetank/water/walls/power.py.

NODES, POINTS   of a cell, its points four at a time: GROUPS of them
LEVELS, NUMBERS of the column, and of the potential in each node
WIDTH           groups of numbers that values and rises at all levels are */
typedef double v __attribute__((vector_size(32)));
typedef double stored __attribute__((vector_size(32), aligned(8)));

#define POINTS (4 * GROUPS)
#define EACH(i, most) _Pragma("GCC unroll 16") for (int i = 0; i < (most); ++i)

typedef union {
    v groups[WIDTH];
    double of[2][LEVELS];   /* value and rise, d/dzeta, at the levels, each times the root of its share */
} Column;

enum { H = NUMBERS, MU, OF_A_NODE };    /* behind the potential's numbers */

/* Take over what is at nodes, one after the other. */
static void take(const Strip *s, const double *mu, double *rows)
{
    for (int k = 0; k < s->nodes; ++k, rows += OF_A_NODE) {
        for (int j = 0; j < NUMBERS; ++j)
            rows[j] = s->phi[(long)s->dofs[k] * NUMBERS + j];
        rows[H] = s->column[s->dofs[k]], rows[MU] = mu[s->dofs[k]];
    }
}

/* Hold the point as it is, for what is between that and another. */
void hold(const Strip *s, const double *mu)
{
    take(s, mu, s->held);
}

/* The potential over some nodes that follow each other. */
static inline __attribute__((always_inline)) void over(const Strip *s, const double *rows, int nodes, Column *c)
{
    v sums[NODES][WIDTH] = {{{0.0}}};
    for (int j = 0; j < NUMBERS; ++j)
        EACH(i, nodes)
            EACH(z, WIDTH)
                sums[i][z] += rows[i * OF_A_NODE + j] * ((const stored *)s->upwards)[j * WIDTH + z];
    EACH(i, nodes)
        EACH(z, WIDTH)
            c[i].groups[z] = sums[i][z];
}

/* Sets dH/dt as the paddle goes on at its velocity, and dH/dX', at the point as it is, or at its mean with the one held. */
void push(const Strip *s, double position, double speed, const double *mu, int between, double *found)
{
    const stored *values = (const stored *)s->values, *slopes = (const stored *)s->slopes;
    Column c[NODES];
    v going = {0.0}, sped = {0.0};
    take(s, mu, s->rows);
    for (int k = 0; k < (between ? s->nodes * OF_A_NODE : 0); ++k)
        s->rows[k] = 0.5 * (s->rows[k] + s->held[k]);
    over(s, s->rows, 1, c + NODES - 1);
    for (int cell = 0; cell < s->cells; ++cell) {
        const double *rows = s->rows + cell * (NODES - 1) * OF_A_NODE;
        const double per_metre = 1.0 / s->lengths[cell];
        c[0] = c[NODES - 1];
        over(s, rows + OF_A_NODE, NODES - 1, c + 1);
        for (int g = 0; g < GROUPS; ++g) {
            const int at = cell * GROUPS + g;
            v h = {0.0}, h_x = {0.0}, psi_x = {0.0}, by_column = {0.0}, up = {0.0}, along = {0.0}, both = {0.0};
            EACH(i, NODES) {
                const double *at_node = rows + i * OF_A_NODE;
                h += values[i * GROUPS + g] * at_node[H];
                h_x += slopes[i * GROUPS + g] * (at_node[H] * per_metre);
                psi_x += slopes[i * GROUPS + g] * (at_node[NUMBERS - 1] * per_metre);
                by_column += values[i * GROUPS + g] * at_node[MU];
            }
            const v per_column = 1.0 / h, rising = h_x * per_column, sloping = ((const stored *)s->depth_x)[at] * per_column;
            for (int z = 0; z < LEVELS; ++z) {
                v u_x = {0.0}, w = {0.0};
                EACH(i, NODES) {
                    u_x += slopes[i * GROUPS + g] * c[i].of[0][z];
                    w += values[i * GROUPS + g] * c[i].of[1][z];
                }
                const v S = u_x * per_metre - (s->zeta[z] * rising - sloping) * w;
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
