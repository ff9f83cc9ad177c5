/* ==== layer ==== */
/* The energy of a horizontal layer at a point; follows cells.c.

NUMBERS         vertical functions, the last of which belongs to the surface potential
LEVELS          number of layers
FIELDS          fields of the density
OF_FIELDS       their values and slopes at a point
HESSIANS        second derivatives with respect to (u_0 ..., w) in reference coordinates: DIM (DIM + 1) / 2 + DIM + 1 */
#define OF_FIELDS ((1 + GDIM) * FIELDS)

/* Second derivatives of the energy at a level, times all weights: k[uu ..., uw ..., ww]. */
INLINE void second(const Cells *c, const Layers *layers, long b, int q, int z, const v *f, v *k)
{
    const stored *inverse = inverse_at(c, b, q);
    const v weight = measure_at(c, b, q) * layers->weights[z];
    UNUSED UNUSED const REAL *constants = layers->constants, zeta = layers->zeta[z];
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

/* ==== operator ==== */
/* The operator of wavetank/fem/layers.py; follows the section layer.

STORED          whether the state is the second derivatives, state[batch][point][level][...][lane], or the fields,
                state[dof][field], from which each product computes them */
#define MANY ((REAL)1e30)
#define BESIDE (STORED ? 0 : FIELDS) /* components of fields at the points */
#define SOME PART(LEVELS) /* levels in one loop */

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

/* Compute the state from the fields, [dof][field]. Returns the least value of the first field. */
SHARED REAL take(const Cells *c, const Layers *layers, const REAL *fields, REAL *state)
{
    REAL least = MANY;
    const Fields what = {layers, (stored *)state, &least};
    const Given given = {fields, STORED ? FIELDS : 1, FIELDS};
    over_cells(c, STORED ? DIM : 0, given, (Given){0}, 0, NULL, 0, take_at, &what);
    return least;
}

typedef struct {
    const Layers *layers;
    const REAL *state;
} Multiplied;

/* Slopes and vertical derivatives at levels from z, of the first ``given`` of ``width`` components. */
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

/* r += the products at a point for these levels. */
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

/* The first ``given`` components are those of the potential; fields may follow; others are zero. Results begin at ``first``. */
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
    over_cells(c, DIM, (Given){x, given, NUMBERS}, (Given){state, BESIDE, FIELDS}, NUMBERS, y, NUMBERS, at, &what);
}

/* y += A x, [dof][component]. */
SHARED void product(const Cells *c, const Layers *layers, const REAL *state, const REAL *x, REAL *y)
{
    product_of(c, layers, state, NUMBERS, multiply_at, x, y);
}

/* The same for x whose last component is zero. */
SHARED void interior_product(const Cells *c, const Layers *layers, const REAL *state, const REAL *x, REAL *y)
{
    product_of(c, layers, state, NUMBERS - 1, within_at, x, y);
}

