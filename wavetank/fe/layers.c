/* The operator of wavetank/fe/layers.py; layer.c stands before.

STORED          whether second derivatives are kept from state to state of the fields, state[batch][point][level][...][lane],
                or found anew in every product, of the fields themselves, state[dof][field] */
#define MANY ((REAL)1e30)
#define BESIDE (STORED ? 0 : FIELDS) /* numbers that go to the points beside the potential's */

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

/* The first numbers are ``given``, and then there may be fields; the others are nothing. Those from ``first`` on are wanted. */
INLINE void multiply(const Multiplied *m, const Cells *c, long b, int q, int given, int first, const v *u, v *r)
{
    const Layers *layers = m->layers;
    const stored *kept = (const stored *)m->state + (b * POINTS + q) * LEVELS * HESSIANS;
    const int width = given + BESIDE, wanted = NUMBERS - first;
    v f[OF_FIELDS];
    if (!STORED)
        in_space(c, b, q, FIELDS, u + given, width, f);
    clear((1 + DIM) * wanted, r);
    EACH(z, LEVELS) {
        const REAL *P = layers->P + z * NUMBERS, *dP = layers->dP + z * NUMBERS;
        v k[HESSIANS], s[DIM], w = zero, by_s[DIM];
        if (STORED)
            EACH(i, HESSIANS)
                k[i] = kept[z * HESSIANS + i];
        else
            second(c, layers, b, q, z, f, k);
        const v *uu = k, *uw = k + DIM * (DIM + 1) / 2;
        EACH(j, given)
            w += dP[j] * u[j];
        v by_w = uw[DIM] * w;
        EACH(a, DIM) {
            s[a] = zero;
            EACH(j, given)
                s[a] += P[j] * u[(1 + a) * width + j];
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
            r[j] += dP[first + j] * by_w;
            EACH(a, DIM)
                r[(1 + a) * wanted + j] += P[first + j] * by_s[a];
        }
    }
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

/* The derivative of the energy by the first field; x has the potential's numbers and the fields. */
INLINE void derive_at(const void *what, const Cells *c, long b, int q, const v *x, v *r)
{
    const Layers *layers = what;
    const stored *inverse = inverse_at(c, b, q);
    const REAL *constants = layers->constants;
    const v measure = measure_at(c, b, q);
    v f[OF_FIELDS];
    in_space(c, b, q, FIELDS, x + NUMBERS, MOST, f);
    clear(1 + DIM, r);
    EACH(z, LEVELS) {
        const REAL zeta = layers->zeta[z];
        const v weight = measure * layers->weights[z];
        v u[GDIM], w = zero, by, by_slope[GDIM];
        EACH(i, GDIM)
            u[i] = zero;
        EACH(j, NUMBERS)
            w += layers->dP[z * NUMBERS + j] * x[j];
        EACH(a, DIM) {
            v s = zero;
            EACH(j, NUMBERS)
                s += layers->P[z * NUMBERS + j] * x[(1 + a) * MOST + j];
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
