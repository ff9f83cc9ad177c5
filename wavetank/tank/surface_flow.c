/* Slopes and velocities of a surface along a slice, of wavetank/tank/surface_flow.py: of LANES cells at a time.

NODES, POINTS   of a cell
DEGREE          of paddles' shapes, the highest */
typedef double v __attribute__((vector_size(sizeof(double) * LANES)));
typedef double stored __attribute__((vector_size(sizeof(double) * LANES), aligned(sizeof(double))));

#define EACH(i, most) _Pragma("GCC unroll 32") for (int i = 0; i < (most); ++i)
#define INLINE static inline __attribute__((always_inline))

/* Two fields, given at the degrees of freedom, at the nodes. */
INLINE void gather(const Lines *s, int b, const double *one, const double *other, v at_nodes[2][NODES])
{
    EACH(i, NODES)
        EACH(l, LANES) {
            const int dof = s->dofs[(b * NODES + i) * LANES + l];
            ((double *)&at_nodes[0][i])[l] = one[dof], ((double *)&at_nodes[1][i])[l] = other[dof];
        }
}

/* These at the points, by a table of values, or of slopes in the cell's own coordinate. */
INLINE void at_points(const double *table, const v at_nodes[2][NODES], v *one, v *other)
{
    EACH(q, POINTS) {
        one[q] = other[q] = (v){0.0};
        EACH(i, NODES)
            one[q] += table[q * NODES + i] * at_nodes[0][i], other[q] += table[q * NODES + i] * at_nodes[1][i];
    }
}

/* Height, slope and d psi / dx of the surface, and how far it is carried by paddles of shapes f: x = X + sum f L. */
INLINE void find(const Lines *s, int b, const double *eta, const double *psi, v *far, v *height, v *slope, v *psi_x)
{
    v at_nodes[2][NODES], per_metre[POINTS], x_X[POINTS], length[POINTS], length_X[POINTS], unused[POINTS];
    gather(s, b, eta, psi, at_nodes);
    at_points(s->values, at_nodes, height, unused);
    at_points(s->slopes, at_nodes, slope, psi_x);
    EACH(q, POINTS)
        per_metre[q] = ((const stored *)s->per_metre)[b], far[q] = (v){0.0}, x_X[q] = far[q] + 1.0;
    if (s->carried[b]) {
        for (int k = 0; k < s->paddles; ++k) {
            const double *powers = s->powers + k * (DEGREE + 1), per_unit = s->per_unit[k];
            gather(s, b, s->lengths[k], s->lengths[k], at_nodes);
            at_points(s->values, at_nodes, length, unused);
            at_points(s->slopes, at_nodes, length_X, unused);
            EACH(q, POINTS) {
                v f = powers[DEGREE] + (v){0.0}, f_z = {0.0};
                for (int one = DEGREE - 1; one >= 0; --one)
                    f_z = f + height[q] * per_unit * f_z, f = powers[one] + height[q] * per_unit * f;
                far[q] += f * length[q];
                x_X[q] += (f * length_X[q] + f_z * per_unit * slope[q] * length[q]) * per_metre[q];
            }
        }
        EACH(q, POINTS)
            per_metre[q] /= x_X[q];
    }
    EACH(q, POINTS)
        slope[q] *= per_metre[q], psi_x[q] *= per_metre[q];
}

/* Place, height, slope and d psi / dx at the points, [quantity][cell][point]. */
void surface(const Lines *s, const double *eta, const double *psi, double *found)
{
    for (int b = 0; b < s->batches; ++b) {
        v of[4][POINTS];
        find(s, b, eta, psi, of[0], of[1], of[2], of[3]);
        for (int l = 0; l < LANES && b * LANES + l < s->cells; ++l) {
            const long at = (b * LANES + l) * POINTS;
            EACH(k, 4)
                EACH(q, POINTS)
                    found[k * s->cells * POINTS + at + q] = of[k][q][l] + (k ? 0.0 : s->places[at + q]);
        }
    }
}

INLINE v larger(v a, v b)
{
    const __typeof__(a > b) which = a > b;
    return (v)(((__typeof__(which))a & which) | ((__typeof__(which))b & ~which));
}

INLINE v size(v a)
{
    return (v)((__typeof__(a > a))a & 0x7fffffffffffffffLL);
}

INLINE double highest(v a)
{
    double most = a[0];
    EACH(l, LANES)
        most = a[l] > most ? a[l] : most;
    return most;
}

/* The largest velocity, |psi_x| / (1 + slope^2), and the largest slope. Cells whose psi_x is less have none larger. */
void largest(const Lines *s, const double *eta, const double *psi, double *found)
{
    double fastest = 0.0;
    v steepest = {0.0};
    for (int b = 0; b < s->batches; ++b) {
        v far[POINTS], height[POINTS], slope[POINTS], psi_x[POINTS], swift = {0.0}, fast = {0.0};
        find(s, b, eta, psi, far, height, slope, psi_x);
        EACH(q, POINTS)
            steepest = larger(steepest, size(slope[q])), swift = larger(swift, size(psi_x[q]));
        if (highest(swift) > fastest) {
            EACH(q, POINTS)
                fast = larger(fast, size(psi_x[q]) / (1.0 + slope[q] * slope[q]));
            fastest = highest(fast) > fastest ? highest(fast) : fastest;
        }
    }
    found[0] = fastest, found[1] = highest(steepest);
}
