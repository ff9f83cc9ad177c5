/* What start values are combined of, of wavetank/fe/recall.py; nearest.c stands before. */

#define FEW 64  /* rows at a time */

/* away = x - last, and its products with ``known`` differences, with itself, and those of x with itself. */
static void aim(long size, int known, const float *differences, const double *restrict last, const double *restrict x,
                double *restrict away, double *products)
{
    double square = 0.0, from_zero = 0.0;
    for (long i = 0; i < size; ++i) {
        away[i] = x[i] - last[i];
        square += away[i] * away[i];
        from_zero += x[i] * x[i];
    }
    for (int k = 0; k < known; ++k) {
        const float *restrict one = differences + k * size;
        double sum = 0.0;
        for (long i = 0; i < size; ++i)
            sum += one[i] * away[i];
        products[k] = sum;
    }
    products[known] = square, products[known + 1] = from_zero;
}

/* y = answer + the weights' sum of differences, both [degree of freedom][number], y with rows of ``stride``. */
static void combine(long rows, int numbers, int stride, int known, const double *weights, const double *restrict answer,
                    const float *restrict differences, double *restrict y)
{
    const long size = rows * numbers;
    for (long begin = 0; begin < rows; begin += FEW) {
        const long few = begin + FEW < rows ? FEW : rows - begin, first = begin * numbers, count = few * numbers;
        float sums[count];
        for (long i = 0; i < count; ++i)
            sums[i] = 0.0f;
        for (int k = 0; k < known; ++k) {
            const float weight = weights[k], *one = differences + k * size + first;
            for (long i = 0; i < count; ++i)
                sums[i] += weight * one[i];
        }
        for (long i = 0; i < few; ++i)
            for (int j = 0; j < numbers; ++j)
                y[(begin + i) * stride + j] = answer[first + i * numbers + j] + sums[i * numbers + j];
    }
}

/* y, of rows of ``stride``, becomes the answer; the way to it is the difference. */
static void replace(long rows, int numbers, int stride, const double *restrict y, double *restrict answer,
                    float *restrict difference)
{
    for (long i = 0; i < rows; ++i)
        for (int j = 0; j < numbers; ++j) {
            difference[i * numbers + j] = y[i * stride + j] - answer[i * numbers + j];
            answer[i * numbers + j] = y[i * stride + j];
        }
}
