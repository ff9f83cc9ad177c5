/* A slice or ring on one rank: evaluations of the energy for masses and surface potentials, stages, and records of states.

NUMBERS, FIELDS     components of the potential; fields of the layer's energy
LEANS               whether a wall leans, so that columns follow from masses by Newton's method
EACH_WALL(f)        f(prefix, index) for each moving wall */
enum { POSITION, SPEED, ACCELERATION };

typedef struct {
    int dofs, carries, most_iterations, trials, walls_moving;
    double celerity, tolerance, round_off;
    const Mass *mass, *mean;            /* mass matrices of J at the surface, and of its mean over the column */
    const Mass *potential;              /* mass matrix of the potential energy */
    double *mean_column, *before, *change;
    const Cells *cells;
    const float_Cells *float_cells;
    const Layers *layers;
    const float_Layers *float_layers;
    const float_Chain *modes;
    const Guesses *guesses;
    const Wall **walls;
    const int *order, *carried;
    const double **fields;
    double *column, *phi, *rows, *image, *inputs, *steps, *wall, *correction;
    const double *scales;               /* [wall][degree of freedom]: factors of velocities in inputs of initial guesses */
    double *position;                   /* [degree of freedom]: the sum for two walls, or null */
    float *float_rows, *float_state, *work;
} Tank;

/* The preconditioner of a stage; see wavetank/tank/advection.py. */
typedef struct {
    Tank *tank;
    int dofs, fields, carried;      /* carried: whether advection is included */
    double gravity, of_metre;       /* the mass of a water column of one metre */
    const Mass *mass, *still;       /* matrices for the present position of the wall, and at rest */
    const Cells *cells;             /* largest and least velocity */
    const Chain *modes;
    const double *shares;           /* weights and work of the modes */
    double *modes_work, *velocity, *vertical, *room;
    const double *uniform, *axis;
} Advection;

/* A stage z = c + a f(z), its solver and its history; see wavetank/integrators/stages.py. */
typedef struct {
    Tank *tank;
    const Advection *advection;
    const Mixing *iterates, *points;
    double *residual, *image, *nothing, *missed, *found;
    double tolerance, floor, round_off, safety, uncertainty, root;
    int most;                       /* largest number of iterates */
    double size, contraction;       /* history; size is nan before the first solve */
    int evaluations, iterations, worn;  /* last solve; worn: the preconditioner must be renewed */
    double last_size, measured;     /* last solve; measured: its first contraction, or nan */
    double away, length;
} Stage;

/* Set the positions and velocities of the walls. */
static void displace(Tank *w)
{
    const long n = w->dofs;
    double *velocity = w->inputs + 2 * n;
    memset(velocity, 0, sizeof(double) * n);
    if (w->position)
        memset(w->position, 0, sizeof(double) * n);
    EACH(k, w->walls_moving) {
        const Wall *wall = w->walls[k];
        const double far = wall->moves[POSITION], fast = wall->moves[SPEED], *scale = w->scales + k * n;
        EACH(i, n) {
            wall->position[i] = wall->blending[i] * far, wall->speed[i] = wall->blending[i] * fast;
            velocity[i] += scale[i] * fast;
        }
        if (w->position)
            EACH(i, n)
                w->position[i] += wall->position[i];
    }
    mass_weigh(w->mass);
}

/* Set the column at an elevation, if columns depend on time, and the mass matrix with its factors. */
static void set_column(Tank *w, const double *eta, const double *still)
{
#if LEANS
    EACH(i, w->dofs)
        w->column[i] = still[i] + eta[i];
    mass_weigh(w->mass);
#endif
    mass_factor(w->mass);
}

/* Linearised change of elevation for a change of masses. */
static void elevation_change(Tank *w, const double *eta, const double *still, const double *dq, double *change)
{
    set_column(w, eta, still);
    mass_solve(w->mass, dq, change);
}

static void apply(const Mass *m, const double *x, double *y)
{
    memset(y, 0, sizeof(double) * m->dofs);
    mass_multiply(m, x, y);
}

/* y = a int V . grad x v dX if ``slopes``, else a int x V . grad v dX. */
static void advect(const Advection *w, double a, int slopes, const double *x, double *y)
{
    memset(y, 0, sizeof(double) * w->dofs);
    velocity_carry(w->cells, w->velocity, slopes, x, y);
    EACH(i, w->dofs)
        y[i] *= a;
}

