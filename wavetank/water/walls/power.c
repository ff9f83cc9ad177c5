/* The power of a vertical paddle along a slice but for its acceleration's, of wavetank/water/walls/power.py. */

typedef struct {
    double value, slope;
} Point;

static Point at(const Strip *s, int cell, int q, const double *rows)
{
    Point p = {0.0, 0.0};
    for (int i = 0; i < NODES; ++i) {
        const double one = rows[s->dofs[cell * NODES + i]];
        p.value += s->values[q * NODES + i] * one;
        p.slope += s->slopes[q * NODES + i] * one;
    }
    p.slope /= s->lengths[cell];
    return p;
}

double power(const Strip *s, double position, double speed, const double *share, const double *phi, const double *column,
             const double *mu, const double *depth, const double *sinking)
{
    double sum = 0.0;
    for (int cell = 0; cell < s->cells; ++cell) {
        double value[NODES][LEVELS], rise[NODES][LEVELS];
        for (int i = 0; i < NODES; ++i) {
            const double *of_node = phi + (long)s->dofs[cell * NODES + i] * NUMBERS;
            for (int z = 0; z < LEVELS; ++z)
                value[i][z] = rise[i][z] = 0.0;
            for (int j = 0; j < NUMBERS; ++j)
                for (int z = 0; z < LEVELS; ++z) {
                    value[i][z] += of_node[j] * s->P[j * LEVELS + z];
                    rise[i][z] += of_node[j] * s->dP[j * LEVELS + z];
                }
        }
        for (int q = 0; q < POINTS; ++q) {
            const Point h = at(s, cell, q, column), d = at(s, cell, q, depth), d_t = at(s, cell, q, sinking);
            const double stretch = at(s, cell, q, share).slope, J = 1.0 + stretch * position, J_t = stretch * speed;
            const double eta = h.value - d.value;
            double up = 0.0, along = 0.0, both = 0.0;
            for (int z = 0; z < LEVELS; ++z) {
                double u_x = 0.0, w = 0.0;
                for (int i = 0; i < NODES; ++i) {
                    u_x += s->slopes[q * NODES + i] * value[i][z];
                    w += s->values[q * NODES + i] * rise[i][z];
                }
                w /= h.value;
                const double S = u_x / s->lengths[cell] - (s->zeta[z] * h.slope - d.slope) * w;
                up += s->shares[z] * w * w, along += s->shares[z] * S * S, both += s->shares[z] * S * w;
            }
            const double kinetic = 0.5 * h.value * (up - along / (J * J)), potential = 0.5 * s->gravity * eta * eta;
            const double by_bed = h.value * both * d_t.slope / J - s->gravity * J * eta * d_t.value;
            const double moved = J_t * (kinetic + potential - h.value * at(s, cell, q, mu).value);
            sum += s->measure[cell * POINTS + q] * (moved + by_bed);
        }
    }
    return sum;
}
