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

/* Place, height, slope and d psi / dx at the points, [quantity][cell][point]. */
void surface(const Lines *s, const double *eta, const double *psi, double *found)
{
    for (int cell = 0; cell < s->cells; ++cell) {
        v of[4][GROUPS] = {{{0.0}}};
        if (s->carried[cell])
            at_points(s, cell, s->values, s->shift, 1.0, of[0]);
        at_points(s, cell, s->values, eta, 1.0, of[1]);
        both(s, cell, eta, psi, of[2], of[3]);
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

/* Take elevation and potential of masses q that are, bit for bit, those of the point last evaluated, and find their largest
   as above; return whether they are. */
int look(const Lines *s, long dofs, const double *q, const double *p, const double *point, const double *risen,
         double *eta, double *psi, double *found)
{
    const size_t bytes = sizeof(double) * dofs;
    if (memcmp(q, point + 3 * dofs, bytes))
        return 0;
    memcpy(eta, risen, bytes);
    memcpy(psi, p, bytes);
    largest(s, eta, psi, found);
    return 1;
}
