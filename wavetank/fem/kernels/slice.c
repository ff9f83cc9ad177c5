/* A slice or ring on one rank: potentials of column masses and surface potentials, stages, and what is recorded of states.

NUMBERS, FIELDS     of a degree of freedom: of the potential, of what the layer's energy depends on
LEANS               whether a wall leans, so that columns are found by Newton's method
EACH_WALL(f)        f(prefix, number) of each wall that moves */
enum { POSITION, SPEED, ACCELERATION };
enum { KINETIC, POTENTIAL, WALL, MASS, POWER, DAMPED, HIGHEST, LARGEST, OF_A_ROW };   /* of tank/seen.py */

typedef struct {
    int dofs, carries, most_iterations, iterations, trials, walls_moving;
    double celerity, tolerance, round_off;
    const Mass *mass, *mean;            /* of J at the surface, and its mean over the column */
    const Mass *potential;              /* the density of potential energy */
    double *mean_column, *before, *change;
    const Cells *cells;
    const float_Cells *float_cells;
    const Layers *layers;
    const float_Layers *float_layers;
    const float_Chain *modes;
    const Guesses *guesses;
    const Wall **walls;
    const surface_Lines *lines;         /* of the surface, whose largest velocity and slope are found with a potential; or null */
    const int *order, *carried;
    const double *damping;
    const double **fields;
    double *column, *phi, *rows, *image, *inputs, *steps, *wall, *correction;
    double *held_phi, *held_column, *held_mu;
    float *float_rows, *float_state, *work;
} Tank;

/* A stage z = c + a f(z). */
typedef struct {
    Tank *tank;
    const Advection *advection;
    const Mixing *mixing;
    double *residual, *image, *nothing, *missed;
    double away, length;
} Stage;

typedef struct {
    int paddles, speeds;
    double *eta, *rise, *psi, *numbers, *rates, *velocities;
} Sight;

static void apply(const Mass *m, const double *x, double *y)
{
    memset(y, 0, sizeof(double) * m->dofs);
    mass_multiply(m, x, y);
}

/* y = a int V . grad x v dX, or, not ``slopes``, a int x V . grad v dX. */
static void advect(const Advection *w, double a, int slopes, const double *x, double *y)
{
    memset(y, 0, sizeof(double) * w->dofs);
    velocity_carry(w->cells, w->velocity, slopes, x, y);
    EACH(i, w->dofs)
        y[i] *= a;
}

/* The velocities at the surface of a state, cut off at ``most``. Returns the largest along the bottom. */
static double set_velocity(const Advection *w, double most, const double *eta, const double *psi, const double *rate,
                   const double *walls)
{
    const long n = w->dofs, fields = w->fields;
    double *surface = w->room, *B = w->vertical;
    mass_solve(w->mass, rate, B);
    EACH(i, n) {
        double *at = surface + fields * i;
        at[0] = eta[i], at[1] = psi[i], at[2] = B[i];
        for (long k = 3; k < fields; ++k)
            at[k] = walls[(k - 3) * n + i];
    }
    memset(B, 0, sizeof(double) * n);
    const double fastest = velocity_move(w->cells, most, w->axis, surface, w->velocity, B);
    mass_solve(w->mass, B, B);
    EACH(i, n)
        B[i] = B[i] > most ? most : B[i] < -most ? -most : B[i];
    return fastest;
}

/* The residual of a stage of weight a, [Q, psi], preconditioned; ``carried`` by the current, or not. */
static void precondition(const Advection *w, double a, int carried, const double *residual, double *found)
{
    const long n = w->dofs;
    const double *B = w->vertical, *q = residual, *psi = residual + n, g = w->gravity;
    double *eta = w->room, *r_chi = eta + n, *work = r_chi + n, *kept = found, *chi = found + n, made = 0.0;
    memcpy(r_chi, psi, sizeof(double) * n);
    const int moves = w->still != w->mass;
    if (carried || moves)
        mass_solve(w->mass, q, work);
    if (carried)
        EACH(i, n)
            r_chi[i] -= B[i] * work[i];
    if (moves) {
        EACH(i, n)
            eta[i] = r_chi[i] / (a * a * g) - work[i] / a;
        apply(w->still, eta, work);
    } else {
        apply(w->mass, r_chi, work);
        EACH(i, n)
            work[i] = work[i] / (a * a * g) - q[i] / a;
    }
    layers_respond(w->modes, w->shares, work, chi, w->modes_work);
    EACH(i, n)
        eta[i] = (r_chi[i] - chi[i]) / (a * g);
    apply(w->mass, eta, kept);
    if (carried) {
        advect(w, a, 1, chi, work);
        mass_solve(w->mass, work, work);
        EACH(i, n)
            chi[i] -= work[i];
        advect(w, a, 0, eta, work);
        EACH(i, n)
            kept[i] += work[i];
        mass_solve(w->mass, work, work);
        EACH(i, n)
            chi[i] += B[i] * (eta[i] + work[i]);
    }
    EACH(i, n)
        made += kept[i] - q[i];
    EACH(i, n)
        kept[i] -= w->uniform[i] * (made / w->of_metre);
}

