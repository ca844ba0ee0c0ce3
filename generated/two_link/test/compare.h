/* SPDX-License-Identifier: 0BSD */
/* What the functions gave against what they should give. */
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#define FLOOR 1e-3 /* a joint that does less than this share of the largest is measured by that */
#define NO_NUMBER DBL_MAX /* an error that has no size */

static int checks = 0, failures = 0;

/* Whether a value is finite, by its bits: compilers that may assume so (-ffast-math) drop isnan and isfinite. */
static int is_finite(real value)
{
    const double wide = (double)value;
    uint64_t bits;
    memcpy(&bits, &wide, sizeof bits);
    return (bits >> 52 & 0x7ff) != 0x7ff;
}

/* Largest error of `count` rows, relative to each output row's (joint's) largest value; NO_NUMBER where a value is none
   or the row behind the last was written. */
static double error(size_t count, size_t rows, size_t columns, const real *expected)
{
    const size_t size = rows * columns;
    double largest[N > 6 ? N : 6] = {0}, overall = 0.0, worst = 0.0;
    for (size_t k = 0; k < REFERENCE_COUNT * size; k++) {
        const size_t row = k % size / columns;
        largest[row] = fmax(largest[row], fabs((double)expected[k]));
        overall = fmax(overall, largest[row]);
    }
    for (size_t k = 0; k < count * size; k++) {
        const double scale = fmax(largest[k % size / columns], FLOOR * overall);
        const double difference = fabs((double)found[k] - (double)expected[k % (REFERENCE_COUNT * size)]);
        const double relative = scale > 0.0 ? difference / scale : difference;
        if (!is_finite(found[k]) || !is_finite(expected[k % (REFERENCE_COUNT * size)])) {
            return NO_NUMBER;
        }
        worst = relative <= worst ? worst : relative;
    }
    for (size_t k = count * size; k < (count + 1) * size; k++) {
        if (!is_finite(found[k]) || found[k] < UNTOUCHED || found[k] > UNTOUCHED) {
            return NO_NUMBER;
        }
    }
    return worst;
}

static void report(const char *function, const char *layout, double worst, int status, double tolerance)
{
    const int good = worst <= tolerance && !status;
    char figure[32] = "nan";
    if (worst < NO_NUMBER) {
        snprintf(figure, sizeof figure, "%.1e", worst);
    }
    printf("%s, %s: error %s, tolerance %.0e%s: %s\n", function, layout, figure, tolerance,
           status ? ", a state was called singular" : "", good ? "ok" : "FAILED");
    checks++;
    failures += !good;
}
