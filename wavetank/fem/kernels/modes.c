/* ==== average ==== */
/* Second derivatives of a layer's energy, averaged over the depth; follows the section layer.

MEANS           second derivatives without those that couple u and w: DIM (DIM + 1) / 2 + 1 */
INLINE void average_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    const void *const *both = what;
    const Layers *layers = both[0];
    stored *mean = (stored *)both[1] + (b * POINTS + q) * MEANS;
    v f[OF_FIELDS], k[HESSIANS];
    in_space(c, b, q, FIELDS, u, FIELDS, f);
    EACH(z, LEVELS) {
        second(c, layers, b, q, z, f, k);
        EACH(i, MEANS)
            mean[i] = (z ? mean[i] : zero) + k[i < MEANS - 1 ? i : HESSIANS - 1];
    }
}

/* Compute these averages: out[batch][point][uu ..., ww][lane]. */
SHARED void average(const Cells *c, const Layers *layers, const REAL *fields, REAL *out)
{
    const void *what[] = {layers, out};
    over_cells(c, DIM, (Given){fields, FIELDS, FIELDS}, (Given){0}, 0, NULL, 0, average_at, what);
}

/* ==== slice ==== */
/* Decoupled modes of a slice or ring, of wavetank/fem/along.py; follows the section banded. */

/* x <- sum over modes j of s_j A_j^-1 s_j r, both [degree of freedom]; s[group][mode]. */
SHARED void respond(const Chain *c, const REAL *s, const double *r, double *x, REAL *work)
{
    abreast *rows = (abreast *)work;
    const abreast *shares = (const abreast *)s;
    EACH(i, c->dofs)
        EACH(g, GROUPS)
            rows[(long)c->row[i] * GROUPS + g] = shares[g] * (REAL)r[i];
    solve_chain(c, rows, rows);
    EACH(i, c->dofs) {
        abreast parts = {0.0};
        EACH(g, GROUPS)
            parts += shares[g] * rows[(long)c->row[i] * GROUPS + g];
        x[i] = 0.0;
        EACH(j, ABREAST)
            x[i] += parts[j];
    }
}

/* ==== correction ==== */
/* Interior potentials of a slice or ring, of wavetank/fem/along.py; follows layers.c and the section slice.

MODES           vertical modes; a chain has a matrix for each

A correction to a potential is in single precision, its residual in double precision. */
#define ROW (GROUPS * ABREAST)  /* modes of a row, padded to complete groups */
#define ENOUGH 1e-10            /* reduction of the residual's energy at which a new residual is computed */
#define ROUND_OFF 1e-13         /* least reduction in single precision */
#define FEW 256                 /* products that are summed in single precision */
#define CLOSING 8.0             /* error after a correction by the preconditioner alone, over that after an iteration */

/* y += A x for interior x, [row][mode]; by_surface, [row], is the contribution to the row of the surface potential. */
SHARED void product_within(const Cells *c, const Layers *layers, const REAL *state, const REAL *x, REAL *y,
                           REAL *by_surface)
{
    const Multiplied what = {layers, state};
    EACH(b, c->batches) {
        v X[NODES * MODES], Y[NODES * NUMBERS];
        gather(c, b, MODES, x, ROW, X, MODES);
        clear(NODES * NUMBERS, Y);
        through(c, b, DIM, MODES, X, NUMBERS, Y, within_at, &what);
        scatter(c, b, MODES, Y, NUMBERS, y, ROW);
        scatter(c, b, 1, Y + MODES, NUMBERS, by_surface, 1);
    }
}

INLINE void surface_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    multiply(what, c, b, q, MODES, MODES, u, r);
}

/* The same, for the row of the surface potential only. */
SHARED void surface_within(const Cells *c, const Layers *layers, const REAL *state, const REAL *x, REAL *by_surface)
{
    const Multiplied what = {layers, state};
    over_cells(c, DIM, (Given){x, MODES, ROW}, (Given){0}, 1, by_surface, 1, surface_at, &what);
}

SHARED double inner(long size, const REAL *restrict a, const REAL *restrict b)
{
    double sum = 0.0;
    for (long begin = 0; begin < size; begin += FEW) {
        const long end = begin + FEW < size ? begin + FEW : size;
        REAL part = 0.0;
        for (long i = begin; i < end; ++i)
            part += a[i] * b[i];
        sum += part;
    }
    return sum;
}

