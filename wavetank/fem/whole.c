/* A potential along a slice or ring, found as a whole, of wavetank/fem/whole.py: functions of other kernels one after the
other, which are known by where they are.

NUMBERS, FIELDS of a degree of freedom: of the potential, of what the layer's energy depends on */
#include <math.h>
#include <stdint.h>
#include <string.h>

typedef void Solve(const void *chain, const double *b, double *x, double *work);
typedef void SolveBoth(const void *chain, const double *b, const double *d, double *x, double *y, double *work);
typedef double Take(const void *cells, const void *layers, const double *fields, double *state);
typedef float TakeSingle(const void *cells, const void *layers, const float *fields, float *state);
typedef void Product(const void *cells, const void *layers, const double *state, const double *x, double *y);
typedef void Weigh(const void *cells, const double *constants, const double *fields, double *weights);
typedef void Multiply(const void *cells, const double *weights, const double *x, double *y);
typedef double Square(const void *cells, const double *weights, const double *x);
typedef void Factor(const void *cells, const double *weights, double *kept, const void *chain);
typedef void ByPotential(const void *work, double speed, const double *column, double *y);
typedef void ByColumn(const void *work, double speed, const double *column, const double *phi, double *y);
typedef void Hold(const void *strip, const double *mu);
typedef void Push(const void *strip, double position, double speed, const double *mu, int between, double *found);
typedef void Aim(long size, int known, const float *ways, const double *last, const double *x, double *away,
                 double *products);
typedef int Start(long rows, int numbers, int stride, int known, int most, const double *gram, const double *products,
                  double shortest, const double *answer, const float *steps, double *y);
typedef void Keep(long size, long rows, int numbers, int stride, int known, int place, int most, const double *x,
                  const double *y, const double *away, const double *products, double *last, double *answer, float *ways,
                  float *steps, double *gram);
typedef int Correct(const void *cells, const void *layers, const float *state, const void *chain, const double *wall,
                    int stride, double *phi, double *image, double tolerance, int most, double *steps, void *found,
                    float *work);

typedef void Largest(const void *lines, const double *eta, const double *psi, double *found);
typedef void Precondition(const void *inverse, double a, int carried, const double *residual, double *found);
typedef void Add(const void *points, int known, int place, const double *z, const double *image);
typedef void AimAt(const void *points, int known, const double *c);
typedef void Combine(const void *points, int known, double wrong, double *z, double *missed);

enum { POSITION, SPEED, ACCELERATION };
enum { KINETIC, POTENTIAL, WALL, MASS, POWER, DAMPED, HIGHEST, LARGEST, OF_A_ROW };   /* of tank/seen.py */

#define EACH(i, most) for (long i = 0; i < (most); ++i)
#define EACH_PADDLE(one) for (Paddle *one = w->paddles; one; one = one->next)
#define CALL_OF(Kind, which) ((Kind *)which)
#define CALL(Kind, which) CALL_OF(Kind, w->which)

/* Take over what a mass matrix depends on as it is. */
static void weigh(const Weighed *m, long n)
{
    EACH(f, m->width)
        EACH(i, n)
            m->rows[i * m->width + f] = m->fields[f][i];
    ((Weigh *)m->weigh)(m->cells, m->constants, m->rows, m->weights);
}

/* Columns of masses beside a paddle that leans, as ``ShapedColumns.solve`` finds them; 0 where they do not converge. */
static int lean(Whole *w, const double *q)
{
    const long n = w->dofs;
    double bound = 0.0, last = 0.0;
    memcpy(w->before, w->column, sizeof(double) * n);
    EACH(i, n)
        bound += w->column[i] * w->column[i];
    bound *= w->round_off * w->round_off;
    EACH(k, w->trials) {
        double square = 0.0;
        memcpy(w->mean_column, w->column, sizeof(double) * n);
        weigh(w->mean, n);
        memset(w->change, 0, sizeof(double) * n);
        ((Multiply *)w->mean->multiply)(w->mean->cells, w->mean->weights, w->column, w->change);
        EACH(i, n)
            w->change[i] = q[i] - w->change[i];
        CALL(Solve, solve_mass)(w->mass, w->change, w->change, w->mass_work);
        EACH(i, n)
            w->column[i] += w->change[i], square += w->change[i] * w->change[i];
        if (square <= bound || square * square <= bound * last) {
            weigh(w->weighed, n);
            CALL(Factor, factor_mass)(w->weighed->cells, w->weighed->weights, w->kept, w->mass);
            return 1;
        }
        last = square;
    }
    memcpy(w->column, w->before, sizeof(double) * n);
    return 0;
}

