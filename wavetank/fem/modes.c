/* The decoupled modes of wavetank/fem/order_multigrid.py; layer.c stands before.

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

/* f with a number of modes that the compiler knows, where they are few; of none nothing. */
#define OF_FEW(many, f, ...) \
    ((many) == 1 ? f(1, __VA_ARGS__) : (many) == 2 ? f(2, __VA_ARGS__) : (many) == 3 ? f(3, __VA_ARGS__) : (void)0)

INLINE void some_modes(int few, const Cells *c, long b, const REAL *averages, const REAL *lambda, int stride,
                       const REAL *x, REAL *y)
{
    const Modes what = {(const stored *)averages, lambda, few};
    v X[NODES * FEW], Y[NODES * FEW];
    gather(c, b, few, x, stride, X);
    clear(NODES * few, Y);
    through(c, b, DIM, few, X, few, Y, mode_at, &what);
    scatter(c, b, few, Y, y, stride);
}

/* y += (S_u + lambda_j S_w) x_j, [dof][mode] with ``stride`` numbers of a row, for the first modes j, ``many``. */
static void multiply(const Cells *c, const REAL *averages, const REAL *lambda, int many, int stride, const REAL *x, REAL *y)
{
    EACH(b, c->batches) {
        int j = 0;
        for (; j + FEW <= many; j += FEW)
            some_modes(FEW, c, b, averages, lambda + j, stride, x + j, y + j);
        OF_FEW(many - j, some_modes, c, b, averages, lambda + j, stride, x + j, y + j);
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

/* r -= Ad, d = keep d + take r / D, x += d, all [dof][mode], keep[mode] and take[mode], D = diagonals[dof][2] of S_u and
   S_w. What is next to nothing is nothing: such numbers are slow. */
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

static void smooth(long rows, const REAL *diagonals, const REAL *lambda, const REAL *keep, const REAL *take, int many,
                   const REAL *Ad, REAL *r, REAL *d, REAL *x)
{
    if (many == NUMBERS)
        smooth_rows(rows, diagonals, lambda, keep, take, NUMBERS, Ad, r, d, x);
    else
        smooth_rows(rows, diagonals, lambda, keep, take, NUMBERS - 1, Ad, r, d, x);
}

INLINE void interpolate_rows(int many, long rows, const int *pointers, const int *columns, const REAL *entries, int stride,
                             const REAL *restrict x, REAL *restrict y)
{
    for (long i = 0; i < rows; ++i) {
        REAL sum[NUMBERS > FEW ? NUMBERS : FEW] = {0};
        for (int k = pointers[i]; k < pointers[i + 1]; ++k)
            EACH(j, many)
                sum[j] += entries[k] * x[(long)columns[k] * many + j];
        EACH(j, many)
            y[i * stride + j] = sum[j];
    }
}

INLINE void restrict_rows(int many, long rows, const int *pointers, const int *columns, const REAL *entries, int stride,
                          const REAL *restrict x, REAL *restrict y)
{
    for (long i = 0; i < rows; ++i)
        for (int k = pointers[i]; k < pointers[i + 1]; ++k)
            EACH(j, many)
                y[(long)columns[k] * many + j] += entries[k] * x[i * stride + j];
}

/* y = P x, P of sparse rows, x[row][mode] of the first modes, y of ``stride`` numbers of a row. */
static void interpolate(long rows, const int *pointers, const int *columns, const REAL *entries, int many, int stride,
                        const REAL *x, REAL *y)
{
    if (many < FEW)
        OF_FEW(many, interpolate_rows, rows, pointers, columns, entries, stride, x, y);
    else if (many == FEW)
        interpolate_rows(FEW, rows, pointers, columns, entries, stride, x, y);
    else
        interpolate_rows(many, rows, pointers, columns, entries, stride, x, y);
}

/* y += P' x, of the same. */
static void restrict_to(long rows, const int *pointers, const int *columns, const REAL *entries, int many, int stride,
                        const REAL *x, REAL *y)
{
    if (many < FEW)
        OF_FEW(many, restrict_rows, rows, pointers, columns, entries, stride, x, y);
    else if (many == FEW)
        restrict_rows(FEW, rows, pointers, columns, entries, stride, x, y);
    else
        restrict_rows(many, rows, pointers, columns, entries, stride, x, y);
}
