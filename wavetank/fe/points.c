/* Fields at quadrature points, and what is carried along, of wavetank/fe/surface_points.py; cells.c stands before.

A slope is that along a cell's own direction. Everything at points is [batch][point][lane]. */

typedef struct {
    const stored *given;    /* at the points */
    stored *found;
    int slopes;             /* of what the function says */
} At;

INLINE void look_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    const At *at = what;
    const long place = b * POINTS + q;
    at->found[place] = at->slopes ? u[1] / at->given[PLACES == 1 ? b : place] : u[0];
}

/* A field x, [dof], or its slope, at the points; lengths [batch][place][lane] of cells, infinite of none. */
static void look(const Cells *c, const double *lengths, int slopes, const double *x, double *found)
{
    const At what = {(const stored *)lengths, (stored *)found, slopes};
    EACH(b, c->batches) {
        v X[NODES];
        gather(c, b, 1, x, 1, X);
        through(c, b, DIM, 1, X, 0, X, look_at, &what);
    }
}

INLINE void carry_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    const At *at = what;
    const v velocity = c->weights[q] * at->given[b * POINTS + q];
    r[0] = at->slopes ? velocity * u[1] : zero;
    r[1] = at->slopes ? zero : velocity * u[0];
}

/* y += int V dx/ds v ds for the slopes of x, else int V x dv/ds ds; V is 0 in cells that are none. */
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

/* y += int f v ds. */
static void integrate(const Cells *c, const double *integrand, double *y)
{
    EACH(b, c->batches) {
        v Y[NODES];
        clear(NODES, Y);
        through(c, b, 0, 0, Y, 1, Y, integrate_at, integrand);
        scatter(c, b, 1, Y, y, 1);
    }
}