/* Conjugate gradients: correct the interior part of phi, [degree of freedom][component], for its last column, the surface
   potential, and the load of the wall, [degree of freedom][component] of that stride. ``image`` is A phi; its last column is
   updated. Iterations end if the residual's energy is below tolerance² times that of phi, or reduced by ENOUGH, after which a
   new residual is needed. If the preconditioner applied to the last residual is accurate enough, it is added without a further
   product. Returns the iterations; -1 if ``most`` are not enough; -2 if A or the modes are not positive. ``steps`` has step
   lengths and coefficients of directions; ``found`` has phi A phi and the residual's energy over its target. */
SHARED int correct(const Cells *cells, const Layers *layers, const REAL *state, const Chain *c, const double *wall,
                   int stride, double *restrict phi, double *restrict image, double tolerance, int most, double *steps,
                   double *found, REAL *work)
{
    const long size = (long)c->dofs * ROW;
    REAL *restrict r = work, *restrict p = r + size, *restrict x = p + size, *restrict flow = x + size;
    REAL *restrict by_surface = flow + c->dofs, *restrict Ap = by_surface + c->dofs, *restrict z = Ap + size;
    double kinetic = 0.0, length = 0.0;
    for (long i = 0; i < (long)c->dofs * NUMBERS; ++i)
        kinetic += phi[i] * image[i];
    memset(work, 0, sizeof(REAL) * (3 * size + c->dofs));    /* r, p, x, flow */
    for (long i = 0; i < c->dofs; ++i)
        EACH(j, MODES)
            r[(long)c->row[i] * ROW + j] = -(image[i * NUMBERS + j] + wall[i * stride + j]);
    for (long i = 0; i < size; ++i)
        length += (double)r[i] * r[i];
    found[0] = kinetic, found[1] = 0.0;
    if (length == 0.0)
        return 0;
    const double scale = 1.0 / sqrt(length), back = sqrt(length);
    for (long i = 0; i < size; ++i)
        r[i] = (REAL)(scale * r[i]);    /* 1 / 1e-39 is infinite in single precision */
    double target = 0.0, before = 0.0, first = 0.0, rz, left;
    int iterations = 0, closes = 0;
    for (;; ++iterations) {
        solve_chain(c, (const abreast *)r, (abreast *)z);
        rz = left = inner(size, r, z);
        const double beta = iterations ? rz / before : 0.0;
        if (rz < 0.0)
            return -2;
        if (iterations) {
            steps[2 * iterations - 1] = beta;
            closes = rz > target && CLOSING * beta * rz <= target;
            left = closes ? CLOSING * beta * rz : rz;
        } else
            first = rz, target = tolerance * tolerance * (kinetic * scale * scale + rz);
        if (closes || !(rz > target && rz > ENOUGH * first))
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
    memset(by_surface, 0, sizeof(REAL) * c->dofs);
    if (closes)
        surface_within(cells, layers, state, z, by_surface);
    const double closing = closes ? back : 0.0;
    double by_mode[MODES] = {0.0};
    kinetic = closing * closing * rz;   /* approximates z A z, since z approximates A^-1 r */
    for (long i = 0; i < c->dofs; ++i) {
        const long row = c->row[i];
        const double before_closing = image[i * NUMBERS + MODES] + back * flow[row];
        EACH(j, MODES) {
            const double x_now = phi[i * NUMBERS + j] + back * x[row * ROW + j], more = closing * z[row * ROW + j];
            by_mode[j] += (x_now + 2.0 * more) * (back * r[row * ROW + j] + wall[i * stride + j]);
            phi[i * NUMBERS + j] = x_now + more;
        }
        kinetic += phi[i * NUMBERS + MODES] * before_closing;
        image[i * NUMBERS + MODES] = before_closing + closing * by_surface[row];
    }
    EACH(j, MODES)
        kinetic -= by_mode[j];
    const double floor = iterations ? ROUND_OFF * first : 0.0;
    found[0] = kinetic, found[1] = (left > floor ? left : floor) / target;
    return iterations;
}

/* ==== basin ==== */
/* The decoupled modes of wavetank/fem/order_multigrid.py; follows the section average.

FEW             modes in one loop */
typedef struct {
    const stored *averages;
    const REAL *lambda;
    int few;
} Modes;

INLINE void mode_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    const Modes *m = what;
    const stored *mean = m->averages + (b * POINTS + q) * MEANS;
    const int few = m->few;
    EACH(j, few) {
        const stored *uu = mean;
        EACH(a, DIM) {
            r[(1 + a) * few + j] = zero;
            EACH(d, a + 1) {
                r[(1 + a) * few + j] += *uu * u[(1 + d) * few + j];
                if (d < a)
                    r[(1 + d) * few + j] += *uu * u[(1 + a) * few + j];
                ++uu;
            }
        }
        r[j] = m->lambda[j] * mean[MEANS - 1] * u[j];
    }
}

