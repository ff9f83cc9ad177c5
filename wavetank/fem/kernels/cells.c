/* Values on cells, LANES cells at a time, one in each element of a vector; see wavetank/fem/cells.py.

REAL            float or double
NODES, POINTS   degrees of freedom and quadrature points of a cell
SIDE, RULE      the same of an edge if the cell is a product of edges; else 0
MOST            largest number of components of a degree of freedom, given or wanted
DIM, GDIM       dimension of the cell, and of space
PLACES          points of a cell with a Jacobian: POINTS, or 1 if it is constant in each cell */
typedef REAL v __attribute__((vector_size(sizeof(REAL) * LANES)));
typedef REAL stored __attribute__((vector_size(sizeof(REAL) * LANES), aligned(sizeof(REAL))));

static const v zero = {0};

/* Return whether vectors are zero. */
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

/* Rows are read and written in squares of LANES components by LANES cells, which are transposed. */
#define ROWS (LANES % 4 ? 2 : 4)
typedef REAL piece __attribute__((vector_size(sizeof(REAL) * ROWS), aligned(sizeof(REAL)), may_alias));

_Static_assert(LANES % ROWS == 0, "LANES must be even.");

INLINE void transpose(const piece *rows, piece *columns)
{
#if LANES % 4
    columns[0] = PICK(rows[0], rows[1], 0, 2), columns[1] = PICK(rows[0], rows[1], 1, 3);
#else
    const piece a = PICK(rows[0], rows[1], 0, 4, 1, 5), b = PICK(rows[2], rows[3], 0, 4, 1, 5);
    const piece c = PICK(rows[0], rows[1], 2, 6, 3, 7), d = PICK(rows[2], rows[3], 2, 6, 3, 7);
    columns[0] = PICK(a, b, 0, 1, 4, 5), columns[1] = PICK(a, b, 2, 3, 6, 7);
    columns[2] = PICK(c, d, 0, 1, 4, 5), columns[3] = PICK(c, d, 2, 3, 6, 7);
#endif
}

/* Read some of the ``width`` components: X[node][component]. */
INLINE void gather(const Cells *c, long b, int numbers, const REAL *x, int stride, v *X, int width)
{
    EACH(i, NODES)
        EACH(l, LANES / ROWS) {
            const int *dofs = c->dofs + (b * NODES + i) * LANES + ROWS * l;
            const REAL *row[ROWS];
            piece rows[ROWS], columns[ROWS];
            EACH(k, ROWS)
                row[k] = x + (long)dofs[k] * stride;
            int j = 0;
            for (; j + ROWS <= numbers; j += ROWS) {
                EACH(k, ROWS)
                    rows[k] = *(const piece *)(row[k] + j);
                transpose(rows, columns);
                EACH(k, ROWS)
                    ((piece *)&X[i * width + j + k])[l] = columns[k];
            }
            for (; j < numbers; ++j)
                EACH(k, ROWS)
                    ((REAL *)&X[i * width + j])[ROWS * l + k] = row[k][j];
        }
}

