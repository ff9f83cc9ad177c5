/* The decoupled modes of wavetank/fe/order_multigrid.py; layer.c stands before.

MEANS           second derivatives that do not couple u and w: DIM (DIM + 1) / 2 + 1
FEW             modes that are in work at a time */
INLINE void average_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    const void *const *both = what;
    const Layers *layers = both[0];
    stored *mean = (stored *)both[1] + (b * POINTS + q) * MEANS;
    v f[OF_FIELDS], sum[MEANS];
    in_space(c, b, q, FIELDS, u, FIELDS, f);
    clear(MEANS, sum);
    EACH(z, LEVELS) {
        v k[HESSIANS];
        second(c, layers, b, q, z, f, k);
        EACH(i, MEANS - 1)
            sum[i] += k[i];
        sum[MEANS - 1] += k[HESSIANS - 1];
    }
    EACH(i, MEANS)
        mean[i] = sum[i];
}

/* The second derivatives averaged over the depth, without those that couple u and w: out[batch][point][uu ..., ww][lane]. */
static void average(const Cells *c, const Layers *layers, const REAL *fields, REAL *out)
{
    const void *what[] = {layers, out};
    EACH(b, c->batches) {
        v X[NODES * FIELDS];
        gather(c, b, FIELDS, fields, FIELDS, X);
        through(c, b, DIM, FIELDS, X, 0, X, average_at, what);
    }
}

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

INLINE void some_modes(const Cells *c, long b, const REAL *averages, const REAL *lambda, int few, int many, const REAL *x,
                       REAL *y)
{
    const Modes what = {(const stored *)averages, lambda, few};
    v X[NODES * FEW], Y[NODES * FEW];
    gather(c, b, few, x, many, X);
    clear(NODES * few, Y);
    through(c, b, DIM, few, X, few, Y, mode_at, &what);
    scatter(c, b, few, Y, y, many);
}

/* y += (S_u + lambda_j S_w) x_j, [dof][mode], for ``many`` modes j: those of the interior, or one more. */
static void multiply(const Cells *c, const REAL *averages, const REAL *lambda, int many, const REAL *x, REAL *y)
{
    EACH(b, c->batches) {
        int j = 0;
        for (; j + FEW <= many; j += FEW)
            some_modes(c, b, averages, lambda + j, FEW, many, x + j, y + j);
        if (many == NUMBERS)
            some_modes(c, b, averages, lambda + j, NUMBERS % FEW, many, x + j, y + j);
        else
            some_modes(c, b, averages, lambda + j, (NUMBERS - 1) % FEW, many, x + j, y + j);
    }
}

/* y += the diagonals of S_u and S_w, [dof][2]. */
static void diagonals(const Cells *c, const REAL *averages, REAL *y)
{
    EACH(b, c->batches) {
        v Y[NODES * 2];
        clear(NODES * 2, Y);
        EACH(q, POINTS)
            EACH(k, MEANS) {
                const v mean = ((const stored *)averages)[((long)b * POINTS + q) * MEANS + k];
                EACH(i, NODES)
                    Y[i * 2 + (k == MEANS - 1)] += c->squares[(k * POINTS + q) * NODES + i] * mean;
            }
        scatter(c, b, 2, Y, y, 2);
    }
}

/* r -= Ad, d = keep d + take r / D, x += d, all [dof][mode], D = diagonals[dof][2] of S_u and S_w. What is next to nothing
   is nothing: such numbers are slow. */
INLINE void smooth_rows(long rows, const REAL *restrict diagonals, const REAL *lambda, int many, REAL keep, REAL take,
                        const REAL *restrict Ad, REAL *restrict r, REAL *restrict d, REAL *restrict x)
{
    for (long i = 0; i < rows; ++i)
        EACH(j, many) {
            const long k = i * many + j;
            const REAL residual = r[k] - Ad[k];
            r[k] = residual > NOTHING || residual < -NOTHING ? residual : 0;
            d[k] = keep * d[k] + take * r[k] / (diagonals[2 * i] + lambda[j] * diagonals[2 * i + 1]);
            x[k] += d[k];
        }
}

static void smooth(long rows, const REAL *diagonals, const REAL *lambda, int many, REAL keep, REAL take, const REAL *Ad,
                   REAL *r, REAL *d, REAL *x)
{
    if (many == NUMBERS)
        smooth_rows(rows, diagonals, lambda, NUMBERS, keep, take, Ad, r, d, x);
    else
        smooth_rows(rows, diagonals, lambda, NUMBERS - 1, keep, take, Ad, r, d, x);
}

INLINE void interpolate_rows(long rows, const int *pointers, const int *columns, const REAL *entries, int many,
                             const REAL *restrict x, REAL *restrict y)
{
    for (long i = 0; i < rows; ++i) {
        REAL sum[NUMBERS] = {0};
        for (int k = pointers[i]; k < pointers[i + 1]; ++k)
            EACH(j, many)
                sum[j] += entries[k] * x[(long)columns[k] * many + j];
        EACH(j, many)
            y[i * many + j] = sum[j];
    }
}

INLINE void restrict_rows(long rows, const int *pointers, const int *columns, const REAL *entries, int many,
                          const REAL *restrict x, REAL *restrict y)
{
    for (long i = 0; i < rows; ++i)
        for (int k = pointers[i]; k < pointers[i + 1]; ++k)
            EACH(j, many)
                y[(long)columns[k] * many + j] += entries[k] * x[i * many + j];
}

/* y = P x, P of sparse rows, [row][mode]. */
static void interpolate(long rows, const int *pointers, const int *columns, const REAL *entries, int many, const REAL *x,
                        REAL *y)
{
    if (many == NUMBERS)
        interpolate_rows(rows, pointers, columns, entries, NUMBERS, x, y);
    else
        interpolate_rows(rows, pointers, columns, entries, NUMBERS - 1, x, y);
}

/* y += P' x. */
static void restrict_to(long rows, const int *pointers, const int *columns, const REAL *entries, int many, const REAL *x,
                        REAL *y)
{
    if (many == NUMBERS)
        restrict_rows(rows, pointers, columns, entries, NUMBERS, x, y);
    else
        restrict_rows(rows, pointers, columns, entries, NUMBERS - 1, x, y);
}
