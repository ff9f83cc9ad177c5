/* The water's velocity at the surface, and what is carried along, of wavetank/fe/surface_points.py; cells.c stands before.

Velocities are [batch][point][axis of space][lane]. */
#include <math.h>

typedef struct {
    double most;
    stored *velocity;
    double *fastest;
} Moving;

INLINE void move_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    const Moving *moving = what;
    v f[3 * (1 + GDIM)];    /* elevation, potential and rise, with their slopes */
    in_space(c, b, q, 3, u, 3, f);
    const v *slope = f + 1, *along = f + 1 + GDIM + 1;
    v upwards = f[2 * (1 + GDIM)], square = zero + 1.0;
    EACH(i, GDIM)
        upwards += slope[i] * along[i], square += slope[i] * slope[i];
    upwards /= square;
    EACH(i, GDIM) {
        v velocity = along[i] - upwards * slope[i];
        EACH(l, LANES) {
            velocity[l] = fmin(fmax(velocity[l], -moving->most), moving->most);
            *moving->fastest = fmax(*moving->fastest, fabs(velocity[l]));
        }
        moving->velocity[(b * POINTS + q) * GDIM + i] = velocity;
    }
    r[0] = measure_at(c, b, q) * upwards;
    clear(DIM, r + 1);
}

/* Of a surface, [dof][elevation, potential, rise]: the water's horizontal velocity at the points, at most ``most`` along an
   axis, and y += int w v dX of the vertical one. Returns the largest of the former. */
static double move(const Cells *c, double most, const double *surface, double *velocity, double *y)
{
    double fastest = 0.0;
    const Moving what = {most, (stored *)velocity, &fastest};
    EACH(b, c->batches) {
        v X[NODES * 3], Y[NODES];
        gather(c, b, 3, surface, 3, X);
        clear(NODES, Y);
        through(c, b, DIM, 3, X, 1, Y, move_at, &what);
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
static void carry(const Cells *c, const double *velocity, int slopes, const double *x, double *y)
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
