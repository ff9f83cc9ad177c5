/* A potential along a slice or ring, found as a whole, of wavetank/fe/whole.py: functions of other kernels one after the
other, which are known by where they are.

NUMBERS, FIELDS of a degree of freedom: of the potential, of what the layer's energy depends on */
#include <math.h>
#include <string.h>

typedef void Solve(const void *chain, const double *b, double *x, double *work);
typedef double Take(const void *cells, const void *layers, const double *fields, double *state);
typedef float TakeSingle(const void *cells, const void *layers, const float *fields, float *state);
typedef void Product(const void *cells, const void *layers, const double *state, const double *x, double *y);
typedef void Times(const void *entries, double factor, const double *x, double *y);
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

#define EACH(i, most) for (long i = 0; i < (most); ++i)
#define CALL(Kind, which) ((Kind *)w->which)

/* The column, the surface potential less its mean, and what start values are found by; 0 of what is no surface of water. */
static int begin(Whole *w, const double *q, const double *p, const double *still, double speed, double *level)
{
    const long n = w->dofs;
    double sum = 0.0;
    int positive = 1;
    CALL(Solve, solve_mass)(w->mass, q, w->column, w->mass_work);
    EACH(i, n)
        sum += p[i], positive &= w->column[i] > 0.0;
    *level = sum / n;
    EACH(i, n) {
        const double psi = p[i] - *level;
        w->phi[i * NUMBERS + NUMBERS - 1] = psi;
        w->inputs[i] = w->column[i] - still[i], w->inputs[n + i] = psi / w->celerity;
        if (w->entries)
            w->inputs[2 * n + i] = w->by_speed * speed;
    }
    return positive && isfinite(sum);
}

/* Set the potential of masses q and surface potential p, at a paddle's speed; its flow less its mean, and the wall's, and
   behind that M^-1 of its energy's derivative by the column. Returns the iterations, or -1 of what is not as usual. */
static int find(Whole *w, const double *q, const double *p, const double *still, double speed, int known, int place,
                double *flow, double *level)
{
    const long n = w->dofs, inputs = (w->entries ? 3 : 2) * n;
    double *by_column = flow + n;
    int iterations = 0;
    if (!begin(w, q, p, still, speed, level))
        return -1;
    EACH(f, FIELDS)
        EACH(i, n)
            w->rows[i * FIELDS + f] = w->fields[f][i];
    EACH(i, n)
        EACH(f, FIELDS)
            w->single_rows[i * FIELDS + f] = w->rows[w->order[i] * FIELDS + f];
    const double least = CALL(Take, take)(w->cells, w->layers, w->rows, w->rows);
    CALL(TakeSingle, take_single)(w->single_cells, w->single_layers, w->single_rows, w->single_state);
    if (w->entries)
        CALL(Times, times)(w->entries, speed, w->column, w->wall);
    CALL(Aim, aim)(inputs, known, w->ways, w->last, w->inputs, w->away, w->products);
    if (!CALL(Start, start)(n, NUMBERS - 1, NUMBERS, known, w->most, w->gram, w->products, w->shortest, w->answer, w->steps,
                            w->phi))
        EACH(i, n)
            memset(w->phi + i * NUMBERS, 0, sizeof(double) * (NUMBERS - 1));
    do {
        memset(w->image, 0, sizeof(double) * n * NUMBERS);
        CALL(Product, product)(w->cells, w->layers, w->rows, w->phi, w->image);
        const int taken = CALL(Correct, correct)(w->single_cells, w->single_layers, w->single_state, w->modes, w->wall,
                                                 w->entries ? NUMBERS : 0, w->phi, w->image, w->tolerance,
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
        flow[i] = w->image[i * NUMBERS + NUMBERS - 1] - mean + (w->entries ? w->wall[i * NUMBERS + NUMBERS - 1] : 0.0);
    memset(by_column, 0, sizeof(double) * n);
    CALL(Product, derivative)(w->cells, w->layers, w->rows, w->phi, by_column);
    if (w->entries) {
        CALL(Times, times)(w->transposed, speed, w->phi, w->by_wall);
        EACH(i, n)
            by_column[i] += w->by_wall[i];
    }
    CALL(Solve, solve_mass)(w->mass, by_column, by_column, w->mass_work);
    return iterations;
}
