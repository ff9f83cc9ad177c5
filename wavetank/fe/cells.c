/* Values on cells, LANES of them at a time, one in each number of a vector; see wavetank/fe/cells.py.

REAL            float or double
NODES, POINTS   of a cell: degrees of freedom, quadrature points
SIDE, RULE      of an edge, where a cell's nodes and points are all pairs of these; else 0
MOST            numbers of a degree of freedom
DIM, GDIM       of the cell, and of the space that it lies in
PLACES          of a cell at which its geometry is known: POINTS, or 1 where it is the same everywhere in each cell */
typedef REAL v __attribute__((vector_size(sizeof(REAL) * LANES)));
typedef REAL stored __attribute__((vector_size(sizeof(REAL) * LANES), aligned(sizeof(REAL))));

static const v zero = {0};

typedef struct {
    int batches;
    const int *dofs;        /* [batch][node][lane] */
    const REAL *values;     /* [point][node], or [point of an edge][node of an edge] */
    const REAL *slopes;     /* [axis][point][node] in the cell's own coordinates, or [point of an edge][node] */
    const REAL *squares;    /* [product of slopes ..., of values][point][node] */
    const REAL *weights;    /* [point] */
    const REAL *inverse;    /* [batch][place][axis of space][axis of cell][lane] */
    const REAL *measure;    /* [batch][place][lane] */
} Cells;

#define EACH(i, most) for (int i = 0; i < (most); ++i)
#define INLINE static inline __attribute__((always_inline))

/* Whether some vectors are zero. */
INLINE int nothing(const v *a, int count)
{
    __typeof__(zero != zero) some = zero != zero;
    int any = 0;
    EACH(i, count)
        some |= a[i] != zero;
    EACH(l, LANES)
        any |= some[l] != 0;
    return !any;
}

/* Rows of numbers are read and written four at a time, those of four lanes, as the transpose of such a square. */
typedef REAL four __attribute__((vector_size(sizeof(REAL) * 4), aligned(sizeof(REAL)), may_alias));
#define PICK __builtin_shufflevector

_Static_assert(LANES % 4 == 0, "LANES must be a multiple of 4: rows are transposed four lanes at a time.");

INLINE void transpose(const four *rows, four *columns)
{
    const four a = PICK(rows[0], rows[1], 0, 4, 1, 5), b = PICK(rows[2], rows[3], 0, 4, 1, 5);
    const four c = PICK(rows[0], rows[1], 2, 6, 3, 7), d = PICK(rows[2], rows[3], 2, 6, 3, 7);
    columns[0] = PICK(a, b, 0, 1, 4, 5), columns[1] = PICK(a, b, 2, 3, 6, 7);
    columns[2] = PICK(c, d, 0, 1, 4, 5), columns[3] = PICK(c, d, 2, 3, 6, 7);
}

/* X[node][number] of ``width`` numbers, of which these are some. */
INLINE void gather_among(const Cells *c, long b, int numbers, const REAL *x, int stride, v *X, int width)
{
    EACH(i, NODES)
        EACH(l, LANES / 4) {
            const int *dofs = c->dofs + (b * NODES + i) * LANES + 4 * l;
            const REAL *row[4];
            four rows[4], columns[4];
            EACH(k, 4)
                row[k] = x + (long)dofs[k] * stride;
            int j = 0;
            for (; j + 4 <= numbers; j += 4) {
                EACH(k, 4)
                    rows[k] = *(const four *)(row[k] + j);
                transpose(rows, columns);
                EACH(k, 4)
                    ((four *)&X[i * width + j + k])[l] = columns[k];
            }
            for (; j < numbers; ++j)
                EACH(k, 4)
                    ((REAL *)&X[i * width + j])[4 * l + k] = row[k][j];
        }
}

INLINE void gather(const Cells *c, long b, int numbers, const REAL *x, int stride, v *X)
{
    gather_among(c, b, numbers, x, stride, X, numbers);
}

/* y += Y[node][number] of ``width`` numbers, of which the first are wanted. */
INLINE void scatter_among(const Cells *c, long b, int numbers, const v *Y, int width, REAL *y, int stride)
{
    EACH(i, NODES)
        EACH(l, LANES / 4) {
            const int *dofs = c->dofs + (b * NODES + i) * LANES + 4 * l;
            REAL *row[4];
            four rows[4], columns[4];
            EACH(k, 4)
                row[k] = y + (long)dofs[k] * stride;
            int j = 0;
            for (; j + 4 <= numbers; j += 4) {
                EACH(k, 4)
                    columns[k] = ((const four *)&Y[i * width + j + k])[l];
                transpose(columns, rows);
                EACH(k, 4)
                    *(four *)(row[k] + j) += rows[k];
            }
            for (; j < numbers; ++j)
                EACH(k, 4)
                    row[k][j] += ((const REAL *)&Y[i * width + j])[4 * l + k];
        }
}