INLINE void derive_levels(const Layers *layers, const Cells *c, long b, int q, int z, int some, const v *x, const v *f, v *r)
{
    const stored *inverse = inverse_at(c, b, q);
    UNUSED const REAL *constants = layers->constants;
    v s[DIM][SOME], ws[SOME];
    at_levels(layers, z, some, NUMBERS, MOST, x, s, ws);
    EACH(k, some) {
        UNUSED const REAL zeta = layers->zeta[z + k];
        const v weight = measure_at(c, b, q) * layers->weights[z + k];
        UNUSED const v w = ws[k];
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

/* The derivative of the energy with respect to the first field; x has potential and fields. */
INLINE void derive_at(const void *what, const Cells *c, long b, int q, const v *x, v *r)
{
    v f[OF_FIELDS];
    in_space(c, b, q, FIELDS, x + NUMBERS, MOST, f);
    clear(1 + DIM, r);
    EACH(z, LEVELS / SOME)
        derive_levels(what, c, b, q, z * SOME, SOME, x, f, r);
    derive_levels(what, c, b, q, LEVELS - LEVELS % SOME, LEVELS % SOME, x, f, r);
}

/* y += the derivative of the energy of x with respect to the first field, [dof]. */
SHARED void derivative(const Cells *c, const Layers *layers, const REAL *fields, const REAL *x, REAL *y)
{
    over_cells(c, DIM, (Given){x, NUMBERS, NUMBERS}, (Given){fields, FIELDS, FIELDS}, 1, y, 1, derive_at, layers);
}

/* ==== wall ==== */
/* A moving wall of a slice: derivatives of its part W of the energy, and its power; follows cells.c.

All densities are generated from UFL: W at 1 m/s, in cells (FLUX) and at levels of the wall (END), and dH/dt at fixed (Q, psi)
for the velocity of the wall, in layers (RATE).

NUMBERS, LEVELS, ENDS       components of a potential; levels of the water, and of the quadrature at the wall
FIELDS, MU                  fields of densities, the first of which is the column; index of M_J^-1 H_h */
#define OF_FIELDS (2 * FIELDS)

typedef struct {
    const Wall *wall;
    double speed;
    v going, sped;
} Terms;

/* The density of W at 1 m/s at a point, and its derivatives with respect to the slope of psi and the column. */
INLINE v flux(const Wall *wall, const v *f, v psi_0, v *by_slope, v *by)
{
    UNUSED const double *constants = wall->layers->constants;
    v value, by_psi_0, by_h;
    FLUX
    *by_slope = by_psi_0, *by = by_h;
    return value;
}

/* The same at a level of the wall, with respect to the potential u minus psi and the column. */
INLINE double end(const Wall *wall, const v *f, int z, double u_z, double *by_u, double *by)
{
    UNUSED const double *constants = wall->layers->constants;
    UNUSED const v u = zero + u_z, zeta = zero + wall->end->zeta[z];
    v value, by_value, by_h;
    END
    *by_u = by_value[0], *by = by_h[0];
    return value[0];
}

/* dH/dt at a point of a layer with slope u_0 and vertical derivative w. */
INLINE v rate(const Wall *wall, const v *f, v u_0, v w, double zeta_z)
{
    UNUSED const double *constants = wall->layers->constants;
    UNUSED const v zeta = zero + zeta_z;
    v value;
    RATE
    return value;
}

static void take_over(const Wall *wall, const double *column, const double *mu)
{
    EACH(k, wall->count) {
        double *row = wall->rows + (long)wall->dofs[k] * FIELDS;
        EACH(f, FIELDS)
            row[f] = (f == 0 ? column : f == MU ? mu : wall->fields[f])[wall->dofs[k]];
    }
}

/* Fields at the wall, without slopes. */
INLINE void at_wall(const Wall *wall, v *f)
{
    EACH(n, FIELDS)
        f[2 * n] = zero + wall->rows[(long)wall->node * FIELDS + n], f[2 * n + 1] = zero;
}

/* The potential minus psi at a level of the wall. */
INLINE double above(const Wall *wall, int z, const double *phi)
{
    double sum = 0.0;
    EACH(j, NUMBERS - 1)
        sum += wall->end->P[z * NUMBERS + j] * phi[(long)wall->node * NUMBERS + j];
    return sum;
}

INLINE void by_slope_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    const Terms *terms = what;
    v f[OF_FIELDS], by;
    in_space(c, b, q, FIELDS, u, FIELDS, f);
    flux(terms->wall, f, zero, r + 1, &by);
    r[0] = zero, r[1] *= terms->speed * measure_at(c, b, q) * inverse_at(c, b, q)[0];
}

/* Set dW/dphi for a column in the rows in which it is not zero. */
SHARED void by_potential(const Wall *wall, const double *column)
{
    const Terms terms = {wall, wall->moves[1], zero, zero};
    double *y = wall->by_potential;
    v f[OF_FIELDS];
    take_over(wall, column, column);
    EACH(k, wall->count)
        y[(long)wall->dofs[k] * NUMBERS + NUMBERS - 1] = 0.0;
    const Given fields = {wall->rows, FIELDS, FIELDS};
    over_cells(wall->cells, 1, fields, (Given){0}, 1, y + NUMBERS - 1, NUMBERS, by_slope_at, &terms);
    at_wall(wall, f);
    y += (long)wall->node * NUMBERS;
    EACH(j, NUMBERS - 1)
        y[j] = 0.0;
    EACH(z, ENDS) {
        double by_u, by;
        end(wall, f, z, 1.0, &by_u, &by);
        EACH(j, NUMBERS - 1)
            y[j] += terms.speed * wall->end->weights[z] * by_u * wall->end->P[z * NUMBERS + j];
    }
}

INLINE void by_column_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    const Terms *terms = what;
    v f[OF_FIELDS], by_slope;
    in_space(c, b, q, FIELDS, u, FIELDS + 1, f);
    flux(terms->wall, f, inverse_at(c, b, q)[0] * u[FIELDS + 1 + FIELDS], &by_slope, r);
    r[0] *= terms->speed * measure_at(c, b, q), r[1] = zero;
}

