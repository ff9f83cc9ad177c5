/* The operator of wavetank/fe/layers.py; layer.c stands before.

STORED          whether second derivatives are kept from state to state of the fields, or found anew in every product */
#define MANY ((REAL)1e30)
#define STATE (STORED ? LEVELS * HESSIANS : OF_FIELDS) /* numbers of a point */

typedef struct {
    const Layers *layers;
    stored *state;
    REAL *least;
} Fields;

INLINE void take_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    const Fields *fields = what;
    stored *state = fields->state + (b * POINTS + q) * STATE;
    v f[OF_FIELDS];
    in_space(c, b, q, FIELDS, u, f);
    EACH(l, LANES)
        *fields->least = f[0][l] < *fields->least ? f[0][l] : *fields->least;
    if (STORED)
        EACH(z, LEVELS) {
            v k[HESSIANS];
            second(c, fields->layers, b, q, z, f, k);
            EACH(i, HESSIANS)
                state[z * HESSIANS + i] = k[i];
        }
    else
        EACH(i, OF_FIELDS)
            state[i] = f[i];
}

/* What products need of the fields, [dof][field]: state[batch][point][...][lane]. Returns the first field's least value. */
static REAL take(const Cells *c, const Layers *layers, const REAL *fields, REAL *state)
{
    REAL least = MANY;
    const Fields what = {layers, (stored *)state, &least};
    EACH(b, c->batches) {
        v X[NODES * FIELDS];
        gather(c, b, FIELDS, fields, FIELDS, X);
        through(c, b, DIM, FIELDS, X, 0, X, take_at, &what);
    }
    return least;
}

typedef struct {
    const Layers *layers;
    const stored *state;
} Multiplied;

/* The first numbers are ``given``; the others are nothing. */
INLINE void multiply(const Multiplied *m, const Cells *c, long b, int q, int given, const v *u, v *r)
{
    const Layers *layers = m->layers;
    const stored *state = m->state + (b * POINTS + q) * STATE;
    v f[OF_FIELDS];
    if (!STORED)
        EACH(i, OF_FIELDS)
            f[i] = state[i];
    clear((1 + DIM) * NUMBERS, r);
    EACH(z, LEVELS) {
        const REAL *P = layers->P + z * NUMBERS, *dP = layers->dP + z * NUMBERS;
        v k[HESSIANS], s[DIM], w = zero, by_s[DIM];
        if (STORED)
            EACH(i, HESSIANS)
                k[i] = state[z * HESSIANS + i];
        else
            second(c, layers, b, q, z, f, k);
        const v *uu = k, *uw = k + DIM * (DIM + 1) / 2;
        EACH(j, given)
            w += dP[j] * u[j];
        v by_w = uw[DIM] * w;
        EACH(a, DIM) {
            s[a] = zero;
            EACH(j, given)
                s[a] += P[j] * u[(1 + a) * given + j];
            by_s[a] = uw[a] * w;
            by_w += uw[a] * s[a];
            EACH(d, a + 1) {
                by_s[a] += *uu * s[d];
                if (d < a)
                    by_s[d] += *uu * s[a];
                ++uu;
            }
        }
        EACH(j, NUMBERS) {
            r[j] += dP[j] * by_w;
            EACH(a, DIM)
                r[(1 + a) * NUMBERS + j] += P[j] * by_s[a];
        }
    }
}

INLINE void multiply_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    multiply(what, c, b, q, NUMBERS, u, r);
}

/* y += A x, [dof][number]. */
static void product(const Cells *c, const Layers *layers, const REAL *state, const REAL *x, REAL *y)
{
    const Multiplied what = {layers, (const stored *)state};
    EACH(b, c->batches) {
        v X[NODES * NUMBERS], Y[NODES * NUMBERS];
        gather(c, b, NUMBERS, x, NUMBERS, X);
        clear(NODES * NUMBERS, Y);
        through(c, b, DIM, NUMBERS, X, NUMBERS, Y, multiply_at, &what);
        scatter(c, b, NUMBERS, Y, y, NUMBERS);
    }
}

/* The derivative of the energy by the first field; u has the potential's numbers and the fields. */
INLINE void derive_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    const Layers *layers = what;
    const stored *inverse = inverse_at(c, b, q);
    const REAL *constants = layers->constants;
    const v measure = measure_at(c, b, q);
    v of_x[(1 + DIM) * NUMBERS], of_fields[(1 + DIM) * FIELDS], f[OF_FIELDS];
    EACH(a, 1 + DIM) {
        EACH(j, NUMBERS)
            of_x[a * NUMBERS + j] = u[a * (NUMBERS + FIELDS) + j];
        EACH(n, FIELDS)
            of_fields[a * FIELDS + n] = u[a * (NUMBERS + FIELDS) + NUMBERS + n];
    }
    in_space(c, b, q, FIELDS, of_fields, f);
    clear(1 + DIM, r);
    EACH(z, LEVELS) {
        const REAL zeta = layers->zeta[z];
        const v weight = measure * layers->weights[z];
        v u[GDIM], w = zero, by, by_slope[GDIM];
        EACH(i, GDIM)
            u[i] = zero;
        EACH(j, NUMBERS)
            w += layers->dP[z * NUMBERS + j] * of_x[j];
        EACH(a, DIM) {
            v s = zero;
            EACH(j, NUMBERS)
                s += layers->P[z * NUMBERS + j] * of_x[(1 + a) * NUMBERS + j];
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
        v X[NODES * MOST], of_x[NODES * NUMBERS], of_fields[NODES * FIELDS], Y[NODES];
        gather(c, b, NUMBERS, x, NUMBERS, of_x);
        gather(c, b, FIELDS, fields, FIELDS, of_fields);
        EACH(i, NODES) {
            EACH(j, NUMBERS)
                X[i * (NUMBERS + FIELDS) + j] = of_x[i * NUMBERS + j];
            EACH(n, FIELDS)
                X[i * (NUMBERS + FIELDS) + NUMBERS + n] = of_fields[i * FIELDS + n];
        }
        clear(NODES, Y);
        through(c, b, DIM, NUMBERS + FIELDS, X, 1, Y, derive_at, layers);
        scatter(c, b, 1, Y, y, 1);
    }
}
