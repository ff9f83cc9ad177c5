/* ==== velocity ==== */
/* The water's velocity at the surface, and what is carried along, of wavetank/fem/surface_points.py; cells.c stands before.

Velocities are [batch][point][axis of space][lane], by how far points are in the reference tank, and times M_J's J.
FIELDS is 3, or 7 where a wall moves: elevation, potential and M_J^-1 dQ/dt, and what surface_points.py says of a wall. */
#include <math.h>

typedef struct {
    double most;
    const double *axis;
    stored *velocity;
    double *fastest;
} Moving;

/* A slope along the axis across the paddle. */
INLINE v across(const Moving *moving, const v *slope)
{
    v sum = zero;
    EACH(i, GDIM)
        sum += slope[i] * moving->axis[i];
    return sum;
}

INLINE void move_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    const Moving *moving = what;
    v f[FIELDS * (1 + GDIM)], velocity[GDIM];   /* with their slopes */
    in_space(c, b, q, FIELDS, u, FIELDS, f);
    v *slope = f + 1, *along = slope + GDIM + 1, rise = f[2 * (1 + GDIM)], square = zero + 1.0, J = square;
#if FIELDS > 3
    const v *shift = along + 2 * (GDIM + 1), speed = shift[GDIM], *flux = shift + 2 * (GDIM + 1), lean = flux[GDIM];
    const v wide = 1.0 + across(moving, shift), up = across(moving, slope) / wide, on = across(moving, along) / wide;
    J = wide - lean * wide * up;
    rise = (rise * J - across(moving, flux)) / wide;
    EACH(i, GDIM)
        slope[i] -= shift[i] * up, along[i] -= shift[i] * on;
#endif
    v upwards = rise;
    EACH(i, GDIM)
        upwards += slope[i] * along[i], square += slope[i] * slope[i];
    upwards /= square;
    EACH(i, GDIM)
        velocity[i] = along[i] - upwards * slope[i];
#if FIELDS > 3
    upwards += lean * across(moving, velocity);
    v aside = (speed + lean * rise) * wide / J;     /* of the mesh; then of the water, as what is squeezed sees it */
    EACH(i, GDIM)
        velocity[i] -= aside * moving->axis[i];
    aside = zero;
    EACH(i, GDIM)
        aside += shift[i] * velocity[i];
    EACH(i, GDIM)
        velocity[i] -= aside / wide * moving->axis[i];
#endif
    EACH(i, GDIM) {
        EACH(l, LANES) {
            velocity[i][l] = fmin(fmax(velocity[i][l], -moving->most), moving->most);
            *moving->fastest = fmax(*moving->fastest, fabs(velocity[i][l]));
        }
        moving->velocity[(b * POINTS + q) * GDIM + i] = velocity[i] * J;
    }
    r[0] = measure_at(c, b, q) * upwards * J;
    clear(DIM, r + 1);
}

/* Of a surface, [dof][field]: the water's horizontal velocity at the points, at most ``most`` along an axis of the mesh, and
   y += int w v dX of the vertical one. Returns the largest of the former. */
SHARED double move(const Cells *c, double most, const double *axis, const double *surface, double *velocity, double *y)
{
    double fastest = 0.0;
    const Moving what = {most, axis, (stored *)velocity, &fastest};
    EACH(b, c->batches) {
        v X[NODES * FIELDS], Y[NODES];
        gather(c, b, FIELDS, surface, FIELDS, X);
        clear(NODES, Y);
        through(c, b, DIM, FIELDS, X, 1, Y, move_at, &what);
        scatter(c, b, 1, Y, y, 1);
    }
    return fastest;
}

typedef struct {
    const stored *velocity;
    int slopes;             /* of what the function says */
} Carried;

INLINE void carry_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    const Carried *carried = what;
    const stored *inverse = inverse_at(c, b, q), *velocity = carried->velocity + (b * POINTS + q) * GDIM;
    const v measure = measure_at(c, b, q);
    r[0] = zero;
    EACH(a, DIM) {
        v along = zero;
        EACH(i, GDIM)
            along += inverse[i * DIM + a] * velocity[i];
        along *= measure;
        r[0] += carried->slopes ? along * u[1 + a] : zero;
        r[1 + a] = carried->slopes ? zero : along * u[0];
    }
}

/* y += int V . grad x v dX for the slopes of x, else int x V . grad v dX. */
SHARED void carry(const Cells *c, const double *velocity, int slopes, const double *x, double *y)
{
    const Carried what = {(const stored *)velocity, slopes};
    EACH(b, c->batches) {
        v X[NODES], Y[NODES];
        gather(c, b, 1, x, 1, X);
        clear(NODES, Y);
        through(c, b, DIM, 1, X, 1, Y, carry_at, &what);
        scatter(c, b, 1, Y, y, 1);
    }
}