INLINE void scatter(const Cells *c, long b, int numbers, const v *Y, REAL *y, int stride)
{
    scatter_among(c, b, numbers, Y, numbers, y, stride);
}

INLINE void clear(int size, v *Y)
{
    EACH(i, size)
        Y[i] = zero;
}

INLINE const stored *inverse_at(const Cells *c, long b, int q)
{
    return (const stored *)c->inverse + (PLACES == 1 ? b : b * POINTS + q) * GDIM * DIM;
}

INLINE v measure_at(const Cells *c, long b, int q)
{
    return ((const stored *)c->measure)[PLACES == 1 ? b : b * POINTS + q] * c->weights[q];
}

/* Fields at a point in space, f[field][value, slopes ...], of u as ``through`` has it, where they are among ``width``. */
INLINE void in_space(const Cells *c, long b, int q, int fields, const v *u, int width, v *f)
{
    const stored *inverse = inverse_at(c, b, q);
    EACH(n, fields) {
        f[n * (1 + GDIM)] = u[n];
        EACH(i, GDIM) {
            v slope = zero;
            EACH(a, DIM)
                slope += inverse[i * DIM + a] * u[(1 + a) * width + n];
            f[n * (1 + GDIM) + 1 + i] = slope;
        }
    }
}

/* What happens at a point: r[by value, by slopes ...][number] of u[value, slopes ...][number]. */
typedef void Point(const void *what, const Cells *c, long b, int q, const v *u, v *r);

/* Y[node][wanted] += what ``at`` makes of X[node][number] at the points; with ``axes`` = 0 of the values alone. */
INLINE void through(const Cells *c, long b, int axes, int numbers, const v *X, int wanted, v *Y, Point at, const void *what)
{
#if SIDE
    EACH(a, RULE) {
        /* at a along the first axis, at the nodes of the second */
        v values[SIDE * MOST], slopes[SIDE * MOST], by_values[SIDE * MOST], by_slopes[SIDE * MOST];
        EACH(k, SIDE * numbers) {
            values[k] = slopes[k] = zero;
            EACH(i, SIDE) {
                values[k] += c->values[a * SIDE + i] * X[i * SIDE * numbers + k];
                if (axes)
                    slopes[k] += c->slopes[a * SIDE + i] * X[i * SIDE * numbers + k];
            }
        }
        EACH(k, SIDE * wanted)
            by_values[k] = by_slopes[k] = zero;
        EACH(d, RULE) {
            const REAL *value = c->values + d * SIDE, *slope = c->slopes + d * SIDE;
            v u[3 * MOST], r[3 * MOST];
            EACH(j, numbers) {
                u[j] = u[numbers + j] = u[2 * numbers + j] = zero;
                EACH(i, SIDE) {
                    u[j] += value[i] * values[i * numbers + j];
                    if (axes) {
                        u[numbers + j] += value[i] * slopes[i * numbers + j];
                        u[2 * numbers + j] += slope[i] * values[i * numbers + j];
                    }
                }
            }
            at(what, c, b, a * RULE + d, u, r);
            EACH(i, SIDE)
                EACH(j, wanted) {
                    by_values[i * wanted + j] += value[i] * r[j];
                    if (axes) {
                        by_values[i * wanted + j] += slope[i] * r[2 * wanted + j];
                        by_slopes[i * wanted + j] += value[i] * r[wanted + j];
                    }
                }
        }
        EACH(i, SIDE)
            EACH(k, SIDE * wanted) {
                Y[i * SIDE * wanted + k] += c->values[a * SIDE + i] * by_values[k];
                if (axes)
                    Y[i * SIDE * wanted + k] += c->slopes[a * SIDE + i] * by_slopes[k];
            }
    }
#else
    EACH(q, POINTS) {
        v u[(1 + DIM) * MOST], r[(1 + DIM) * MOST];
        EACH(a, 1 + axes) {
            const REAL *table = (a ? c->slopes + (a - 1) * POINTS * NODES : c->values) + q * NODES;
            EACH(j, numbers) {
                u[a * numbers + j] = zero;
                EACH(i, NODES)
                    u[a * numbers + j] += table[i] * X[i * numbers + j];
            }
        }
        at(what, c, b, q, u, r);
        EACH(a, 1 + axes) {
            const REAL *table = (a ? c->slopes + (a - 1) * POINTS * NODES : c->values) + q * NODES;
            EACH(i, NODES)
                EACH(j, wanted)
                    Y[i * wanted + j] += table[i] * r[a * wanted + j];
        }
    }
#endif
}