/* Set dW/dh for a column and a potential in the rows in which it is not zero. */
SHARED void by_column(const Wall *wall, const double *column, const double *phi)
{
    const Terms terms = {wall, wall->moves[1], zero, zero};
    double *y = wall->by_column;
    v f[OF_FIELDS];
    take_over(wall, column, column);
    EACH(k, wall->count)
        y[wall->dofs[k]] = 0.0;
    const Given fields = {wall->rows, FIELDS, FIELDS}, psi = {phi + NUMBERS - 1, 1, NUMBERS};
    over_cells(wall->cells, 1, fields, psi, 1, y, 1, by_column_at, &terms);
    at_wall(wall, f);
    EACH(z, ENDS) {
        double by_u, by;
        end(wall, f, z, above(wall, z, phi), &by_u, &by);
        y[wall->node] += terms.speed * wall->end->weights[z] * by;
    }
}

INLINE void power_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    Terms *terms = (Terms *)what;
    const Layers *layers = terms->wall->layers;
    const v measure = measure_at(c, b, q), inverse = inverse_at(c, b, q)[0];
    v f[OF_FIELDS], by_slope, by, sum = zero;
    in_space(c, b, q, FIELDS, u + NUMBERS, MOST, f);
    EACH(z, LEVELS) {
        v slope = zero, w = zero;
        EACH(j, NUMBERS)
            slope += layers->P[z * NUMBERS + j] * u[MOST + j], w += layers->dP[z * NUMBERS + j] * u[j];
        sum += layers->weights[z] * rate(terms->wall, f, inverse * slope, w, layers->zeta[z]);
    }
    terms->going += measure * sum;
    terms->sped += measure * flux(terms->wall, f, inverse * u[MOST + NUMBERS - 1], &by_slope, &by);
}

/* dH/dt at fixed (Q, psi) for the velocity of the wall, and dH/dX_p', for a column, a potential and M_J^-1 H_h. */
SHARED void power(const Wall *wall, const double *column, const double *phi, const double *mu, double *found)
{
    Terms terms = {wall, 0.0, zero, zero};
    v f[OF_FIELDS];
    take_over(wall, column, mu);
    const Given given = {phi, NUMBERS, NUMBERS}, fields = {wall->rows, FIELDS, FIELDS};
    over_cells(wall->cells, 1, given, fields, 0, NULL, 0, power_at, &terms);
    found[0] = found[1] = 0.0;
    EACH(l, LANES)
        found[0] += terms.going[l], found[1] += terms.sped[l];
    at_wall(wall, f);
    EACH(z, ENDS) {
        double by_u, by;
        found[1] += wall->end->weights[z] * end(wall, f, z, above(wall, z, phi), &by_u, &by);
    }
}