/* The column, the surface potential less its mean, and what start values are found by; 0 of what is no surface of water.
   And how much higher it is than at masses ``near``, if there are any. */
static int begin(Whole *w, const double *q, const double *p, const double *still, const double *near, double *rise,
                 double *level, double *square)
{
    const long n = w->dofs;
    double sum = 0.0, squares = 0.0;
    int positive = 1;
    EACH(i, near ? n : 0)
        rise[i] = q[i] - near[i];
    if (w->mean) {
        if (!lean(w, q))
            return 0;
        if (near)
            CALL(Solve, solve_mass)(w->mass, rise, rise, w->mass_work);
    } else if (near)
        CALL(SolveBoth, solve_both)(w->mass, q, rise, w->column, rise, w->mass_work);
    else
        CALL(Solve, solve_mass)(w->mass, q, w->column, w->mass_work);
    EACH(i, n)
        sum += p[i], positive &= w->column[i] > 0.0;
    const double mean = sum / n, per_speed = 1.0 / w->celerity;
    double *eta = w->inputs, *psi = eta + n;
#pragma omp simd reduction(+ : squares)
    EACH(i, n) {
        eta[i] = w->column[i] - still[i], psi[i] = per_speed * (p[i] - mean);
        squares += eta[i] * eta[i] + psi[i] * psi[i];
    }
    EACH(i, n)
        w->phi[i * NUMBERS + NUMBERS - 1] = p[i] - mean;
    *level = mean, *square = squares;
    return positive && isfinite(sum);
}

/* What the walls add to the derivative by the potential. */
static void by_walls(Whole *w)
{
    EACH_PADDLE(one)
        ((ByPotential *)one->by_potential)(one->paddle, one->moves[SPEED], w->column, one->wall);
    if (!w->paddles || !w->paddles->next)
        return;
    memset(w->wall, 0, sizeof(double) * w->dofs * NUMBERS);
    EACH_PADDLE(one)
        EACH(k, w->carries)
            EACH(j, NUMBERS)
                w->wall[w->carried[k] * NUMBERS + j] += one->wall[w->carried[k] * NUMBERS + j];
}

/* Set the potential of masses q and surface potential p, as the walls move. What is found, one behind the other: its flow
   less its mean, and the wall's; the negative of M^-1 of its energy's derivative by the column, and that; q and p.
   ``recorded`` ones are known, ``near`` and ``rise`` are as of ``begin``. Told are the mean of p, phi A phi, and the square of
   what it is found by. Returns the iterations, or -1 of what is not as usual. */
