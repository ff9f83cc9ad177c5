/* Least squares over earlier points, of wavetank/fem/initial_guess.py and anderson mixing. */
#define ROWS_AT_A_TIME 64
#define NUMBERS_AT_A_TIME 512

/* Least-squares weights of vectors for a target, from their Gram matrix, with rows of ``stride``, and their products with the
   target. Pivoted Cholesky factorisation; vectors whose remaining square is below ``shortest`` times the largest are omitted. */
static void nearest(int count, int stride, const double *gram, const double *along, double shortest, double *weights)
{
    if (count < 1)
        return;
    double L[count][count], left[count], longest = 0.0;
    int order[count], taken = 0;
    for (int i = 0; i < count; ++i) {
        left[i] = gram[i * stride + i], longest = left[i] > longest ? left[i] : longest;
        order[i] = i, weights[i] = 0.0;
    }
    for (; taken < count; ++taken) {
        int most = taken;
        for (int i = taken; i < count; ++i)
            most = left[order[i]] > left[order[most]] ? i : most;
        const int next = order[most];
        if (!(left[next] > shortest * longest))
            break;
        order[most] = order[taken], order[taken] = next;
        L[next][taken] = sqrt(left[next]);
        weights[next] = along[next];
        for (int k = 0; k < taken; ++k)
            weights[next] -= L[next][k] * weights[order[k]];
        weights[next] /= L[next][taken];
        for (int i = taken + 1; i < count; ++i) {
            const int other = order[i];
            double sum = gram[other * stride + next];
            for (int k = 0; k < taken; ++k)
                sum -= L[other][k] * L[next][k];
            L[other][taken] = sum / L[next][taken];
            left[other] -= L[other][taken] * L[other][taken];
        }
    }
    for (int i = taken - 1; i >= 0; --i) {
        const int last = order[i];
        for (int k = i + 1; k < taken; ++k)
            weights[last] -= L[order[k]][i] * weights[order[k]];
        weights[last] /= L[last][i];
    }
}

/* Initial guesses by projection: the change from the last input to x, its products with ``known`` differences and with
   itself, and the square of x. */
SHARED void project(const Guesses *g, int known, const double *restrict x)
{
    const double *restrict last = g->input;
    double *restrict change = g->change, square = 0.0, from_zero = 0.0;
    EACH(i, g->inputs) {
        change[i] = x[i] - last[i];
        square += change[i] * change[i];
        from_zero += x[i] * x[i];
    }
    EACH(k, known) {
        const float *restrict one = g->input_steps + (long)k * g->inputs;
        double sum = 0.0;
        EACH(i, g->inputs)
            sum += one[i] * change[i];
        g->products[k] = sum;
    }
    g->products[known] = square, g->products[known + 1] = from_zero;
}

/* y, with rows of ``stride``, <- the combination of solutions whose input is closest to the projected one. Returns 0 if zero
   is closer than all of them. */
SHARED int guess(const Guesses *g, int known, int stride, double *restrict y)
{
    const long size = (long)g->rows * g->numbers;
    const double *restrict solution = g->solution;
    double weights[g->most > 0 ? g->most : 1], left = g->products[known];
    nearest(known, g->most, g->gram, g->products, g->shortest, weights);
    EACH(k, known)
        left -= weights[k] * g->products[k];
    if (left > g->products[known + 1])
        return 0;
    for (long begin = 0; begin < g->rows; begin += ROWS_AT_A_TIME) {
        const long few = begin + ROWS_AT_A_TIME < g->rows ? ROWS_AT_A_TIME : g->rows - begin;
        const long first = begin * g->numbers, count = few * g->numbers;
        float sums[count > 0 ? count : 1];
        EACH(i, count)
            sums[i] = 0.0f;
        EACH(k, known) {
            const float weight = weights[k], *restrict one = g->solution_steps + k * size + first;
            EACH(i, count)
                sums[i] += weight * one[i];
        }
        EACH(i, few)
            EACH(j, g->numbers)
                y[(begin + i) * stride + j] = solution[first + i * g->numbers + j] + sums[i * g->numbers + j];
    }
    return 1;
}

