/* The operator of wavetank/fe/layers.py: LANES cells at a time, one in each number of a vector.

NODES, POINTS   of a cell: degrees of freedom, quadrature points
SIDE, RULE      of an edge, where a cell's nodes and points are all pairs of these; else 0
DIM, GDIM       of the cell, and of the space that it lies in
NUMBERS         of a degree of freedom: vertical functions, the last one's the surface potential
LEVELS          vertical quadrature points
FIELDS          that the density depends on
HESSIANS        second derivatives by (u_0 ..., w) in the cell's own coordinates: DIM (DIM + 1) / 2 + DIM + 1
MEANS           those that do not couple u and w: DIM (DIM + 1) / 2 + 1 */
typedef double v __attribute__((vector_size(8 * LANES)));
typedef double stored __attribute__((vector_size(8 * LANES), aligned(8)));

static const v zero = {0.0};

typedef struct {
    int batches;
    const int *dofs;        /* [batch][node][lane] */
    const double *values;   /* [point][node], or [point of an edge][node of an edge] */
    const double *slopes;   /* [axis][point][node] in the cell's own coordinates, or [point of an edge][node] */
    const double *zeta;     /* [level] */
    const double *levels;   /* [level] weights */
    const double *P, *dP;   /* [level][number] */
    const double *inverse;  /* [batch][point][axis of space][axis of cell][lane] */
    const double *measure;  /* [batch][point][lane] */
    const double *squares;  /* [product of slopes ..., of values][point][node] */
} Cells;

#define MOST (NUMBERS > FIELDS ? NUMBERS : FIELDS)
#define EACH(i, most) for (int i = 0; i < (most); ++i)

static inline void gather(const Cells *c, int b, int numbers, const double *x, int stride, v *X)
{
    EACH(i, NODES)
        EACH(l, LANES) {
            const double *row = x + (long)c->dofs[(b * NODES + i) * LANES + l] * stride;
            EACH(j, numbers)
                ((double *)&X[i * numbers + j])[l] = row[j];
        }
}

static inline void scatter(const Cells *c, int b, int numbers, const v *Y, double *y, int stride)
{
    EACH(i, NODES)
        EACH(l, LANES) {
            double *row = y + (long)c->dofs[(b * NODES + i) * LANES + l] * stride;
            EACH(j, numbers)
                row[j] += ((const double *)&Y[i * numbers + j])[l];
        }
}

/* Values and slopes at the points, U[point][value, slopes ...][number], of X[node][number]. */
static inline void forward(const Cells *c, int numbers, const v *X, v *U)
{
#if SIDE
    EACH(a, RULE) {
        v values[SIDE * MOST], slopes[SIDE * MOST];  /* at a along the first axis, at the nodes of the second */
        EACH(k, SIDE * numbers) {
            values[k] = slopes[k] = zero;
            EACH(i, SIDE) {
                values[k] += c->values[a * SIDE + i] * X[i * SIDE * numbers + k];
                slopes[k] += c->slopes[a * SIDE + i] * X[i * SIDE * numbers + k];
            }
        }
        EACH(b, RULE) {
            v *u = U + (a * RULE + b) * 3 * numbers;
            EACH(j, numbers) {
                v value = zero, first = zero, second = zero;
                EACH(i, SIDE) {
                    value += c->values[b * SIDE + i] * values[i * numbers + j];
                    first += c->values[b * SIDE + i] * slopes[i * numbers + j];
                    second += c->slopes[b * SIDE + i] * values[i * numbers + j];
                }
                u[j] = value, u[numbers + j] = first, u[2 * numbers + j] = second;
            }
        }
    }
#else
    EACH(q, POINTS)
        EACH(a, 1 + DIM)
            EACH(j, numbers) {
                const double *table = (a ? c->slopes + (a - 1) * POINTS * NODES : c->values) + q * NODES;
                v sum = zero;
                EACH(i, NODES)
                    sum += table[i] * X[i * numbers + j];
                U[(q * (1 + DIM) + a) * numbers + j] = sum;
            }
#endif
}

/* The transpose: Y[node][number] += of R[point][by value, by slopes ...][number]. */
static inline void backward(const Cells *c, int numbers, const v *R, v *Y)
{
#if SIDE
    EACH(a, RULE) {
        v values[SIDE * MOST], slopes[SIDE * MOST];
        EACH(k, SIDE * numbers)
            values[k] = slopes[k] = zero;
        EACH(b, RULE) {
            const v *r = R + (a * RULE + b) * 3 * numbers;
            EACH(i, SIDE)
                EACH(j, numbers) {
                    values[i * numbers + j] += c->values[b * SIDE + i] * r[j] + c->slopes[b * SIDE + i] * r[2 * numbers + j];
                    slopes[i * numbers + j] += c->values[b * SIDE + i] * r[numbers + j];
                }
        }
        EACH(i, SIDE)
            EACH(k, SIDE * numbers)
                Y[i * SIDE * numbers + k] += c->values[a * SIDE + i] * values[k] + c->slopes[a * SIDE + i] * slopes[k];
    }
#else
    EACH(q, POINTS)
        EACH(a, 1 + DIM)
            EACH(i, NODES) {
                const double weight = (a ? c->slopes + (a - 1) * POINTS * NODES : c->values)[q * NODES + i];
                EACH(j, numbers)
                    Y[i * numbers + j] += weight * R[(q * (1 + DIM) + a) * numbers + j];
            }
#endif
}

