/* Steep crests of a surface along its tank, of wavetank/tank/crests.py. */
#include <math.h>

static int highest(const double *height, int one, int other)
{
    return height[one] > height[other] ? one : other;
}

/* The trough beside a peak: behind it the surface rises again by a ripple, or is higher than the peak. Heights that differ
   by ``same`` are one, of a place where cells meet. */
static int trough(int n, const double *height, int peak, int step, double ripple, double same)
{
    int lowest = peak;
    for (int i = peak + step; i >= 0 && i < n && height[i] <= height[peak] + same; i += step) {
        if (height[i] > height[lowest] + ripple && height[lowest] < height[peak] - ripple)
            break;
        lowest = height[i] < height[lowest] ? i : lowest;
    }
    return lowest;
}

typedef struct {
    int at;             /* place before it */
    const double *x;
    int places;
} Between;

/* Move on to a place, not before the last one. */
static void go_to(Between *b, double x)
{
    while (b->at + 2 < b->places && b->x[b->at + 1] <= x)
        ++b->at;
}

/* What is linear between places, there; beyond the ends what it is at these. */
static double linear(const Between *b, const double *values, double x)
{
    const double start = b->x[b->at], end = b->x[b->at + 1];
    const double part = x <= start ? 0.0 : x >= end ? 1.0 : (x - start) / (end - start);
    return (1.0 - part) * values[b->at] + part * values[b->at + 1];
}

static double steepest(const double *slope, int first, int last)
{
    double most = 0.0;
    for (int i = first; i <= last; ++i)
        most = fabs(slope[i]) > most ? fabs(slope[i]) : most;
    return most;
}

/* The current from trough to trough: of what lies within the velocities of both and the mean, the nearest to rest. */
static double current(const Surface *s, int left, int right)
{
    double sum = 0.0;
    for (int i = left; i < right; ++i)
        sum += (s->x[i + 1] - s->x[i]) * (s->velocity[i] + s->velocity[i + 1]) / 2.0;
    const double bounds[3] = {s->velocity[left], s->velocity[right], sum / (s->x[right] - s->x[left])};
    double low = bounds[0], high = bounds[0];
    for (int k = 1; k < 3; ++k) {
        low = bounds[k] < low ? bounds[k] : low;
        high = bounds[k] > high ? bounds[k] : high;
    }
    const double none = low > 0.0 ? low : 0.0;
    return none < high ? none : high;
}

/* At a point of the later surface, midway between the times of both: rate and slope of the elevation, and the water's
   horizontal velocity by the kinematic condition. */
typedef struct {
    double rate, slope, water;
} Motion;

static Motion motion(const Surface *before, const Surface *s, double time, Between *then, int i)
{
    const double x = s->x[i];
    go_to(then, x);
    const double rate = (s->height[i] - linear(then, before->height, x)) / time;
    const double slope = 0.5 * (s->slope[i] + linear(then, before->slope, x));
    const double velocity = 0.5 * (s->velocity[i] + linear(then, before->velocity, x));
    return (Motion){rate, slope, (velocity - rate * slope) / (1.0 + slope * slope)};
}

/* A crest, of its upper half from ``first`` to ``last``. */
static Crest crest(const Surface *before, const Surface *s, double time, int left, int peak, int right, int first, int last)
{
    Crest c = {s->x[peak], s->height[peak] - s->height[highest(s->height, left, right)]};
    Between then = {0, before->x, before->places}, again = then;
    Motion one, last_one = {0.0, 0.0, 0.0};
    double rates = 0.0, moved = 0.0, squares = 0.0, most = 0.0, least = 0.0, outrun = 0.0;
    for (int i = first; i <= last; ++i, last_one = one) {
        const double half = i > first ? 0.5 * (s->x[i] - s->x[i - 1]) : 0.0;
        one = motion(before, s, time, &then, i);
        rates += half * (one.rate * one.rate + last_one.rate * last_one.rate);
        moved += half * (one.rate * one.slope + last_one.rate * last_one.slope);
        squares += half * (one.slope * one.slope + last_one.slope * last_one.slope);
        most = i == first || one.water > most ? one.water : most;
        least = i == first || one.water < least ? one.water : least;
    }
    c.current = current(s, left, right), c.speed = -moved / squares;
    const int ahead = c.speed > c.current;
    for (int i = first, faster = 0, last_faster = 0; i <= last; ++i, last_faster = faster) {
        const double half = i > first ? 0.5 * (s->x[i] - s->x[i - 1]) : 0.0;
        one = motion(before, s, time, &again, i);
        faster = ahead ? one.water > c.speed : one.water < c.speed;
        outrun += half * (faster + last_faster);
    }
    c.velocity = ahead ? most : least;
    c.front = ahead ? steepest(s->slope, peak, right) : steepest(s->slope, left, peak);
    c.coherence = rates > 0.0 ? moved * moved / (rates * squares) : 0.0;
    c.outrun = outrun / (s->x[last] - s->x[first]);
    return c;
}

/* The crest at a peak, if it stands out by a ripple; returns how many there are then. */
static int at_peak(const Surface *before, const Surface *s, const Asked *asked, double ripple, int peak, int count, Crest *found)
{
    const double same = asked->same * ripple;
    const int left = trough(s->places, s->height, peak, -1, ripple, same);
    const int right = trough(s->places, s->height, peak, 1, ripple, same);
    const double foot = s->height[highest(s->height, left, right)], half = 0.5 * (s->height[peak] + foot);
    int first = peak, last = peak;
    if (s->height[peak] - foot < ripple)
        return count;
    while (first > left && s->height[first] > half)
        --first;
    while (last < right && s->height[last] > half)
        ++last;
    if (s->x[last] - s->x[first] <= asked->cell || steepest(s->slope, left, right) <= asked->front)
        return count;
    found[count] = crest(before, s, asked->time, left, peak, right, first, last);
    return count + (found[count].front > asked->front);
}

int steep_crests(const Surface *before, const Surface *s, const Asked *asked, double *rows)
{
    Crest *found = (Crest *)rows;
    int count = 0, last = 0, one = -1;  /* places of heights that differ: the last, and that before it */
    double high = s->height[0], low = high;
    for (int i = 1; i < s->places; ++i) {
        high = s->height[i] > high ? s->height[i] : high;
        low = s->height[i] < low ? s->height[i] : low;
    }
    const double ripple = asked->least * (high - low), same = asked->same * ripple;
    for (int i = 1; i < s->places; ++i) {
        if (fabs(s->height[i] - s->height[i - 1]) <= same)  /* where cells meet */
            continue;
        if (one >= 0 && s->height[last] > s->height[one] && s->height[last] > s->height[i])
            count = at_peak(before, s, asked, ripple, last, count, found);
        one = last, last = i;
    }
    return count;
}
