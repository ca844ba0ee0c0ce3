/* Greatest error, in units in the last place, of several builds of one sincos over many angles.

   Compile with REAL, DIGITS (53 or 24) and VARIANTS, a list of X(name): each name is a function
   void name(size_t count, const REAL *x, REAL *s, REAL *c), count a multiple of 16. Reference: glibc's
   long double (x87, 64 digits, full argument reduction), for float its double. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#if DIGITS == 53
#define EXACT_SIN(angle) sinl((long double)(angle))
#define EXACT_COS(angle) cosl((long double)(angle))
#else
#define EXACT_SIN(angle) sin((double)(angle))
#define EXACT_COS(angle) cos((double)(angle))
#endif

enum { BLOCK = 16384 };

typedef void sincos_block(size_t count, const REAL *x, REAL *s, REAL *c);

#define X(name) sincos_block name;
VARIANTS
#undef X

static const struct { const char *name; sincos_block *run; } variants[] = {
#define X(name) {#name, name},
    VARIANTS
#undef X
};
enum { COUNT = sizeof variants / sizeof variants[0] };

static uint64_t state = 0x9e3779b97f4a7c15u;

/* Uniform in [0, 1): xorshift64*. */
static double uniform(void)
{
    state ^= state >> 12;
    state ^= state << 25;
    state ^= state >> 27;
    return (double)((state * 0x2545f4914f6cdd1du) >> 11) * 0x1p-53;
}

static double both_signs(double magnitude)
{
    return uniform() < 0.5 ? -magnitude : magnitude;
}

static REAL neighbour(long double value, int steps)
{
    REAL x = (REAL)value;
    for (int i = 0; i < abs(steps); ++i)
        x = (REAL)(DIGITS == 53 ? nextafter((double)x, steps < 0 ? -1e9 : 1e9)
                                : nextafterf((float)x, steps < 0 ? -1e9f : 1e9f));
    return x;
}

/* 1 / (unit in the last place) of a number this large. */
static long double places_per_unit(long double exact)
{
    const int lowest = DIGITS == 53 ? -1074 : -149;
    int exponent;
    frexpl(exact, &exponent);
    return ldexpl(1.0L, -(exact == 0 || exponent - DIGITS < lowest ? lowest : exponent - DIGITS));
}

static double ulps(REAL got, long double exact, long double scale)
{
    const double error = (double)(fabsl((long double)got - exact) * scale);
    return error == error ? error : INFINITY;
}

static REAL x[BLOCK], s[BLOCK], c[BLOCK];
static long double exact_s[BLOCK], exact_c[BLOCK], scale_s[BLOCK], scale_c[BLOCK];
static double worst_s[COUNT], worst_c[COUNT], worst_at[COUNT];
static long angles;

static void compare_block(void)
{
    for (int i = 0; i < BLOCK; ++i) {
        exact_s[i] = EXACT_SIN(x[i]);
        exact_c[i] = EXACT_COS(x[i]);
        scale_s[i] = places_per_unit(exact_s[i]);
        scale_c[i] = places_per_unit(exact_c[i]);
    }
    for (int v = 0; v < (int)COUNT; ++v) {
        variants[v].run(BLOCK, x, s, c);
        for (int i = 0; i < BLOCK; ++i) {
            const double of_s = ulps(s[i], exact_s[i], scale_s[i]), of_c = ulps(c[i], exact_c[i], scale_c[i]);
            if (of_s > worst_s[v] || of_c > worst_c[v])
                worst_at[v] = (double)x[i];
            worst_s[v] = of_s > worst_s[v] ? of_s : worst_s[v];
            worst_c[v] = of_c > worst_c[v] ? of_c : worst_c[v];
        }
    }
    angles += BLOCK;
}

/* One line per build: range, build, angles, greatest error of sine and cosine, an angle with such an error. */
static void report(const char *range)
{
    for (int v = 0; v < (int)COUNT; ++v) {
        printf("%s %s %ld %.4f %.4f %a\n", range, variants[v].name, angles, worst_s[v], worst_c[v], worst_at[v]);
        worst_s[v] = worst_c[v] = worst_at[v] = 0;
    }
    angles = 0;
}

static void uniform_range(const char *name, double limit, long blocks)
{
    for (long b = 0; b < blocks; ++b) {
        for (int i = 0; i < BLOCK; ++i)
            x[i] = (REAL)both_signs(uniform() * limit);
        compare_block();
    }
    report(name);
}

static void logarithmic_range(const char *name, double least, double limit, long blocks)
{
    for (long b = 0; b < blocks; ++b) {
        for (int i = 0; i < BLOCK; ++i)
            x[i] = (REAL)both_signs(0.999999 * exp(log(least) + uniform() * (log(limit) - log(least))));
        compare_block();
    }
    report(name);
}

/* The nearest number to every multiple of pi/4 within the limit, and `around` on both sides: with the multiples of
   pi/2, where reduction cancels most, these are all hard cases there are. */
static void near_multiples(const char *name, double limit, int around)
{
    const long double quarter_pi = 0.785398163397448309615660845819875721L;
    int filled = 0;
    for (long k = 0; k * quarter_pi < limit; ++k)
        for (int steps = -around; steps <= around; ++steps) {
            const REAL angle = neighbour(k * quarter_pi, steps);
            if (angle > (REAL)limit)
                continue;
            x[filled++] = (k + steps) % 2 ? -angle : angle;
            if (filled == BLOCK) {
                compare_block();
                filled = 0;
            }
        }
    for (; filled < BLOCK; ++filled)
        x[filled] = 0;
    compare_block();
    report(name);
}

#if DIGITS == 24
/* Every float from `least` to the limit: the others have k = 0 and no reduction, the negative ones the same digits. */
static void every_float(const char *name, float least, float limit)
{
    float angle = least;
    while (angle < limit) {
        for (int i = 0; i < BLOCK; ++i) {
            x[i] = angle;
            angle = angle < limit ? nextafterf(angle, INFINITY) : limit;
        }
        compare_block();
    }
    report(name);
}
#endif

/* accuracy LIMIT BLOCKS: BLOCKS blocks of angles per uniform range; accuracy LIMIT every: all floats. */
int main(int count, char **words)
{
    const double limit = count > 1 ? atof(words[1]) : 0;
    const long blocks = count > 2 ? atol(words[2]) : 0;
#if DIGITS == 24
    if (limit > 0 && count > 2 && words[2][0] == 'e') {
        every_float("every_float", 0x1p-3f, (float)limit);
        return 0;
    }
#endif
    if (limit <= 0 || blocks <= 0)
        return 2;
    uniform_range("uniform_pi", 3.2, blocks);
    uniform_range("uniform_1e3", 1e3, blocks);
    uniform_range("uniform_limit", limit, blocks);
    logarithmic_range("logarithmic", DIGITS == 53 ? 1e-320 : 1e-42, limit, blocks / 2 + 1);
    logarithmic_range("logarithmic_1e-6", 1e-6, limit, blocks / 2 + 1);
    near_multiples("near_multiples", limit, 4);
    return 0;
}
