/* Slopes and velocities of a surface along a slice, of wavetank/water/surface_flow.py.

NODES, POINTS   of a cell, the points in GROUPS of four */
#include <string.h>

typedef double v __attribute__((vector_size(32)));
typedef double stored __attribute__((vector_size(32), aligned(8)));

#define EACH(i, most) _Pragma("GCC unroll 16") for (int i = 0; i < (most); ++i)

/* Slopes in the reference tank of a field, given at the degrees of freedom, at the points of a cell. */
static inline void along(const Lines *s, int cell, const double *rows, v *found)
{
    EACH(g, GROUPS)
        found[g] = (v){0.0};
    EACH(i, NODES) {
        const double one = rows[s->dofs[cell * NODES + i]] * s->stretched[cell];
        EACH(g, GROUPS)
            found[g] += ((const stored *)s->slopes)[i * GROUPS + g] * one;
    }
}

/* What two such slopes are multiplied by where the wall has carried the water: x = X + shift, 1 / x_X. */
static inline void carried(const Lines *s, int cell, v *one, v *other)
{
    v shift[GROUPS];
    along(s, cell, s->shift, shift);
    EACH(g, GROUPS) {
        const v inverse = 1.0 / (1.0 + shift[g]);
        one[g] *= inverse, other[g] *= inverse;
    }
}

static inline void both(const Lines *s, int cell, const double *eta, const double *psi, v *slope, v *psi_x)
{
    along(s, cell, eta, slope);
    along(s, cell, psi, psi_x);
    if (s->carried[cell])
        carried(s, cell, slope, psi_x);
}

/* Slope and d psi / dx at the points, [cell][point] each. */
void slopes(const Lines *s, const double *eta, const double *psi, double *slope, double *psi_x)
{
    for (int cell = 0; cell < s->cells; ++cell) {
        v of_eta[GROUPS], of_psi[GROUPS];
        both(s, cell, eta, psi, of_eta, of_psi);
        memcpy(slope + cell * POINTS, of_eta, sizeof(double) * POINTS);
        memcpy(psi_x + cell * POINTS, of_psi, sizeof(double) * POINTS);
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
        v slope[GROUPS], psi_x[GROUPS], swift = {0.0};
        both(s, cell, eta, psi, slope, psi_x);
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