static inline void clear(int size, v *Y)
{
    EACH(i, size)
        Y[i] = zero;
}

/* What the energy's second derivatives are everywhere, times all weights: out[batch][point][level][...][lane]. */
static void hessians(const Cells *c, const double *fields, const double *constants, double *out)
{
    EACH(b, c->batches) {
        v X[NODES * FIELDS], F[POINTS * (1 + DIM) * FIELDS];
        gather(c, b, FIELDS, fields, FIELDS, X);
        forward(c, FIELDS, X, F);
        EACH(q, POINTS) {
            const v *f = F + q * (1 + DIM) * FIELDS;
            const stored *inverse = (const stored *)c->inverse + ((long)b * POINTS + q) * GDIM * DIM;
            const v measure = ((const stored *)c->measure)[(long)b * POINTS + q];
            v slope[FIELDS][GDIM];
            EACH(n, FIELDS)
                EACH(i, GDIM) {
                    slope[n][i] = zero;
                    EACH(a, DIM)
                        slope[n][i] += inverse[i * DIM + a] * f[(1 + a) * FIELDS + n];
                }
            EACH(z, LEVELS) {
                const double zeta = c->zeta[z];
                const v weight = measure * c->levels[z];
                stored *k = (stored *)out + (((long)b * POINTS + q) * LEVELS + z) * HESSIANS;
                v uu[GDIM][GDIM], uw[GDIM], ww;
                HESSIAN
                EACH(a, DIM)
                    EACH(d, a + 1) {
                        v sum = zero;
                        EACH(i, GDIM)
                            EACH(j, GDIM)
                                sum += inverse[i * DIM + a] * uu[i][j] * inverse[j * DIM + d];
                        *k++ = weight * sum;
                    }
                EACH(a, DIM) {
                    v sum = zero;
                    EACH(i, GDIM)
                        sum += inverse[i * DIM + a] * uw[i];
                    *k++ = weight * sum;
                }
                *k = weight * ww;
            }
        }
    }
}

/* y += A x between the numbers from ``first`` on of x and from ``to`` on of y, rows as long as they are many. */
static inline __attribute__((always_inline)) void multiply(const Cells *c, const double *hessians, int first, int many,
                                                           int to, int wanted, const double *x, double *y)
{
    EACH(b, c->batches) {
        v X[NODES * NUMBERS], U[POINTS * (1 + DIM) * NUMBERS], R[POINTS * (1 + DIM) * NUMBERS];
        gather(c, b, many, x, many, X);
        forward(c, many, X, U);
        EACH(q, POINTS) {
            const v *u = U + q * (1 + DIM) * many;
            v *r = R + q * (1 + DIM) * wanted;
            clear((1 + DIM) * wanted, r);
            EACH(z, LEVELS) {
                const stored *uu = (const stored *)hessians + (((long)b * POINTS + q) * LEVELS + z) * HESSIANS;
                const stored *uw = uu + DIM * (DIM + 1) / 2;
                const double *P = c->P + z * NUMBERS, *dP = c->dP + z * NUMBERS;
                v s[DIM], w = zero, by_s[DIM];
                EACH(j, many)
                    w += dP[first + j] * u[j];
                v by_w = uw[DIM] * w;
                EACH(a, DIM) {
                    s[a] = zero;
                    EACH(j, many)
                        s[a] += P[first + j] * u[(1 + a) * many + j];
                    by_s[a] = uw[a] * w;
                    by_w += uw[a] * s[a];
                    EACH(d, a + 1) {
                        by_s[a] += *uu * s[d];
                        if (d < a)
                            by_s[d] += *uu * s[a];
                        ++uu;
                    }
                }
                EACH(j, wanted) {
                    r[j] += dP[to + j] * by_w;
                    EACH(a, DIM)
                        r[(1 + a) * wanted + j] += P[to + j] * by_s[a];
                }
            }
        }
        clear(NODES * wanted, X);
        backward(c, wanted, R, X);
        scatter(c, b, wanted, X, y, wanted);
    }
}

#define PART(name, first, many, to, wanted)                                                        \
    static void name(const Cells *c, const double *hessians, const double *x, double *y)                  \
    {                                                                                              \
        multiply(c, hessians, first, many, to, wanted, x, y);                                      \
    }
PART(product, 0, NUMBERS, 0, NUMBERS)                      /* A */
PART(interior_product, 0, NUMBERS - 1, 0, NUMBERS - 1)     /* A_II */
PART(coupling_product, NUMBERS - 1, 1, 0, NUMBERS - 1)     /* A_In */
PART(surface_product, 0, NUMBERS, NUMBERS - 1, 1)          /* the last row of A */

