/* Slopes and velocities of a surface along a slice, of wavetank/water/surface_flow.py.

NODES, POINTS   of a cell, the points in GROUPS of four */
#include <string.h>

typedef double v __attribute__((vector_size(32)));
typedef double stored __attribute__((vector_size(32), aligned(8)));

#define EACH(i, most) _Pragma("GCC unroll 16") for (int i = 0; i < (most); ++i)

/* A field, given at the degrees of freedom, at the points of a cell, by a table of values or slopes, times a factor. */
static inline void at_points(const Lines *s, int cell, const double *table, const double *rows, double factor, v *found)
{
    EACH(g, GROUPS)
        found[g] = (v){0.0};
    EACH(i, NODES) {
        const double one = rows[s->dofs[cell * NODES + i]] * factor;
        EACH(g, GROUPS)
            found[g] += ((const stored *)table)[i * GROUPS + g] * one;
    }
}

/* Its slope in the reference tank. */
static inline void along(const Lines *s, int cell, const double *rows, v *found)
{
    at_points(s, cell, s->slopes, rows, s->per_metre[cell], found);
}

/* Where the surface is carried by paddles of shapes f, x = X + sum f L: how far, and x_X along it. */
static inline void carry(const Lines *s, int cell, const double *eta, const v *eta_X, v *far, v *x_X)
{
    v height[GROUPS], length[GROUPS], length_X[GROUPS];
    at_points(s, cell, s->values, eta, 1.0, height);
    EACH(g, GROUPS)
        far[g] = (v){0.0}, x_X[g] = 1.0 + far[g];
    for (int k = 0; k < s->paddles; ++k) {
        const double *powers = s->powers + k * (s->degree + 1);
        at_points(s, cell, s->values, s->lengths[k], 1.0, length);
        along(s, cell, s->lengths[k], length_X);
        EACH(g, GROUPS) {
            const v depth = height[g] * s->per_unit[k];
            v f = powers[s->degree] + (v){0.0}, slope = {0.0};
            for (int one = s->degree - 1; one >= 0; --one)
                slope = f + depth * slope, f = powers[one] + depth * f;
            far[g] += f * length[g], x_X[g] += f * length_X[g] + slope * s->per_unit[k] * eta_X[g] * length[g];
        }
    }
}

/* Slope and d psi / dx of the surface, and how far it is carried. */
static inline void both(const Lines *s, int cell, const double *eta, const double *psi, v *slope, v *psi_x, v *far)
{
    v x_X[GROUPS];
    along(s, cell, eta, slope);
    along(s, cell, psi, psi_x);
    if (!s->carried[cell])
        return;
    carry(s, cell, eta, slope, far, x_X);
    EACH(g, GROUPS) {
        const v inverse = 1.0 / x_X[g];
        slope[g] *= inverse, psi_x[g] *= inverse;
    }
}

/* Place, height, slope and d psi / dx at the points, [quantity][cell][point]. */
void surface(const Lines *s, const double *eta, const double *psi, double *found)
{
    for (int cell = 0; cell < s->cells; ++cell) {
        v of[4][GROUPS] = {{{0.0}}};
        at_points(s, cell, s->values, eta, 1.0, of[1]);
        both(s, cell, eta, psi, of[2], of[3], of[0]);
        EACH(k, 4)
            memcpy(found + ((long)k * s->cells + cell) * POINTS, of[k], sizeof(double) * POINTS);
        EACH(q, POINTS)
            found[cell * POINTS + q] += s->places[cell * POINTS + q];
    }
}

static inline v larger(v a, v b)
{
    const __typeof__(a > b) which = a > b;
    return (v)(((__typeof__(which))a & which) | ((__typeof__(which))b & ~which));
}

static inline v size(v a)
{
    return larger(a, -a);
}

static inline double highest(v a)
{
    const double one = a[0] > a[1] ? a[0] : a[1], other = a[2] > a[3] ? a[2] : a[3];
    return one > other ? one : other;
}

/* The largest velocity, |psi_x| / (1 + slope^2), and the largest slope. A cell whose psi_x is less has none larger. */
void largest(const Lines *s, const double *eta, const double *psi, double *found)
{
    double fastest = 0.0;
    v steepest = {0.0};
    for (int cell = 0; cell < s->cells; ++cell) {
        v slope[GROUPS], psi_x[GROUPS], far[GROUPS], swift = {0.0};
        both(s, cell, eta, psi, slope, psi_x, far);
        EACH(g, GROUPS) {
            steepest = larger(steepest, size(slope[g]));
            swift = larger(swift, size(psi_x[g]));
        }
        if (highest(swift) > fastest)
            EACH(g, GROUPS) {
                const double fast = highest(size(psi_x[g]) / (1.0 + slope[g] * slope[g]));
                fastest = fast > fastest ? fast : fastest;
            }
    }
    found[0] = fastest, found[1] = highest(steepest);
}