INLINE void some_modes(int few, const Cells *c, long b, const REAL *averages, const REAL *lambda, int stride,
                       const REAL *x, REAL *y)
{
    const Modes what = {(const stored *)averages, lambda, few};
    v X[NODES * FEW], Y[NODES * FEW];
    gather(c, b, few, x, stride, X, few);
    clear(NODES * few, Y);
    through(c, b, DIM, few, X, few, Y, mode_at, &what);
    scatter(c, b, few, Y, few, y, stride);
}

/* y += (S_u + lambda_j S_w) x_j, [dof][mode] with rows of ``stride``, for the first ``many`` modes j. */
SHARED void multiply(const Cells *c, const REAL *averages, const REAL *lambda, int many, int stride, const REAL *x, REAL *y)
{
    EACH(b, c->batches) {
        for (int j = 0; j < many; j += FEW)
            switch (many - j) {  /* constant numbers of modes, known to the compiler */
            case 1: some_modes(1, c, b, averages, lambda + j, stride, x + j, y + j); break;
            case 2: some_modes(2, c, b, averages, lambda + j, stride, x + j, y + j); break;
            case 3: some_modes(3, c, b, averages, lambda + j, stride, x + j, y + j); break;
            default: some_modes(FEW, c, b, averages, lambda + j, stride, x + j, y + j);
            }
    }
}

/* r -= Ad, d = keep d + take r / D, x += d, all [dof][mode], keep[mode] and take[mode], D = diagonals[dof][2] of S_u and
   S_w. Subnormal numbers, which are slow, are set to zero. */
INLINE void smooth_rows(long rows, const REAL *restrict diagonals, const REAL *lambda, const REAL *keep, const REAL *take,
                        int many, const REAL *restrict Ad, REAL *restrict r, REAL *restrict d, REAL *restrict x)
{
    for (long i = 0; i < rows; ++i)
        EACH(j, many) {
            const long k = i * many + j;
            const REAL residual = r[k] - Ad[k];
            r[k] = residual > NOTHING || residual < -NOTHING ? residual : 0;
            d[k] = keep[j] * d[k] + take[j] * r[k] / (diagonals[2 * i] + lambda[j] * diagonals[2 * i + 1]);
            x[k] += d[k];
        }
}

SHARED void smooth(long rows, const REAL *diagonals, const REAL *lambda, const REAL *keep, const REAL *take, int many,
                   const REAL *Ad, REAL *r, REAL *d, REAL *x)
{
    if (many == NUMBERS)
        smooth_rows(rows, diagonals, lambda, keep, take, NUMBERS, Ad, r, d, x);
    else
        smooth_rows(rows, diagonals, lambda, keep, take, NUMBERS - 1, Ad, r, d, x);
}

/* fine += P coarse, or coarse += P' fine, with a sparse P; fine[row][stride], coarse[column][mode], for the first modes. */
SHARED void transfer(int to_fine, long rows, const int *pointers, const int *columns, const REAL *entries, int many,
                     int stride, REAL *fine, REAL *coarse)
{
    EACH(i, rows)
        for (int k = pointers[i]; k < pointers[i + 1]; ++k) {
            REAL *restrict f = fine + i * stride, *restrict c = coarse + (long)columns[k] * many;
            EACH(j, many)
                *(to_fine ? f + j : c + j) += entries[k] * (to_fine ? c[j] : f[j]);
        }
}