static int set(Whole *w, const double *q, const double *p, const double *still, int recorded, const double *near, double *rise,
               double *flow, double *told)
{
    const int known = recorded - 1 < w->most ? recorded - 1 : w->most, place = (recorded - 1) % w->most;
    const long n = w->dofs, inputs = (w->paddles ? 3 : 2) * n;
    double *by_column = flow + 2 * n;
    int iterations = 0;
    if (!begin(w, q, p, still, near, rise, told, told + 2))
        return -1;
    EACH(f, FIELDS)
        EACH(i, n)
            w->rows[i * FIELDS + f] = w->fields[f][i];
    EACH(i, n)
        EACH(f, FIELDS)
            w->single_rows[i * FIELDS + f] = w->rows[w->order[i] * FIELDS + f];
    const double least = CALL(Take, take)(w->cells, w->layers, w->rows, w->rows);
    CALL(TakeSingle, take_single)(w->single_cells, w->single_layers, w->single_rows, w->single_state);
    by_walls(w);
    CALL(Aim, aim)(inputs, known, w->ways, w->last, w->inputs, w->away, w->products);
    if (!CALL(Start, start)(n, NUMBERS - 1, NUMBERS, known, w->most, w->gram, w->products, w->shortest, w->answer, w->steps,
                            w->phi))
        EACH(i, n)
            memset(w->phi + i * NUMBERS, 0, sizeof(double) * (NUMBERS - 1));
    do {
        memset(w->image, 0, sizeof(double) * n * NUMBERS);
        CALL(Product, product)(w->cells, w->layers, w->rows, w->phi, w->image);
        const int taken = CALL(Correct, correct)(w->single_cells, w->single_layers, w->single_state, w->modes, w->wall,
                                                 w->paddles ? NUMBERS : 0, w->phi, w->image, w->tolerance,
                                                 w->iterations - iterations, w->lengths, w->found, w->work);
        if (taken < 0 || !(least > 0.0) || !isfinite(w->found->kinetic))
            return -1;
        w->last_iterations = taken, iterations += taken;
    } while (w->found->residual > 1.0);
    CALL(Keep, keep)(inputs, n, NUMBERS - 1, NUMBERS, known, place, w->most, w->inputs, w->phi, w->away, w->products, w->last,
                     w->answer, w->ways, w->steps, w->gram);
    double mean = 0.0;
    EACH(i, n)
        mean += w->image[i * NUMBERS + NUMBERS - 1] / n;
    EACH(i, n)
        flow[i] = w->image[i * NUMBERS + NUMBERS - 1] - mean;
    EACH(k, w->carries)
        flow[w->carried[k]] += w->wall[w->carried[k] * NUMBERS + NUMBERS - 1];
    memset(by_column, 0, sizeof(double) * n);
    CALL(Product, derivative)(w->cells, w->layers, w->rows, w->phi, by_column);
    EACH_PADDLE(one) {
        ((ByColumn *)one->by_column)(one->paddle_by_column, one->moves[SPEED], w->column, w->phi, one->by_wall);
        EACH(k, w->carries)
            by_column[w->carried[k]] += one->by_wall[w->carried[k]];
    }
    CALL(Solve, solve_mass)(w->mass, by_column, by_column, w->mass_work);
    EACH(i, n)
        flow[n + i] = -by_column[i];
    told[1] = w->found->kinetic;
    memcpy(flow + 3 * n, q, sizeof(double) * n);
    memcpy(flow + 4 * n, p, sizeof(double) * n);
    return iterations;
}

/* The same, and where that has been asked for, the surface's largest velocity and slope are told, too. */
static int find(Whole *w, const double *q, const double *p, const double *still, int recorded, double *flow, double *told)
{
    const int iterations = set(w, q, p, still, recorded, NULL, NULL, flow, told);
    if (iterations >= 0 && w->largest)
        CALL(Largest, largest)(w->lines, w->inputs, p, told + 3);
    return iterations;
}

/* What finds the surface's largest velocity and slope; 0: nothing. */
static void ask(Whole *w, uintptr_t largest, uintptr_t lines)
{
    w->largest = (void *)largest, w->lines = (void *)lines;
}

/* Where to begin the stage z = c + a f(z): points combined by their c, which are ``wrong`` by so much, one more of which is z
   where f is known, with what is missed of c preconditioned. */
static void begin_stage(const Attempt *s, const double *z, const double *slope, const double *c, double a, int carried,
                        int mixed, double wrong, double *start)
{
    const long n = s->whole->dofs;
    const int others = mixed < s->most_mixed ? mixed : s->most_mixed;
    double *image = s->image;
    EACH(i, 2 * n)
        image[i] = z[i] - a * slope[i];
    CALL_OF(Add, s->add)(s->points, others, mixed ? (mixed - 1) % s->most_mixed : s->most_mixed - 1, z, image);
    CALL_OF(AimAt, s->aim)(s->points, others, c);
    CALL_OF(Combine, s->combine)(s->points, others, wrong * wrong, start, s->missed);
    CALL_OF(Precondition, s->precondition)(s->inverse, a, carried, s->missed, image);
    EACH(i, 2 * n)
        start[i] += image[i];
}