/* ==== profile ==== */
/* Slopes and velocities of a surface along a slice, of wavetank/tank/surface_flow.py: of LANES cells at a time.

NODES, POINTS   of a cell
DEGREE          of paddles' shapes, the highest */
typedef struct {
    int batches, cells, paddles;
    const int *dofs, *carried;
    const double *values, *slopes, *per_metre, *places, *powers, *per_unit;
    const double **lengths;
} Lines;

typedef double v __attribute__((vector_size(sizeof(double) * LANES)));
typedef double stored __attribute__((vector_size(sizeof(double) * LANES), aligned(sizeof(double))));

#define UNROLLED(i, most) _Pragma("GCC unroll 32") for (int i = 0; i < (most); ++i)

/* Two fields, given at the degrees of freedom, at the nodes. */
INLINE void gather(const Lines *s, int b, const double *one, const double *other, v at_nodes[2][NODES])
{
    UNROLLED(i, NODES)
        UNROLLED(l, LANES) {
            const int dof = s->dofs[(b * NODES + i) * LANES + l];
            ((double *)&at_nodes[0][i])[l] = one[dof], ((double *)&at_nodes[1][i])[l] = other[dof];
        }
}

/* These at the points, by a table of values, or of slopes in the cell's own coordinate. */
INLINE void at_points(const double *table, const v at_nodes[2][NODES], v *one, v *other)
{
    UNROLLED(q, POINTS) {
        one[q] = other[q] = (v){0.0};
        UNROLLED(i, NODES)
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
    UNROLLED(q, POINTS)
        per_metre[q] = ((const stored *)s->per_metre)[b], far[q] = (v){0.0}, x_X[q] = far[q] + 1.0;
    if (s->carried[b]) {
        for (int k = 0; k < s->paddles; ++k) {
            const double *powers = s->powers + k * (DEGREE + 1), per_unit = s->per_unit[k];
            gather(s, b, s->lengths[k], s->lengths[k], at_nodes);
            at_points(s->values, at_nodes, length, unused);
            at_points(s->slopes, at_nodes, length_X, unused);
            UNROLLED(q, POINTS) {
                v f = powers[DEGREE] + (v){0.0}, f_z = {0.0};
                for (int one = DEGREE - 1; one >= 0; --one)
                    f_z = f + height[q] * per_unit * f_z, f = powers[one] + height[q] * per_unit * f;
                far[q] += f * length[q];
                x_X[q] += (f * length_X[q] + f_z * per_unit * slope[q] * length[q]) * per_metre[q];
            }
        }
        UNROLLED(q, POINTS)
            per_metre[q] /= x_X[q];
    }
    UNROLLED(q, POINTS)
        slope[q] *= per_metre[q], psi_x[q] *= per_metre[q];
}

/* Place, height, slope and d psi / dx at the points, [quantity][cell][point]. */
SHARED void surface(const Lines *s, const double *eta, const double *psi, double *found)
{
    for (int b = 0; b < s->batches; ++b) {
        v of[4][POINTS];
        find(s, b, eta, psi, of[0], of[1], of[2], of[3]);
        for (int l = 0; l < LANES && b * LANES + l < s->cells; ++l) {
            const long at = (b * LANES + l) * POINTS;
            UNROLLED(k, 4)
                UNROLLED(q, POINTS)
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
    UNROLLED(l, LANES)
        most = a[l] > most ? a[l] : most;
    return most;
}

/* The largest velocity, |psi_x| / (1 + slope^2), and the largest slope. Cells whose psi_x is less have none larger. */
SHARED void largest(const Lines *s, const double *eta, const double *psi, double *found)
{
    double fastest = 0.0;
    v steepest = {0.0};
    for (int b = 0; b < s->batches; ++b) {
        v far[POINTS], height[POINTS], slope[POINTS], psi_x[POINTS], swift = {0.0}, fast = {0.0};
        find(s, b, eta, psi, far, height, slope, psi_x);
        UNROLLED(q, POINTS)
            steepest = larger(steepest, size(slope[q])), swift = larger(swift, size(psi_x[q]));
        if (highest(swift) > fastest) {
            UNROLLED(q, POINTS)
                fast = larger(fast, size(psi_x[q]) / (1.0 + slope[q] * slope[q]));
            fastest = highest(fast) > fastest ? highest(fast) : fastest;
        }
    }
    found[0] = fastest, found[1] = highest(steepest);
}