/* Set the surface velocities of a state with its rate, limited to ``most``; advection is included if one exceeds ``least``. */
static void set_velocity(Advection *w, double most, double least, const double *z, const double *rate, const double *eta,
                         const double *still)
{
    const Tank *tank = w->tank;
    const long n = w->dofs, fields = w->fields;
    double *surface = w->room, *B = w->vertical;
    set_column(w->tank, eta, still);
    mass_solve(w->mass, rate, B);
    memset(surface, 0, sizeof(double) * fields * n);
    EACH(i, n) {
        double *at = surface + fields * i;
        at[0] = eta[i], at[1] = z[n + i], at[2] = B[i];
    }
    EACH(one, tank->walls_moving) {
        const Wall *wall = tank->walls[one];
        EACH(k, tank->carries) {
            const int i = tank->carried[k];
            const double f = wall->at_still_water + wall->slope * eta[i], far = wall->position[i], fast = wall->speed[i];
            double *at = surface + fields * i;
            at[3] += far * f, at[4] += fast * f, at[6] += far * wall->slope;
            at[5] += fast * (wall->mean * still[i] + 0.5 * (wall->at_still_water + f) * eta[i]);
        }
    }
    memset(B, 0, sizeof(double) * n);
    w->carried = velocity_move(w->cells, most, w->axis, surface, w->velocity, B) > least;
    mass_solve(w->mass, B, B);
    EACH(i, n)
        B[i] = B[i] > most ? most : B[i] < -most ? -most : B[i];
}

