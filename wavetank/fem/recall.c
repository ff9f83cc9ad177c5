/* What start values are combined of, of wavetank/fem/recall.py; nearest.c stands before. */

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

/* y, of rows of ``stride``, becomes the combination of answers, [degree of freedom][number], that its input is nearest to;
   0 where zero is nearer than anything remembered. */
static int start(long rows, int numbers, int stride, int known, int most, const double *gram, const double *products,
                 double shortest, const double *restrict answer, const float *restrict steps, double *restrict y)
{
    const long size = rows * numbers;
    double weights[most > 0 ? most : 1], left = products[known];
    nearest(known, most, gram, products, shortest, weights);
    for (int k = 0; k < known; ++k)
        left -= weights[k] * products[k];
    if (left > products[known + 1])
        return 0;
    for (long begin = 0; begin < rows; begin += FEW) {
        const long few = begin + FEW < rows ? FEW : rows - begin, first = begin * numbers, count = few * numbers;
        float sums[count > 0 ? count : 1];
        for (long i = 0; i < count; ++i)
            sums[i] = 0.0f;
        for (int k = 0; k < known; ++k) {
            const float weight = weights[k], *one = steps + k * size + first;
            for (long i = 0; i < count; ++i)
                sums[i] += weight * one[i];
        }
        for (long i = 0; i < few; ++i)
            for (int j = 0; j < numbers; ++j)
                y[(begin + i) * stride + j] = answer[first + i * numbers + j] + sums[i * numbers + j];
    }
    return 1;
}

/* x, which lies ``away`` from the last input, becomes that; y, of rows of ``stride``, the answer; the ways to both are the
   differences at one of ``most`` places, the products of the former those with ``known`` others and itself. */
static void keep(long size, long rows, int numbers, int stride, int known, int place, int most, const double *restrict x,
                 const double *restrict y, const double *restrict away, const double *products, double *restrict last,
                 double *restrict answer, float *ways, float *steps, double *gram)
{
    float *restrict way = ways + place * size, *restrict step = steps + place * rows * numbers;
    for (int k = 0; k < known; ++k)
        gram[place * most + k] = gram[k * most + place] = products[k];
    gram[place * most + place] = products[known];
    for (long i = 0; i < size; ++i)
        last[i] = x[i], way[i] = away[i];
    for (long i = 0; i < rows; ++i)
        for (int j = 0; j < numbers; ++j) {
            step[i * numbers + j] = y[i * stride + j] - answer[i * numbers + j];
            answer[i * numbers + j] = y[i * stride + j];
        }
}
