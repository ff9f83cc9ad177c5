/* Numbers as text, with as few digits as reading them back exactly needs; for wavetank/records/csv_lines.py.

By R. Giulietti's Schubfach (2020): c 2^q is 4 c 2^q / 10^k quarters of the last of 16 or 17 digits. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#define DIGITS 17

/* 10^k / 2^(e - 127) from k = LEAST on, rounded up, e the power of two below 10^k: upper and lower half. */
static const uint64_t powers[][2] = {POWERS};

/* power * c / 2^128, its last bit set if that is not whole. */
static uint64_t scaled(const uint64_t *power, uint64_t c)
{
    const unsigned __int128 low = (unsigned __int128)power[1] * c, all = (unsigned __int128)power[0] * c + (low >> 64);
    return (uint64_t)(all >> 64) | ((uint64_t)all > 1);
}

/* The digits nearest to a number > 0 among the fewest that are read as it, and the power of ten of the last. */
static uint64_t shortest(double value, int *exponent)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof(bits));
    const uint64_t fraction = bits & ((1ull << 52) - 1), normal = bits >> 52, c = normal ? fraction | 1ull << 52 : fraction;
    const int q = (normal ? (int)normal : 1) - 1075, odd = c & 1, near = !fraction && normal > 1; /* the number below is */
    const int k = (q * 1262611 - (near ? 524031 : 0)) >> 22, h = q + (-k * 1741647 >> 19) + 1;
    const uint64_t *power = powers[-k - LEAST], at = scaled(power, 4 * c << h), s = at / 4, tens = s / 10;
    const uint64_t least = scaled(power, (4 * c - 2 + near) << h) + odd, most = scaled(power, (4 * c + 2) << h) - odd;
    int down = least <= 40 * tens, up = 40 * tens + 40 <= most;
    *exponent = k + 1;
    if (s >= 10 && down != up)
        return tens + up;
    down = least <= 4 * s, up = 4 * s + 4 <= most;
    *exponent = k;
    return s + (down != up ? up : at > 4 * s + 2 || (at == 4 * s + 2 && (s & 1)));
}

static char *number(char *to, double value)
{
    if (isnan(value))
        return to;
    if (signbit(value))
        *to++ = '-';
    if (isinf(value))
        return strcpy(to, "inf") + 3;
    char all[3 * DIGITS], *digit = all;
    int exponent = 0, count = DIGITS;
    const uint64_t digits = value != 0.0 ? shortest(fabs(value), &exponent) : 0;
    uint32_t upper = digits / 1000000000, lower = digits % 1000000000;
    memset(all, '0', sizeof(all));
    for (int i = 7; i >= 0; --i, lower /= 10, upper /= 10)
        all[9 + i] += lower % 10, all[i] += upper % 10;
    all[8] += lower;
    while (count > 1 && *digit == '0')
        ++digit, --count;
    const int point = count + exponent, shown = point > -5 && point < DIGITS ? point : 1; /* digits before the point */
    while (count > 1 && digit[count - 1] == '0')
        --count;
    if (shown > 0) {
        memcpy(to, digit, DIGITS);
        memcpy(to + shown + 1, digit + shown, DIGITS);
        to[shown] = '.';
        to += count > shown ? count + 1 : shown + 2;
    } else {
        memcpy(to, "0.0000", 6);
        memcpy(to + 2 - shown, digit, DIGITS);
        to += 2 - shown + count;
    }
    return shown == point ? to : to + sprintf(to, "e%d", point - 1);
}

/* Lines of numbers with commas between, nothing at nan; returns their length. */
long lines(long rows, long columns, const double *values, double *text)
{
    char *to = (char *)text;
    for (long row = 0; row < rows; ++row)
        for (long column = 0; column < columns; ++column) {
            to = number(to, *values++);
            *to++ = column + 1 < columns ? ',' : '\n';
        }
    return to - (char *)text;
}