#if LEANS
/* Columns of masses beside a paddle that leans, as ``ShapedColumns.solve`` finds them; 0 where they do not converge. */
static int lean(Tank *w, const double *q)
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
        mean_weigh(w->mean);
        memset(w->change, 0, sizeof(double) * n);
        mean_multiply(w->mean, w->column, w->change);
        EACH(i, n)
            w->change[i] = q[i] - w->change[i];
        mass_solve(w->mass, w->change, w->change);
        EACH(i, n)
            w->column[i] += w->change[i], square += w->change[i] * w->change[i];
        if (square <= bound || square * square <= bound * last) {
            mass_weigh(w->mass);
            mass_factor(w->mass);
            return 1;
        }
        last = square;
    }
    memcpy(w->column, w->before, sizeof(double) * n);
    return 0;
}

#endif

/* The column, the surface potential less its mean, and what start values are found by; 0 of what is no surface of water.
   And how much higher it is than at masses ``near``, if there are any. */
static int begin(Tank *w, const double *q, const double *p, const double *still, const double *near, double *rise,
                 double *level, double *square)
{
    const long n = w->dofs;
    double sum = 0.0, squares = 0.0;
    int positive = 1;
    EACH(i, near ? n : 0)
        rise[i] = q[i] - near[i];
#if LEANS
    if (!lean(w, q))
        return 0;
    if (near)
        mass_solve(w->mass, rise, rise);
#else
    if (near)
        mass_solve_both(w->mass, q, rise, w->column, rise);
    else
        mass_solve(w->mass, q, w->column);
#endif
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
static void by_walls(Tank *w)
{
#define BY_POTENTIAL(wall, k) wall##_by_potential(w->walls[k], w->column);
    EACH_WALL(BY_POTENTIAL)
    if (w->walls_moving < 2)
        return;
    memset(w->wall, 0, sizeof(double) * w->dofs * NUMBERS);
    EACH(k, w->carries)
        EACH(j, NUMBERS)
            EACH(one, w->walls_moving)
                w->wall[w->carried[k] * NUMBERS + j] += w->walls[one]->by_potential[w->carried[k] * NUMBERS + j];
}

/* Set the potential of masses q and surface potential p, as the walls move. What is found, one behind the other: its flow
   less its mean, and the wall's; the negative of M^-1 of its energy's derivative by the column, and that; q and p.
   ``recorded`` ones are known, ``near`` and ``rise`` are as of ``begin``. Told are the mean of p, phi A phi, and the square of
   what it is found by. Returns the iterations, or -1 of what is not as usual. */
static int set(Tank *w, const double *q, const double *p, const double *still, int recorded, const double *near, double *rise,
               double *flow, double *told)
{
    const int most = w->guesses->most, known = recorded - 1 < most ? recorded - 1 : most, place = (recorded - 1) % most;
    const long n = w->dofs;
    double *by_column = flow + 2 * n;
    int iterations = 0;
    if (!begin(w, q, p, still, near, rise, told, told + 2))
        return -1;
    EACH(f, FIELDS)
        EACH(i, n)
            w->rows[i * FIELDS + f] = w->fields[f][i];
    EACH(i, n)
        EACH(f, FIELDS)
            w->float_rows[i * FIELDS + f] = w->rows[w->order[i] * FIELDS + f];
    const double least = layers_take(w->cells, w->layers, w->rows, w->rows);
    single_take(w->float_cells, w->float_layers, w->float_rows, w->float_state);
    by_walls(w);
    history_project(w->guesses, known, w->inputs);
    if (!history_guess(w->guesses, known, NUMBERS, w->phi))
        EACH(i, n)
            memset(w->phi + i * NUMBERS, 0, sizeof(double) * (NUMBERS - 1));
    do {
        memset(w->image, 0, sizeof(double) * n * NUMBERS);
        layers_product(w->cells, w->layers, w->rows, w->phi, w->image);
        const int taken = single_correct(w->float_cells, w->float_layers, w->float_state, w->modes, w->wall,
                                         w->walls_moving ? NUMBERS : 0, w->phi, w->image, w->tolerance,
                                         w->most_iterations - iterations, w->steps, w->correction, w->work);
        if (taken < 0 || !(least > 0.0) || !isfinite(w->correction[0]))
            return -1;
        w->iterations = taken, iterations += taken;
    } while (w->correction[1] > 1.0);
    history_record(w->guesses, known, place, w->inputs, NUMBERS, w->phi);
    double mean = 0.0;
    EACH(i, n)
        mean += w->image[i * NUMBERS + NUMBERS - 1] / n;
    EACH(i, n)
        flow[i] = w->image[i * NUMBERS + NUMBERS - 1] - mean;
    EACH(k, w->carries)
        flow[w->carried[k]] += w->wall[w->carried[k] * NUMBERS + NUMBERS - 1];
    memset(by_column, 0, sizeof(double) * n);
    layers_derivative(w->cells, w->layers, w->rows, w->phi, by_column);
#define BY_COLUMN(wall, k)                                         \
    wall##_by_column(w->walls[k], w->column, w->phi);              \
    EACH(i, w->carries)                                            \
        by_column[w->carried[i]] += w->walls[k]->by_column[w->carried[i]];
    EACH_WALL(BY_COLUMN)
    mass_solve(w->mass, by_column, by_column);
    EACH(i, n)
        flow[n + i] = -by_column[i];
    told[1] = w->correction[0];
    memcpy(flow + 3 * n, q, sizeof(double) * n);
    memcpy(flow + 4 * n, p, sizeof(double) * n);
    return iterations;
}

/* The same, and where that has been asked for, the surface's largest velocity and slope are told, too. */
static int find(Tank *w, const double *q, const double *p, const double *still, int recorded, double *flow, double *told)
{
    const int iterations = set(w, q, p, still, recorded, NULL, NULL, flow, told);
    if (iterations >= 0 && w->lines)
        surface_largest(w->lines, w->inputs, p, told + 3);
    return iterations;
}

/* Where to begin the stage z = c + a f(z): points combined by their c, which are ``wrong`` by so much, one more of which is z
   where f is known, with what is missed of c preconditioned. */
static void begin_stage(const Stage *s, const double *z, const double *slope, const double *c, double a, int carried,
                        int mixed, double wrong, double *start)
{
    const long n = s->tank->dofs;
    const int others = mixed < s->mixing->most ? mixed : s->mixing->most;
    double *image = s->image;
    EACH(i, 2 * n)
        image[i] = z[i] - a * slope[i];
    history_add(s->mixing, others, mixed ? (mixed - 1) % s->mixing->most : s->mixing->most - 1, z, image);
    history_aim(s->mixing, others, c);
    history_combine(s->mixing, others, wrong * wrong, start, s->missed);
    precondition(s->advection, a, carried, s->missed, image);
    EACH(i, 2 * n)
        start[i] += image[i];
}

/* Find the potential of a point z = [q, p] of the stage z = c + a f(z), as ``set`` does, and where it leads: by the residual
   there, preconditioned, mixed with those of ``mixed`` points before. Returns the same as ``set``. */
static int attempt(Stage *s, const double *z, const double *c, double a, int carried, const double *still, int recorded,
                   int mixed, double *found, double *told, double *next)
{
    const long n = s->tank->dofs;
    const int iterations = set(s->tank, z, z + n, still, recorded, NULL, NULL, found, told);
    const int others = mixed < s->mixing->most ? mixed : s->mixing->most;
    double *residual = s->residual, *image = s->image, *point = s->residual;
    if (iterations < 0)
        return iterations;
    double length = 0.0;
    EACH(i, 2 * n) {
        const double scaled = z[i] / s->mixing->scale[i];
        residual[i] = z[i] - c[i] - a * found[i], length += scaled * scaled;
    }
    s->length = sqrt(length);
    precondition(s->advection, a, carried, residual, image);
    EACH(i, 2 * n)
        point[i] = z[i] - image[i];
    history_add(s->mixing, others, mixed ? (mixed - 1) % s->mixing->most : s->mixing->most - 1, point, image);
    history_aim(s->mixing, others, s->nothing);
    history_combine(s->mixing, others, 0.0, next, s->missed);
    s->away = sqrt(s->mixing->products[others]);
    return iterations;
}

/* The power of walls that move at the point that was found last, or at the mean of that and the one held; ``of_walls`` is
   their part of H. */
static double push(const Tank *w, const double *point, int between, double *of_walls)
{
    const double *phi = w->phi, *column = w->column, *mu = point + 2 * w->dofs;
    double power = 0.0;
    if (between) {
        EACH(i, w->dofs * NUMBERS)
            w->held_phi[i] = 0.5 * (w->held_phi[i] + phi[i]);
        EACH(i, w->dofs)
            w->held_column[i] = 0.5 * (w->held_column[i] + column[i]), w->held_mu[i] = 0.5 * (w->held_mu[i] + mu[i]);
        phi = w->held_phi, column = w->held_column, mu = w->held_mu;
    }
    *of_walls = 0.0;
#define PUSH(wall, k)                                                                                      \
    {                                                                                                      \
        const double *moves = w->walls[k]->moves;                                                          \
        double pushed[2];                                                                                  \
        wall##_power(w->walls[k], column, phi, mu, pushed);                                                \
        power += pushed[0] + moves[ACCELERATION] * pushed[1], *of_walls += moves[SPEED] * pushed[1];       \
    }
    EACH_WALL(PUSH)
    return power;
}

/* Hold the point that was found last. */
static void hold(const Tank *w, const double *point)
{
    memcpy(w->held_phi, w->phi, sizeof(double) * w->dofs * NUMBERS);
    memcpy(w->held_column, w->column, sizeof(double) * w->dofs);
    memcpy(w->held_mu, point + 2 * w->dofs, sizeof(double) * w->dofs);
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
static double damped(const Tank *w, const double *p, const double *point)
{
    double taken = 0.0;
    EACH(i, w->damping ? w->dofs : 0)
        taken += w->damping[i] * p[i] * point[i];
    return taken;
}

/* W at the point that was found last, which is linear in phi. */
static double of_walls(const Tank *w)
{
    double sum = 0.0;
    EACH(k, w->carries)
        EACH(j, NUMBERS)
            sum += w->wall[w->carried[k] * NUMBERS + j] * w->phi[w->carried[k] * NUMBERS + j];
    return sum;
}

/* H of a state [q, p] from the point near it that was found last, whose kinetic energy is told. */
static double energy_near(const Tank *w, const double *state, const double *point, double kinetic)
{
    const long n = w->dofs;
    double change = 0.0;
#pragma omp simd reduction(+ : change)
    EACH(i, n)
        change += point[2 * n + i] * (state[i] - point[3 * n + i]) + point[i] * (state[n + i] - point[4 * n + i]);
    return kinetic + change + potential_total(w->potential) + of_walls(w);
}

/* See masses q and surface potential p from the point near them that was found last, whose kinetic energy is told, and whose
   rise from them stands there: into a row, all but W, power and what damping takes. */
static void see_from(Tank *w, const double *q, const double *p, const double *point, double kinetic, double gravity,
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
    numbers[KINETIC] = kinetic + change - gravity * lift, numbers[POTENTIAL] = potential_total(w->potential) + gravity * lift;
    numbers[MASS] = mass;
    EACH(k, w->walls_moving) {
        memcpy(into->rates + 3 * (row * into->paddles + k), w->walls[k]->moves, 3 * sizeof(double));
        if (into->speeds == into->paddles)
            into->velocities[row * into->speeds + k] = w->walls[k]->moves[SPEED];
    }
}

/* The same with all of it, at the point. */
static void see(Tank *w, const double *q, const double *p, const double *point, double kinetic, double gravity,
                const Sight *into, long row)
{
    double *numbers = into->numbers + row * OF_A_ROW, *rise = into->rise + row * w->dofs;
    EACH(i, w->dofs)
        rise[i] = point[3 * w->dofs + i] - q[i];
    mass_solve(w->mass, rise, rise);
    see_from(w, q, p, point, kinetic, gravity, into, row);
    numbers[POWER] = push(w, point, 0, numbers + WALL), numbers[DAMPED] = damped(w, p, point);
}

/* The point ``to`` found, as ``set`` does, and a ``state`` between that ``at`` which is known and it seen from there, [q, p]
   each, with the power of the mean of both, and the mean of what damping takes. Returns as ``set``; -1 too where both are one. */
static int look(Tank *w, const double *state, const double *to, const double *at, const double *still, int recorded,
                double gravity, double *found, double *told, const Sight *into, long row)
{
    const long n = w->dofs;
    double *numbers = into->numbers + row * OF_A_ROW, of_mean;
    if (!memcmp(at + 3 * n, to, 2 * sizeof(double) * n))
        return -1;
    hold(w, at);
    const int iterations = set(w, to, to + n, still, recorded, state, into->rise + row * n, found, told);
    if (iterations < 0)
        return iterations;
    see_from(w, state, state + n, found, 0.5 * told[1], gravity, into, row);
    numbers[WALL] = of_walls(w), numbers[POWER] = push(w, found, 1, &of_mean);
    numbers[DAMPED] = 0.5 * (damped(w, state + n, at) + damped(w, state + n, found));
    return iterations;
}
