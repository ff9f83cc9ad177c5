/* Interior potentials along a slice or ring, of wavetank/fe/along.py; layers.c and decoupled.c stand before.

MODES           vertical modes; a chain is a matrix for each of them

All is of single precision: a correction to a potential, whose residual is of double precision. */
#define ROW (GROUPS * ABREAST)  /* a row's modes, and what fills the last group */
#define ENOUGH 1e-10            /* of a residual's energy: then it is found anew */
#define ROUND_OFF 1e-13         /* of it: so much of single precision is left */

/* y += A x of interior x, [row][mode]; by_surface, [row], is the surface potential's share. */
static void product_within(const Cells *c, const Layers *layers, const REAL *state, const REAL *x, REAL *y,
                           REAL *by_surface)
{
    const Multiplied what = {layers, state};
    EACH(b, c->batches) {
        v X[NODES * MODES], Y[NODES * NUMBERS];
        gather(c, b, MODES, x, ROW, X);
        clear(NODES * NUMBERS, Y);
        through(c, b, DIM, MODES, X, NUMBERS, Y, within_at, &what);
        EACH(i, NODES)
            EACH(l, LANES) {
                const long row = c->dofs[(b * NODES + i) * LANES + l];
                EACH(j, MODES)
                    y[row * ROW + j] += Y[i * NUMBERS + j][l];
                by_surface[row] += Y[i * NUMBERS + MODES][l];
            }
    }
}

static double inner(long size, const REAL *restrict a, const REAL *restrict b)
{
    double sum = 0.0;
    for (long i = 0; i < size; i += ROW) {
        REAL part = 0.0;
        EACH(j, ROW)
            part += a[i + j] * b[i + j];
        sum += part;
    }
    return sum;
}

typedef struct {
    double kinetic;     /* phi A phi */
    double residual;    /* its energy over that wanted */
} Found;

/* Conjugate gradients: correct the interior part of phi, [degree of freedom][number], for its last column, the surface
   potential, and what the wall adds, [degree of freedom] of that stride [number]. ``image`` is A phi, and becomes that of
   the new phi in its last column. The residual's energy is to fall below tolerance² that of phi, or to ENOUGH of what it
   was, when a new residual is needed. Returns the iterations, -1 where ``most`` are not enough, -2 where A or the modes
   are not positive; ``steps`` has the length of each and how much of its direction the next keeps. */
static int correct(const Cells *cells, const Layers *layers, const REAL *state, const Chain *c, const double *wall,
                   int stride, double *restrict phi, double *restrict image, double tolerance, int most, double *steps,
                   Found *found, REAL *work)
{
    const long size = (long)c->dofs * ROW;
    REAL *restrict p = work, *restrict Ap = p + size, *restrict r = Ap + size, *restrict z = r + size;
    REAL *restrict x = z + size, *restrict flow = x + size, *restrict by_surface = flow + c->dofs;
    double kinetic = 0.0, length = 0.0;
    for (long i = 0; i < c->dofs; ++i) {
        EACH(j, NUMBERS)
            kinetic += phi[i * NUMBERS + j] * image[i * NUMBERS + j];
        EACH(j, MODES) {
            const double left = image[i * NUMBERS + j] + wall[i * stride + j];
            length += left * left;
        }
    }
    *found = (Found){kinetic, 0.0};
    if (length == 0.0)
        return 0;
    const double scale = 1.0 / sqrt(length);
    memset(work, 0, sizeof(REAL) * (5 * size + 2 * c->dofs));
    for (long i = 0; i < c->dofs; ++i)
        EACH(j, MODES)
            r[(long)c->row[i] * ROW + j] = -scale * (image[i * NUMBERS + j] + wall[i * stride + j]);
    double target = 0.0, before = 0.0, first = 0.0;
    int iterations = 0;
    for (;; ++iterations) {
        solve_chain(c, (const abreast *)r, (abreast *)z);
        const double rz = inner(size, r, z), beta = iterations ? rz / before : 0.0;
        if (iterations)
            steps[2 * iterations - 1] = beta;
        else
            first = rz, target = tolerance * tolerance * (kinetic * scale * scale + rz);
        found->residual = (iterations && rz < ROUND_OFF * first ? ROUND_OFF * first : rz) / target;
        if (rz < 0.0)
            return -2;
        if (!(rz > target && rz > ENOUGH * first))
            break;
        if (iterations == most)
            return -1;
        for (long i = 0; i < size; ++i)
            p[i] = z[i] + (REAL)beta * p[i];
        memset(Ap, 0, sizeof(REAL) * size);
        memset(by_surface, 0, sizeof(REAL) * c->dofs);
        product_within(cells, layers, state, p, Ap, by_surface);
        const double bend = inner(size, p, Ap), alpha = rz / bend;
        if (!(bend > 0.0))
            return -2;
        for (long i = 0; i < size; ++i)
            x[i] += (REAL)alpha * p[i], r[i] -= (REAL)alpha * Ap[i];
        for (long i = 0; i < c->dofs; ++i)
            flow[i] += (REAL)alpha * by_surface[i];
        steps[2 * iterations] = alpha, before = rz;
    }
    const double back = 1.0 / scale;
    kinetic = 0.0;
    for (long i = 0; i < c->dofs; ++i) {
        const long row = c->row[i];
        EACH(j, MODES) {
            phi[i * NUMBERS + j] += back * x[row * ROW + j];
            kinetic -= phi[i * NUMBERS + j] * (back * r[row * ROW + j] + wall[i * stride + j]);
        }
        image[i * NUMBERS + MODES] += back * flow[row];
        kinetic += phi[i * NUMBERS + MODES] * image[i * NUMBERS + MODES];
    }
    found->kinetic = kinetic;
    return iterations;
}
