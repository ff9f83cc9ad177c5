/* The operator of wavetank/fem/layers.py; layer.c stands before.

STORED          whether second derivatives are kept from state to state of the fields, state[batch][point][level][...][lane],
                or found anew in every product, of the fields themselves, state[dof][field] */
#define MANY ((REAL)1e30)
#define BESIDE (STORED ? 0 : FIELDS) /* numbers that go to the points beside the potential's */
#define SOME PART(LEVELS) /* levels at a time */

typedef struct {
    const Layers *layers;
    stored *state;
    REAL *least;
} Fields;

INLINE void take_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    const Fields *fields = what;
    EACH(l, LANES)
        *fields->least = u[0][l] < *fields->least ? u[0][l] : *fields->least;
    if (STORED) {
        v f[OF_FIELDS];
        in_space(c, b, q, FIELDS, u, FIELDS, f);
        EACH(z, LEVELS) {
            v k[HESSIANS];
            second(c, fields->layers, b, q, z, f, k);
            EACH(i, HESSIANS)
                fields->state[((b * POINTS + q) * LEVELS + z) * HESSIANS + i] = k[i];
        }
    }
}

/* Keep what is to be kept of the fields, [dof][field]. Returns the first field's least value. */
static REAL take(const Cells *c, const Layers *layers, const REAL *fields, REAL *state)
{
    REAL least = MANY;
    const Fields what = {layers, (stored *)state, &least};
    EACH(b, c->batches) {
        v X[NODES * FIELDS];
        gather(c, b, STORED ? FIELDS : 1, fields, FIELDS, X);
        through(c, b, STORED ? DIM : 0, STORED ? FIELDS : 1, X, 0, X, take_at, &what);
    }
    return least;
}

typedef struct {
    const Layers *layers;
    const REAL *state;
} Multiplied;

/* The slopes and vertical derivatives at some levels, from z on, of the first numbers of ``width``, ``given``. */
INLINE void at_levels(const Layers *layers, int z, int some, int given, int width, const v *u, v (*s)[SOME], v *w)
{
    const REAL *P = layers->P + z * NUMBERS, *dP = layers->dP + z * NUMBERS;
    EACH(i, some) {
        w[i] = zero;
        EACH(a, DIM)
            s[a][i] = zero;
    }
    ROLLED
    EACH(j, given)
        EACH(i, some) {
            w[i] += dP[i * NUMBERS + j] * u[j];
            EACH(a, DIM)
                s[a][i] += P[i * NUMBERS + j] * u[(1 + a) * width + j];
        }
}

/* r += the products at a point, of these levels. */
INLINE void multiply_levels(const Multiplied *m, const Cells *c, long b, int q, int z, int some, int given, int first,
                            const v *u, const v *f, v *r)
{
    const Layers *layers = m->layers;
    const REAL *P = layers->P + z * NUMBERS + first, *dP = layers->dP + z * NUMBERS + first;
    const int wanted = NUMBERS - first;
    v s[DIM][SOME], w[SOME], by_s[DIM][SOME], by_w[SOME];
    at_levels(layers, z, some, given, given + BESIDE, u, s, w);
    EACH(i, some) {
        v k[HESSIANS];
        if (STORED)
            EACH(h, HESSIANS)
                k[h] = ((const stored *)m->state)[((b * POINTS + q) * LEVELS + z + i) * HESSIANS + h];
        else
            second(c, layers, b, q, z + i, f, k);
        const v *uu = k, *uw = k + DIM * (DIM + 1) / 2;
        by_w[i] = uw[DIM] * w[i];
        EACH(a, DIM) {
            by_s[a][i] = uw[a] * w[i];
            by_w[i] += uw[a] * s[a][i];
            EACH(d, a + 1) {
                by_s[a][i] += *uu * s[d][i];
                if (d < a)
                    by_s[d][i] += *uu * s[a][i];
                ++uu;
            }
        }
    }
    ROLLED
    EACH(j, wanted)
        EACH(i, some) {
            r[j] += dP[i * NUMBERS + j] * by_w[i];
            EACH(a, DIM)
                r[(1 + a) * wanted + j] += P[i * NUMBERS + j] * by_s[a][i];
        }
}