/* Apply the preconditioner to the residual [Q, psi] of a stage of weight a. */
static void precondition(const Advection *w, double a, const double *residual, double *found)
{
    const int carried = w->carried;
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
/* Columns of masses beside a leaning paddle, by the algorithm of ``ShapedColumns.solve``. Returns 0 without convergence. */
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

/* Set the column, the surface potential minus its mean, and the input of initial guesses. Returns 0 for an invalid column. */
static int begin(Tank *w, const double *q, const double *p, const double *still, double *level, double *square)
{
    const long n = w->dofs;
    double sum = 0.0, squares = 0.0;
    int positive = 1;
    mass_factor(w->mass);
#if LEANS
    if (!lean(w, q))
        return 0;
#else
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

/* Contribution of the walls to the derivative with respect to the potential. */
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

/* Solve for the potential of masses q and surface potential p, with ``recorded`` earlier solutions. ``found`` has, in sequence:
   dH/dp; the contribution of the wall to it; -M^-1 times the derivative of the energy with respect to the column, and this
   derivative; q and p; the elevation. ``numbers`` has the mean of p, phi A phi, and the square of the input of the initial
   guess. Returns the iterations, or -1 without a minimum or convergence: then Python must solve. */
static int find(Tank *w, const double *q, const double *p, const double *still, int recorded, double *found, double *numbers)
{
    const int most = w->guesses->most, known = recorded - 1 < most ? recorded - 1 : most, place = (recorded - 1) % most;
    const long n = w->dofs;
    double *by_column = found + 2 * n;
    int iterations = 0;
    if (!begin(w, q, p, still, numbers, numbers + 2))
        return -1;
    interlace(FIELDS, n, w->fields, w->rows);
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
        iterations += taken;
    } while (w->correction[1] > 1.0);
    history_record(w->guesses, known, place, w->inputs, NUMBERS, w->phi);
    double mean = 0.0;
    EACH(i, n)
        mean += w->image[i * NUMBERS + NUMBERS - 1] / n;
    EACH(i, n)
        found[i] = w->image[i * NUMBERS + NUMBERS - 1] - mean;
    EACH(k, w->carries)
        found[w->carried[k]] += w->wall[w->carried[k] * NUMBERS + NUMBERS - 1];
    memset(by_column, 0, sizeof(double) * n);
    layers_derivative(w->cells, w->layers, w->rows, w->phi, by_column);
#define BY_COLUMN(wall, k)                                         \
    wall##_by_column(w->walls[k], w->column, w->phi);              \
    EACH(i, w->carries)                                            \
        by_column[w->carried[i]] += w->walls[k]->by_column[w->carried[i]];
    EACH_WALL(BY_COLUMN)
    mass_solve(w->mass, by_column, by_column);
    EACH(i, n)
        found[n + i] = -by_column[i];
    numbers[1] = w->correction[0];
    memcpy(found + 3 * n, q, sizeof(double) * n);
    memcpy(found + 4 * n, p, sizeof(double) * n);
    memcpy(found + 5 * n, w->inputs, sizeof(double) * n);
    return iterations;
}

static int stored(const Mixing *m, int recorded) { return recorded < m->most ? recorded : m->most; }
static int slot(const Mixing *m, int recorded) { return recorded ? (recorded - 1) % m->most : m->most - 1; }

/* The initial value of the stage z = c + a f(z): the combination of points by their c, with uncertainty ``wrong``, plus the
   preconditioned residual. One of the points is z, at which f is given. */
static void predict(const Stage *s, const double *z, const double *f, const double *c, double a, int recorded, double wrong,
                    double *start)
{
    const Mixing *points = s->points;
    double *image = s->image;
    EACH(i, points->size)
        image[i] = z[i] - a * f[i];
    history_add(points, stored(points, recorded), slot(points, recorded), z, image);
    history_aim(points, stored(points, recorded), c);
    history_combine(points, stored(points, recorded), wrong * wrong, start, s->missed);
    precondition(s->advection, a, s->missed, image);
    EACH(i, points->size)
        start[i] += image[i];
}

/* Replace an iterate z = [q, p] of the stage by the next: Anderson mixing of the preconditioned residual with those of ``mixed``
   earlier iterates. Returns the iterations of ``find``. */
static int iterate(Stage *s, const double *c, double a, const double *still, int recorded, int mixed, double *z,
                   double *numbers)
{
    const Mixing *iterates = s->iterates;
    const long n = s->tank->dofs;
    double *found = s->found, *residual = s->residual, *image = s->image, length = 0.0;
    const int iterations = find(s->tank, z, z + n, still, recorded, found, numbers);
    if (iterations < 0)
        return iterations;
    EACH(i, 2 * n) {
        const double scaled = z[i] / iterates->scale[i];
        residual[i] = z[i] - c[i] - a * found[i], length += scaled * scaled;
    }
    s->length = sqrt(length);
    precondition(s->advection, a, residual, image);
    EACH(i, 2 * n)
        residual[i] = z[i] - image[i];
    history_add(iterates, stored(iterates, mixed), slot(iterates, mixed), residual, image);
    history_aim(iterates, stored(iterates, mixed), s->nothing);
    history_combine(iterates, stored(iterates, mixed), 0.0, z, s->missed);
    s->away = sqrt(iterates->products[stored(iterates, mixed)]);
    return iterations;
}

/* Solve the stage z = c + a f(z) by the algorithm of ``StageSolver``, from a point with its f, ``points`` earlier points and
   ``recorded`` interior solutions. The preconditioner is renewed after more than ``patience`` iterations. Returns 1; or 0 if
   not solved, with z as initial value for Python. */
static int solve_stage(Stage *s, const double *near, const double *f, const double *c, double a, const double *still,
                       int recorded, int patience, int points, double *z)
{
    const double wanted = s->tolerance * (s->size > 0.0 ? s->size : 0.0);
    double numbers[3], norm = NAN, target = NAN, contraction = s->contraction;
    predict(s, near, f, c, a, points, s->uncertainty * s->root * wanted, z);
    s->evaluations = s->iterations = s->worn = 0, s->measured = NAN;
    EACH(k, s->most) {
        if (s->worn)
            return 0;
        const int iterations = iterate(s, c, a, still, recorded + k, k, z, numbers);
        if (iterations < 0)
            return 0;
        const double before = norm;
        ++s->evaluations, s->iterations += iterations, s->worn = iterations > patience;
        norm = s->away / s->root, s->last_size = sqrt(numbers[2] / (2 * s->tank->dofs));
        if (k == 0) {
            const double least = s->round_off * fmax(s->length / s->root, s->floor);
            s->size = isnan(s->size) ? s->last_size : s->size;
            target = fmax(s->tolerance * s->size, least);
        } else
            contraction = before > 0.0 ? norm / before : 0.0;
        if (k == 1)
            s->measured = contraction;
        if (!isfinite(norm))
            return 0;
        if (norm <= target || s->safety * contraction * norm <= target) {
            history_add(s->points, stored(s->points, points + 1), slot(s->points, points + 1), z, c);
            return 1;
        }
    }
    return 0;
}

/* Set the columns at an elevation, solve for the potential as ``find`` does, and add to ``numbers`` the potential energy, the
   contribution of the walls to H, and their power. */
static int evaluate(Tank *w, const double *q, const double *p, const double *eta, const double *still, int recorded,
                    double *found, double *numbers)
{
    set_column(w, eta, still);
    const int iterations = find(w, q, p, still, recorded, found, numbers);
    if (iterations < 0)
        return iterations;
    double of_walls = 0.0, power = 0.0;
#define ADD_POWER(wall, k)                                                                                 \
    {                                                                                                      \
        const double *moves = w->walls[k]->moves;                                                          \
        double pushed[2];                                                                                  \
        wall##_power(w->walls[k], w->column, w->phi, found + 2 * w->dofs, pushed);                         \
        power += pushed[0] + moves[ACCELERATION] * pushed[1], of_walls += moves[SPEED] * pushed[1];        \
    }
    EACH_WALL(ADD_POWER)
    numbers[3] = potential_total(w->potential), numbers[4] = of_walls, numbers[5] = power;
    return iterations;
}