/* Find the potential of a point z = [q, p] of the stage z = c + a f(z), as ``set`` does, and where it leads: by the residual
   there, preconditioned, mixed with those of ``mixed`` points before. Returns the same as ``set``. */
static int attempt(Attempt *s, const double *z, const double *c, double a, int carried, const double *still, int recorded,
                   int mixed, double *found, double *told, double *next)
{
    const long n = s->whole->dofs;
    const int iterations = set(s->whole, z, z + n, still, recorded, NULL, NULL, found, told);
    const int others = mixed < s->most_mixed ? mixed : s->most_mixed;
    double *residual = s->residual, *image = s->image, *point = s->residual;
    if (iterations < 0)
        return iterations;
    double length = 0.0;
    EACH(i, 2 * n) {
        const double scaled = z[i] / s->scale[i];
        residual[i] = z[i] - c[i] - a * found[i], length += scaled * scaled;
    }
    s->length = sqrt(length);
    CALL_OF(Precondition, s->precondition)(s->inverse, a, carried, residual, image);
    EACH(i, 2 * n)
        point[i] = z[i] - image[i];
    CALL_OF(Add, s->add)(s->points, others, mixed ? (mixed - 1) % s->most_mixed : s->most_mixed - 1, point, image);
    CALL_OF(AimAt, s->aim)(s->points, others, s->nothing);
    CALL_OF(Combine, s->combine)(s->points, others, 0.0, next, s->missed);
    s->away = sqrt(s->products[others]);
    return iterations;
}

/* The power of walls that move at the point that was found last, or between that and the one held; ``of_walls`` is their
   part of H. */
static double push(const Whole *w, const double *point, int between, double *of_walls)
{
    double power = 0.0;
    *of_walls = 0.0;
    EACH_PADDLE(one) {
        double pushed[2];
        ((Push *)one->push)(one->strip, one->moves[POSITION], one->moves[SPEED], point + 2 * w->dofs, between, pushed);
        power += pushed[0] + one->moves[ACCELERATION] * pushed[1];
        *of_walls += one->moves[SPEED] * pushed[1];
    }
    return power;
}

/* The highest of numbers, and the largest magnitude, as their bits are ordered, which puts what is no number beyond all. */
static void heights(const double *x, long n, double *highest, double *largest)
{
    int64_t most = INT64_MIN, size = 0;
    EACH(i, n) {
        int64_t bits;
        memcpy(&bits, x + i, sizeof bits);
        const int64_t rank = bits ^ (bits >> 63 & INT64_MAX), without_sign = bits & INT64_MAX;
        most = rank > most ? rank : most, size = without_sign > size ? without_sign : size;
    }
    most ^= most >> 63 & INT64_MAX;
    memcpy(largest, &size, sizeof size), memcpy(highest, *largest == *largest ? &most : &size, sizeof size);
}

/* What damping takes of surface potential p, as seen from a point; 0 where there is none. */
static double damped(const Whole *w, const double *p, const double *point)
{
    double taken = 0.0;
    EACH(i, w->damping ? w->dofs : 0)
        taken += w->damping[i] * p[i] * point[i];
    return taken;
}

/* W at the point that was found last, which is linear in phi. */
static double of_walls(const Whole *w)
{
    double sum = 0.0;
    EACH(k, w->carries)
        EACH(j, NUMBERS)
            sum += w->wall[w->carried[k] * NUMBERS + j] * w->phi[w->carried[k] * NUMBERS + j];
    return sum;
}

/* g eta M eta of the point that was found last, over g. */
static double moment_of(const Whole *w)
{
    if (w->moment)
        weigh(w->moment, w->dofs);
    return CALL(Square, square)(w->mass_cells, w->moment ? w->moment->weights : w->weights, w->inputs);
}

