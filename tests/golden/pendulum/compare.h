/* What the functions gave against what they should give. */
#include <math.h>
#include <stdio.h>

#define FLOOR 1e-3 /* a joint that does less than this share of the largest is measured by that */

static int checks = 0, failures = 0;

/* Largest error of `count` rows, relative to each output row's (joint's) largest value; infinite where a value is no
   number or the row behind the last was written. */
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
        worst = relative <= worst ? worst : isnan(relative) ? HUGE_VAL : relative;
    }
    for (size_t k = count * size; k < (count + 1) * size; k++) {
        worst = found[k] < UNTOUCHED || found[k] > UNTOUCHED ? HUGE_VAL : worst;
    }
    return worst;
}

static void report(const char *function, const char *layout, double worst, int status, double tolerance)
{
    const int good = worst <= tolerance && !status;
    printf("%s, %s: error %.1e, tolerance %.0e%s: %s\n", function, layout, worst, tolerance,
           status ? ", a state was called singular" : "", good ? "ok" : "FAILED");
    checks++;
    failures += !good;
}