/* y += Y[node][component], for the first of ``width`` components. */
INLINE void scatter(const Cells *c, long b, int numbers, const v *Y, int width, REAL *y, int stride)
{
    EACH(i, NODES)
        EACH(l, LANES / ROWS) {
            const int *dofs = c->dofs + (b * NODES + i) * LANES + ROWS * l;
            REAL *row[ROWS];
            piece rows[ROWS], columns[ROWS];
            EACH(k, ROWS)
                row[k] = y + (long)dofs[k] * stride;
            int j = 0;
            for (; j + ROWS <= numbers; j += ROWS) {
                EACH(k, ROWS)
                    columns[k] = ((const piece *)&Y[i * width + j + k])[l];
                transpose(columns, rows);
                EACH(k, ROWS)
                    *(piece *)(row[k] + j) += rows[k];
            }
            for (; j < numbers; ++j)
                EACH(k, ROWS)
                    row[k][j] += ((const REAL *)&Y[i * width + j])[ROWS * l + k];
        }
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

/* Fields at a point with derivatives in space, f[field][value, slopes ...], of u with ``width`` components as in ``through``. */
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

/* A function at a point: r[value, slopes ...][component] of u[value, slopes ...][component]. */
typedef void Point(const void *what, const Cells *c, long b, int q, const v *u, v *r);

/* Loops are divided into equal parts of at most four, whose sums fit into registers. */
#define PARTS(count) (((count) + 3) / 4)
#define PART(count) (((count) + PARTS(count) - 1) / PARTS(count))

#define EACH_NODE(i, ...)               \
    if (part > 1) {                     \
        ROLLED                          \
        EACH(i, nodes) { __VA_ARGS__ }  \
    } else                              \
        EACH(i, nodes) { __VA_ARGS__ }

INLINE void contract_part(int part, int tables, const REAL *const *table, int nodes, const v *x, int stride, v *y, int apart)
{
    v sum[1 + DIM][4];
    EACH(t, tables)
        EACH(k, part)
            sum[t][k] = zero;
    EACH_NODE(i, EACH(k, part) EACH(t, tables) sum[t][k] += table[t][i] * x[i * stride + k];)
    EACH(t, tables)
        EACH(k, part)
            y[t * apart + k] = sum[t][k];
}

/* y[table][component] = sum over nodes of table[node] x[node][component]. */
INLINE void contract(int tables, const REAL *const *table, int nodes, int numbers, const v *x, int stride, v *y, int apart)
{
    const int part = numbers ? PART(numbers) : 1, rest = numbers % part;
    EACH(j, numbers / part)
        contract_part(part, tables, table, nodes, x + j * part, stride, y + j * part, apart);
    contract_part(rest, tables, table, nodes, x + numbers - rest, stride, y + numbers - rest, apart);
}

INLINE void spread_part(int part, int tables, const REAL *const *table, int nodes, const v *y, int apart, v *x, int stride)
{
    v from[1 + DIM][4];
    EACH(t, tables)
        EACH(k, part)
            from[t][k] = y[t * apart + k];
    EACH_NODE(i, EACH(k, part) EACH(t, tables) x[i * stride + k] += table[t][i] * from[t][k];)
}

/* The transpose: x[node][component] += sum over tables of table[node] y[table][component]. */
INLINE void spread(int tables, const REAL *const *table, int nodes, int numbers, const v *y, int apart, v *x, int stride)
{
    const int part = numbers ? PART(numbers) : 1, rest = numbers % part;
    EACH(j, numbers / part)
        spread_part(part, tables, table, nodes, y + j * part, apart, x + j * part, stride);
    spread_part(rest, tables, table, nodes, y + numbers - rest, apart, x + numbers - rest, stride);
}

/* Y[node][component] += the transpose of interpolation, applied to ``at`` of X at the points; without slopes if ``axes`` = 0. */
INLINE void through(const Cells *c, long b, int axes, int numbers, const v *X, int wanted, v *Y, Point at, const void *what)
{
#if SIDE
    const int both = axes ? 2 : 1;
    EACH(a, RULE) {
        /* at point a of the first axis, at the nodes of the second: values, slopes */
        const int given = SIDE * numbers, found = SIDE * wanted;
        const REAL *first[] = {c->values + a * SIDE, c->slopes + a * SIDE};
        v on[2 * SIDE * MOST], by[2 * SIDE * MOST];
        contract(both, first, SIDE, given, X, given, on, given);
        clear(both * found, by);
        EACH(d, RULE) {
            const REAL *second[] = {c->values + d * SIDE, c->slopes + d * SIDE};
            v u[3 * MOST], r[3 * MOST];
            contract(both, second, SIDE, numbers, on, numbers, u, 2 * numbers);
            if (axes)
                contract(1, second, SIDE, numbers, on + given, numbers, u + numbers, 0);
            at(what, c, b, a * RULE + d, u, r);
            spread(both, second, SIDE, wanted, r, 2 * wanted, by, wanted);
            if (axes)
                spread(1, second, SIDE, wanted, r + wanted, 0, by + found, wanted);
        }
        spread(both, first, SIDE, found, by, found, Y, found);
    }
#else
    EACH(q, POINTS) {
        v u[(1 + DIM) * MOST], r[(1 + DIM) * MOST];
        const REAL *table[1 + DIM] = {c->values + q * NODES};
        EACH(a, axes)
            table[1 + a] = c->slopes + (a * POINTS + q) * NODES;
        contract(1 + axes, table, NODES, numbers, X, numbers, u, numbers);
        at(what, c, b, q, u, r);
        spread(1 + axes, table, NODES, wanted, r, wanted, Y, wanted);
    }
#endif
}

/* Some components of each degree of freedom. */
typedef struct {
    const REAL *x;
    int numbers, stride;
} Given;

/* y += the transpose of interpolation, applied to ``at`` at the points of all cells; ``wanted`` components. */
INLINE void over_cells(const Cells *c, int axes, Given given, Given more, int wanted, REAL *y, int stride, Point at,
                       const void *what)
{
    const int width = given.numbers + more.numbers;
    EACH(b, c->batches) {
        v X[NODES * MOST], Y[NODES * MOST];
        gather(c, b, given.numbers, given.x, given.stride, X, width);
        gather(c, b, more.numbers, more.x, more.stride, X + given.numbers, width);
        clear(NODES * wanted, Y);
        through(c, b, axes, width, X, wanted, Y, at, what);
        scatter(c, b, wanted, Y, wanted, y, stride);
    }
}