/* Store the projected input x and its solution y, with rows of ``stride``, as the last pair, and the differences to them at an
   index. */
SHARED void record(const Guesses *g, int known, int place, const double *restrict x, int stride, const double *restrict y)
{
    const int n = g->numbers;
    float *restrict way = g->input_steps + (long)place * g->inputs;
    float *restrict step = g->solution_steps + (long)place * g->rows * n;
    double *restrict last = g->input, *restrict solution = g->solution;
    EACH(k, known)
        g->gram[place * g->most + k] = g->gram[k * g->most + place] = g->products[k];
    g->gram[place * g->most + place] = g->products[known];
    EACH(i, g->inputs)
        last[i] = x[i], way[i] = g->change[i];
    EACH(i, g->rows)
        EACH(j, n) {
            step[i * n + j] = y[i * stride + j] - solution[i * n + j];
            solution[i * n + j] = y[i * stride + j];
        }
}

/* Anderson mixing. */
/* Products of a vector with the stored differences of images. */
static void multiply(const Mixing *p, int known, const double *restrict x)
{
    EACH(k, known) {
        const double *restrict one = p->image_steps + (long)k * p->size;
        double sum = 0.0;
        EACH(i, p->size)
            sum += one[i] * x[i];
        p->products[k] = sum;
    }
}

/* Store a point as the newest, and the difference to it at an index; return the products of that of its image on this rank. */
SHARED void add(const Mixing *p, int known, int place, const double *restrict z, const double *restrict image)
{
    double *restrict way = p->point_steps + (long)place * p->size, *restrict difference = p->image_steps + (long)place * p->size;
    double *restrict newest = p->point, *restrict its_image = p->image;
    const double *restrict scale = p->scale;
    EACH(i, p->size) {
        way[i] = z[i] - newest[i], difference[i] = (image[i] - its_image[i]) / scale[i];
        newest[i] = z[i], its_image[i] = image[i];
    }
    multiply(p, known, difference);
    EACH(k, known)
        p->gram[place * p->most + k] = p->gram[k * p->most + place] = p->products[k];
}

/* The residual of the newest image, its products with the stored differences, and its square. */
SHARED void aim(const Mixing *p, int known, const double *restrict c)
{
    const double *restrict its_image = p->image, *restrict scale = p->scale;
    double *restrict away = p->distance, square = 0.0;
    EACH(i, p->size) {
        away[i] = (c[i] - its_image[i]) / scale[i];
        square += away[i] * away[i];
    }
    multiply(p, known, away);
    p->products[known] = square;
}

/* z <- the combination of points whose image is closest to the target, for a squared uncertainty ``wrong``; the residual. */
SHARED void combine(const Mixing *p, int known, double wrong, double *restrict z, double *restrict missed)
{
    const long size = p->size;
    const int most = p->most, length = most > 0 ? most : 1;
    const double *restrict newest = p->point, *restrict away = p->distance, *restrict scale = p->scale;
    double A[length * length], weights[length];
    for (int i = 0; i < known; ++i)
        for (int j = 0; j < known; ++j)
            A[i * most + j] = p->gram[i * most + j] + (i == j ? wrong : 0.0);
    nearest(known, most, A, p->products, p->shortest, weights);
    for (long begin = 0; begin < size; begin += NUMBERS_AT_A_TIME) {
        const long end = begin + NUMBERS_AT_A_TIME < size ? begin + NUMBERS_AT_A_TIME : size;
        for (long i = begin; i < end; ++i)
            z[i] = newest[i], missed[i] = away[i];
        EACH(k, known) {
            const double *restrict way = p->point_steps + k * size, *restrict difference = p->image_steps + k * size;
            for (long i = begin; i < end; ++i)
                z[i] += weights[k] * way[i], missed[i] -= weights[k] * difference[i];
        }
        for (long i = begin; i < end; ++i)
            missed[i] *= scale[i];
    }
}