/* The first numbers are ``given``, and then there may be fields; the others are nothing. Those from ``first`` on are wanted. */
INLINE void multiply(const Multiplied *m, const Cells *c, long b, int q, int given, int first, const v *u, v *r)
{
    v f[OF_FIELDS];
    if (!STORED)
        in_space(c, b, q, FIELDS, u + given, given + BESIDE, f);
    clear((1 + DIM) * (NUMBERS - first), r);
    EACH(z, LEVELS / SOME)
        multiply_levels(m, c, b, q, z * SOME, SOME, given, first, u, f, r);
    multiply_levels(m, c, b, q, LEVELS - LEVELS % SOME, LEVELS % SOME, given, first, u, f, r);
}

INLINE void multiply_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    multiply(what, c, b, q, NUMBERS, 0, u, r);
}

INLINE void within_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    multiply(what, c, b, q, NUMBERS - 1, 0, u, r);
}

INLINE void product_of(const Cells *c, const Layers *layers, const REAL *state, int given, Point at, const REAL *x, REAL *y)
{
    const Multiplied what = {layers, state};
    const int width = given + BESIDE;
    EACH(b, c->batches) {
        v X[NODES * MOST], Y[NODES * NUMBERS];
        gather_among(c, b, given, x, NUMBERS, X, width);
        if (!STORED)
            gather_among(c, b, FIELDS, state, FIELDS, X + given, width);
        clear(NODES * NUMBERS, Y);
        through(c, b, DIM, width, X, NUMBERS, Y, at, &what);
        scatter(c, b, NUMBERS, Y, y, NUMBERS);
    }
}

/* y += A x, [dof][number]. */
static void product(const Cells *c, const Layers *layers, const REAL *state, const REAL *x, REAL *y)
{
    product_of(c, layers, state, NUMBERS, multiply_at, x, y);
}

/* The same of x whose last number is nothing. */
static void interior_product(const Cells *c, const Layers *layers, const REAL *state, const REAL *x, REAL *y)
{
    product_of(c, layers, state, NUMBERS - 1, within_at, x, y);
}

INLINE void derive_levels(const Layers *layers, const Cells *c, long b, int q, int z, int some, const v *x, const v *f, v *r)
{
    const stored *inverse = inverse_at(c, b, q);
    const REAL *constants = layers->constants;
    v s[DIM][SOME], ws[SOME];
    at_levels(layers, z, some, NUMBERS, MOST, x, s, ws);
    EACH(k, some) {
        const REAL zeta = layers->zeta[z + k];
        const v weight = measure_at(c, b, q) * layers->weights[z + k], w = ws[k];
        v u[GDIM], by, by_slope[GDIM];
        EACH(i, GDIM) {
            u[i] = zero;
            EACH(a, DIM)
                u[i] += inverse[i * DIM + a] * s[a][k];
        }
        DERIVATIVE
        r[0] += weight * by;
        EACH(a, DIM)
            EACH(i, GDIM)
                r[1 + a] += weight * inverse[i * DIM + a] * by_slope[i];
    }
}

/* The derivative of the energy by the first field; x has the potential's numbers and the fields. */
INLINE void derive_at(const void *what, const Cells *c, long b, int q, const v *x, v *r)
{
    v f[OF_FIELDS];
    in_space(c, b, q, FIELDS, x + NUMBERS, MOST, f);
    clear(1 + DIM, r);
    EACH(z, LEVELS / SOME)
        derive_levels(what, c, b, q, z * SOME, SOME, x, f, r);
    derive_levels(what, c, b, q, LEVELS - LEVELS % SOME, LEVELS % SOME, x, f, r);
}

/* y += the derivative of the energy of x by the first field, [dof]. */
static void derivative(const Cells *c, const Layers *layers, const REAL *fields, const REAL *x, REAL *y)
{
    EACH(b, c->batches) {
        v X[NODES * MOST], Y[NODES];
        gather_among(c, b, NUMBERS, x, NUMBERS, X, MOST);
        gather_among(c, b, FIELDS, fields, FIELDS, X + NUMBERS, MOST);
        clear(NODES, Y);
        through(c, b, DIM, MOST, X, 1, Y, derive_at, layers);
        scatter(c, b, 1, Y, y, 1);
    }
}
