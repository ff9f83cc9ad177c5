/* ==== velocity ==== */
/* Velocity at the surface, and advection by it, of wavetank/fem/surface_points.py; follows cells.c.

Velocities are [batch][point][axis of space][lane], those of points in the reference tank, times J of M_J.
FIELDS is 3: elevation, potential and M_J^-1 dQ/dt; or 7 with a moving wall, see surface_points.py. */

typedef struct {
    double most;
    const double *axis;
    stored *velocity;
    double *fastest;
} Moving;

/* The component of a slope normal to the paddle. */
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
    v f[FIELDS * (1 + GDIM)], velocity[GDIM];   /* fields with slopes */
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
    v aside = (speed + lean * rise) * wide / J;     /* velocity of the mesh; then that of the water in reference coordinates */
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

/* Set the horizontal velocity at the points of a surface, [dof][field], limited to ``most`` along each axis of the mesh;
   y += int w v dX for the vertical velocity w. Returns the largest horizontal component. */
SHARED double move(const Cells *c, double most, const double *axis, const double *surface, double *velocity, double *y)
{
    double fastest = 0.0;
    const Moving what = {most, axis, (stored *)velocity, &fastest};
    over_cells(c, DIM, (Given){surface, FIELDS, FIELDS}, (Given){0}, 1, y, 1, move_at, &what);
    return fastest;
}

typedef struct {
    const stored *velocity;
    int slopes;             /* terms of the function */
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

/* y += int V . grad x v dX if ``slopes``, else int x V . grad v dX. */
SHARED void carry(const Cells *c, const double *velocity, int slopes, const double *x, double *y)
{
    const Carried what = {(const stored *)velocity, slopes};
    over_cells(c, DIM, (Given){x, 1, 1}, (Given){0}, 1, y, 1, carry_at, &what);
}

/* ==== largest ==== */
/* Largest velocity and slope of a surface at points of cells, of wavetank/tank/surface_flow.py; follows cells.c.

FIELDS          fields of the densities
SQUARES         sets the squares of the slope and of the gradient of psi, from UFL */
typedef struct {
    const double *constants;
    v fast, steep;              /* the largest squares so far */
} Largest;

INLINE v larger(v a, v b)
{
    const __typeof__(a > b) is_larger = a > b;
    return (v)(((__typeof__(is_larger))a & is_larger) | ((__typeof__(is_larger))b & ~is_larger));
}

INLINE void largest_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    Largest *most = (Largest *)what;
    UNUSED const double *constants = most->constants;
    v f[(1 + GDIM) * FIELDS], slope, psi;
    in_space(c, b, q, FIELDS, u, FIELDS, f);
    SQUARES
    most->steep = larger(slope, most->steep);
    most->fast = larger(psi / ((1.0 + slope) * (1.0 + slope)), most->fast);
}

/* The largest |grad psi| / (1 + slope^2), and the largest slope. */
SHARED void largest(const Mass *surface, double *found)
{
    Largest most = {.constants = surface->constants};
    interlace(FIELDS, surface->dofs, surface->fields, surface->rows);
    over_cells(surface->cells, DIM, (Given){surface->rows, FIELDS, FIELDS}, (Given){0}, 0, NULL, 0, largest_at, &most);
    found[0] = found[1] = 0.0;
    EACH(l, LANES)
        found[0] = fmax(found[0], sqrt(most.fast[l])), found[1] = fmax(found[1], sqrt(most.steep[l]));
}
