/* A mass matrix without matrix, of wavetank/fem/mass.py; cells.c stands before.

FIELDS          that its density depends on */
#define OF_FIELDS ((1 + GDIM) * FIELDS)

typedef struct {
    const double *constants;
    stored *weights;
} Weights;

INLINE void weigh_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    const Weights *weights = what;
    const double *constants = weights->constants;
    v f[OF_FIELDS + 1], density;
    in_space(c, b, q, FIELDS, u, FIELDS, f);
    DENSITY
    weights->weights[b * POINTS + q] = measure_at(c, b, q) * density;
}

/* The density at the points for fields [dof][field], times all weights: weights[batch][point][lane]. */
static void weigh(const Cells *c, const double *constants, const double *fields, double *weights)
{
    const Weights what = {constants, (stored *)weights};
    EACH(b, c->batches) {
        v X[NODES * FIELDS + 1];
        gather(c, b, FIELDS, fields, FIELDS, X);
        through(c, b, DIM, FIELDS, X, 0, X, weigh_at, &what);
    }
}

INLINE void multiply_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    r[0] = ((const stored *)what)[b * POINTS + q] * u[0];
}

/* y += M x. */
static void multiply(const Cells *c, const double *weights, const double *x, double *y)
{
    EACH(b, c->batches) {
        v X[NODES], Y[NODES];
        gather(c, b, 1, x, 1, X);
        clear(NODES, Y);
        through(c, b, 0, 1, X, 1, Y, multiply_at, weights);
        scatter(c, b, 1, Y, y, 1);
    }
}

typedef struct {
    const double *weights;
    v sum;
} Squares;

INLINE void square_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    Squares *squares = (Squares *)what;
    squares->sum += ((const stored *)squares->weights)[b * POINTS + q] * (u[0] * u[0]);
}

/* x M x. */
static double square(const Cells *c, const double *weights, const double *x)
{
    Squares squares = {weights};
    double sum = 0.0;
    EACH(b, c->batches) {
        v X[NODES];
        gather(c, b, 1, x, 1, X);
        through(c, b, 0, 1, X, 0, X, square_at, &squares);
    }
    EACH(l, LANES)
        sum += squares.sum[l];
    return sum;
}

/* y += the diagonal of M. */
static void diagonal(const Cells *c, const double *weights, double *y)
{
    const double *squares = c->squares + DIM * (DIM + 1) / 2 * POINTS * NODES;
    EACH(b, c->batches) {
        v Y[NODES];
        clear(NODES, Y);
        EACH(q, POINTS)
            EACH(i, NODES)
                Y[i] += squares[q * NODES + i] * ((const stored *)weights)[(long)b * POINTS + q];
        scatter(c, b, 1, Y, y, 1);
    }
}

/* y += scale K x, cell by cell, K[node][node] or its factor along each edge; scale[batch][lane]. */
static void cellwise(const Cells *c, const double *K, const double *scale, const double *x, double *y)
{
    EACH(b, c->batches) {
        const v s = ((const stored *)scale)[b];
        v X[NODES], Y[NODES];
        gather(c, b, 1, x, 1, X);
        clear(NODES, Y);
#if SIDE
        v T[NODES];
        clear(NODES, T);
        EACH(i, SIDE)
            EACH(k, SIDE)
                EACH(j, SIDE)
                    T[i * SIDE + k] += K[i * SIDE + j] * X[j * SIDE + k];
        EACH(i, SIDE)
            EACH(k, SIDE)
                EACH(j, SIDE)
                    Y[i * SIDE + k] += K[k * SIDE + j] * T[i * SIDE + j];
#else
        EACH(i, NODES)
            EACH(j, NODES)
                Y[i] += K[i * NODES + j] * X[j];
#endif
        EACH(i, NODES)
            Y[i] *= s;
        scatter(c, b, 1, Y, y, 1);
    }
}