/* H of a state [q, p] from the point near it that was found last, whose kinetic energy is told. */
static double energy_near(const Whole *w, const double *state, const double *point, double kinetic, double gravity)
{
    const long n = w->dofs;
    double change = 0.0;
#pragma omp simd reduction(+ : change)
    EACH(i, n)
        change += point[2 * n + i] * (state[i] - point[3 * n + i]) + point[i] * (state[n + i] - point[4 * n + i]);
    return kinetic + change + 0.5 * gravity * moment_of(w) + of_walls(w);
}

/* See masses q and surface potential p from the point near them that was found last, whose kinetic energy is told, and whose
   rise from them stands there: into a row, all but W, power and what damping takes. */
static void see_from(Whole *w, const double *q, const double *p, const double *point, double kinetic, double gravity,
                     const Sight *into, long row)
{
    const long n = w->dofs;
    const double *by_p = point, *by_q = point + 2 * n, *at_q = point + 3 * n, *at_p = point + 4 * n, *rise = into->rise + row * n;
    const double *at_point = w->inputs; /* the elevation there */
    double *eta = into->eta + row * n, *psi = into->psi + row * n;
    double *numbers = into->numbers + row * OF_A_ROW, change = 0.0, lift = 0.0, mass = 0.0;
#pragma omp simd reduction(+ : change, lift, mass)
    EACH(i, n) {
        const double away = at_q[i] - q[i];
        mass += q[i];
        change -= by_q[i] * away + by_p[i] * (at_p[i] - p[i]);
        lift -= at_point[i] * away;
        eta[i] = at_point[i] - rise[i], psi[i] = p[i];
    }
    heights(eta, n, numbers + HIGHEST, numbers + LARGEST);
    numbers[KINETIC] = kinetic + change - gravity * lift, numbers[POTENTIAL] = gravity * (0.5 * moment_of(w) + lift);
    numbers[MASS] = mass;
    long paddle = into->paddles; /* each knows the one before it */
    EACH_PADDLE(one) {
        --paddle;
        memcpy(into->rates + 3 * (row * into->paddles + paddle), one->moves, 3 * sizeof(double));
        if (into->speeds == into->paddles)
            into->velocities[row * into->speeds + paddle] = one->moves[SPEED];
    }
}

/* The same with all of it, at the point. */
static void see(Whole *w, const double *q, const double *p, const double *point, double kinetic, double gravity,
                const Sight *into, long row)
{
    double *numbers = into->numbers + row * OF_A_ROW, *rise = into->rise + row * w->dofs;
    EACH(i, w->dofs)
        rise[i] = point[3 * w->dofs + i] - q[i];
    CALL(Solve, solve_mass)(w->mass, rise, rise, w->mass_work);
    see_from(w, q, p, point, kinetic, gravity, into, row);
    numbers[POWER] = push(w, point, 0, numbers + WALL), numbers[DAMPED] = damped(w, p, point);
}

/* The point ``to`` found, as ``set`` does, and a ``state`` between that ``at`` which is known and it seen from there, [q, p]
   each, with the power of the mean of both, and the mean of what damping takes. Returns as ``set``; -1 too where both are one. */
static int look(Whole *w, const double *state, const double *to, const double *at, const double *still, int recorded,
                double gravity, double *found, double *told, const Sight *into, long row)
{
    const long n = w->dofs;
    double *numbers = into->numbers + row * OF_A_ROW, of_mean;
    if (!memcmp(at + 3 * n, to, 2 * sizeof(double) * n))
        return -1;
    EACH_PADDLE(one)
        ((Hold *)one->hold)(one->strip, at + 2 * n);
    const int iterations = set(w, to, to + n, still, recorded, state, into->rise + row * n, found, told);
    if (iterations < 0)
        return iterations;
    see_from(w, state, state + n, found, 0.5 * told[1], gravity, into, row);
    numbers[WALL] = of_walls(w), numbers[POWER] = push(w, found, 1, &of_mean);
    numbers[DAMPED] = 0.5 * (damped(w, state + n, at) + damped(w, state + n, found));
    return iterations;
}
