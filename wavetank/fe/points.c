/* Fields at quadrature points, and what is carried along, of wavetank/fe/surface_points.py; cells.c stands before.

Everything at points is [batch][point][component][lane], of vectors those in space. */

typedef struct {
    const stored *given;    /* at the points */
    stored *found;
    int slopes;             /* of what the function says */
} At;

INLINE void look_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    const At *at = what;
    const long place = b * POINTS + q;
    v f[1 + GDIM];
    in_space(c, b, q, 1, u, 1, f);
    if (at->slopes)
        EACH(i, GDIM)
            at->found[place * GDIM + i] = f[1 + i];
    else
        at->found[place] = f[0];
}

/* A field x, [dof], or its slopes, at the points. */
static void look(const Cells *c, int slopes, const double *x, double *found)
{
    const At what = {NULL, (stored *)found, slopes};
    EACH(b, c->batches) {
        v X[NODES];
        gather(c, b, 1, x, 1, X);
        through(c, b, DIM, 1, X, 0, X, look_at, &what);
    }
}

INLINE void carry_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    const At *at = what;
    const stored *inverse = inverse_at(c, b, q), *velocity = at->given + (b * POINTS + q) * GDIM;
    const v measure = measure_at(c, b, q);
    r[0] = zero;
    EACH(a, DIM) {
        v along = zero;
        EACH(i, GDIM)
            along += inverse[i * DIM + a] * velocity[i];
        along *= measure;
        r[0] += at->slopes ? along * u[1 + a] : zero;
        r[1 + a] = at->slopes ? zero : along * u[0];
    }
}

/* y += int V . grad x v dX for the slopes of x, else int x V . grad v dX. */
static void carry(const Cells *c, const double *velocity, int slopes, const double *x, double *y)
{
    const At what = {(const stored *)velocity, NULL, slopes};
    EACH(b, c->batches) {
        v X[NODES], Y[NODES];
        gather(c, b, 1, x, 1, X);
        clear(NODES, Y);
        through(c, b, DIM, 1, X, 1, Y, carry_at, &what);
        scatter(c, b, 1, Y, y, 1);
    }
}

INLINE void integrate_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    r[0] = measure_at(c, b, q) * ((const stored *)what)[b * POINTS + q];
}

/* y += int f v dX. */
static void integrate(const Cells *c, const double *integrand, double *y)
{
    EACH(b, c->batches) {
        v Y[NODES];
        clear(NODES, Y);
        through(c, b, 0, 0, Y, 1, Y, integrate_at, integrand);
        scatter(c, b, 1, Y, y, 1);
    }
}