/* y += the derivative of the energy of x by the first field, [dof]. */
static void derivative(const Cells *c, const double *fields, const double *constants, const double *x, double *y)
{
    EACH(b, c->batches) {
        v X[NODES * MOST], F[POINTS * (1 + DIM) * FIELDS];
        v U[POINTS * (1 + DIM) * NUMBERS], R[POINTS * (1 + DIM)];
        gather(c, b, FIELDS, fields, FIELDS, X);
        forward(c, FIELDS, X, F);
        gather(c, b, NUMBERS, x, NUMBERS, X);
        forward(c, NUMBERS, X, U);
        EACH(q, POINTS) {
            const v *f = F + q * (1 + DIM) * FIELDS, *of_x = U + q * (1 + DIM) * NUMBERS;
            const stored *inverse = (const stored *)c->inverse + ((long)b * POINTS + q) * GDIM * DIM;
            const v measure = ((const stored *)c->measure)[(long)b * POINTS + q];
            v slope[FIELDS][GDIM], *r = R + q * (1 + DIM);
            EACH(n, FIELDS)
                EACH(i, GDIM) {
                    slope[n][i] = zero;
                    EACH(a, DIM)
                        slope[n][i] += inverse[i * DIM + a] * f[(1 + a) * FIELDS + n];
                }
            clear(1 + DIM, r);
            EACH(z, LEVELS) {
                const double zeta = c->zeta[z];
                const v weight = measure * c->levels[z];
                v u[GDIM], w = zero, by, by_slope[GDIM];
                EACH(i, GDIM)
                    u[i] = zero;
                EACH(j, NUMBERS)
                    w += c->dP[z * NUMBERS + j] * of_x[j];
                EACH(a, DIM) {
                    v s = zero;
                    EACH(j, NUMBERS)
                        s += c->P[z * NUMBERS + j] * of_x[(1 + a) * NUMBERS + j];
                    EACH(i, GDIM)
                        u[i] += inverse[i * DIM + a] * s;
                }
                DERIVATIVE
                r[0] += weight * by;
                EACH(a, DIM)
                    EACH(i, GDIM)
                        r[1 + a] += weight * inverse[i * DIM + a] * by_slope[i];
            }
        }
        clear(NODES, X);
        backward(c, 1, R, X);
        scatter(c, b, 1, X, y, 1);
    }
}

/* The second derivatives averaged over the depth, without those that couple u and w: out[batch][point][uu ..., ww][lane]. */
static void averages(const Cells *c, const double *hessians, double *out)
{
    EACH(b, c->batches)
        EACH(q, POINTS) {
            stored *mean = (stored *)out + ((long)b * POINTS + q) * MEANS;
            EACH(i, MEANS)
                mean[i] = zero;
            EACH(z, LEVELS) {
                const stored *k = (const stored *)hessians + (((long)b * POINTS + q) * LEVELS + z) * HESSIANS;
                EACH(i, MEANS - 1)
                    mean[i] += k[i];
                mean[MEANS - 1] += k[HESSIANS - 1];
            }
        }
}

/* y += (S_u + lambda_j S_w) x_j, for ``many`` modes j at once. */
static inline __attribute__((always_inline)) void each_mode(const Cells *c, const double *averages, const double *lambda,
                                                            int many, const double *x, double *y)
{
    EACH(b, c->batches) {
        v X[NODES * NUMBERS], U[POINTS * (1 + DIM) * NUMBERS];
        gather(c, b, many, x, many, X);
        forward(c, many, X, U);
        EACH(q, POINTS) {
            v *u = U + q * (1 + DIM) * many;
            const stored *mean = (const stored *)averages + ((long)b * POINTS + q) * MEANS;
            EACH(j, many) {
                v by_s[DIM];
                const stored *uu = mean;
                EACH(a, DIM) {
                    by_s[a] = zero;
                    EACH(d, a + 1) {
                        by_s[a] += *uu * u[(1 + d) * many + j];
                        if (d < a)
                            by_s[d] += *uu * u[(1 + a) * many + j];
                        ++uu;
                    }
                }
                u[j] *= lambda[j] * mean[MEANS - 1];
                EACH(a, DIM)
                    u[(1 + a) * many + j] = by_s[a];
            }
        }
        clear(NODES * many, X);
        backward(c, many, U, X);
        scatter(c, b, many, X, y, many);
    }
}

static void interior_modes(const Cells *c, const double *averages, const double *lambda, const double *x, double *y)
{
    each_mode(c, averages, lambda, NUMBERS - 1, x, y);
}

static void modes(const Cells *c, const double *averages, const double *lambda, const double *x, double *y)
{
    each_mode(c, averages, lambda, NUMBERS, x, y);
}

/* y += the diagonals of S_u and S_w, [dof][2]. */
static void diagonals(const Cells *c, const double *averages, double *y)
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
