/* Clock, random numbers and the median pass, for the loops by hand. Define STATES, PASSES, RING and LARGEST, and the
 * outputs' array `out`, before TIME is used. */
#ifndef BY_HAND_TIMING_H
#define BY_HAND_TIMING_H

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static double random_in(double limit)
{
    return limit * (2.0 * rand() / RAND_MAX - 1.0);
}

static int ascending(const void *a, const void *b)
{
    const double left = *(const double *)a, right = *(const double *)b;
    return (left > right) - (left < right);
}

static void report(const char *name, double *times, size_t passes, size_t states)
{
    qsort(times, passes, sizeof *times, ascending);
    printf("psdmc      %-28s %8.1f ns\n", name, 1e9 * times[passes / 2] / (double)states);
}

/* The median pass over all states, `step` of them a call. Outputs of one state go round a ring. */
#define TIME(name, step, call) \
    for (int pass = 0; pass < PASSES; ++pass) { \
        const double start = seconds(); \
        for (size_t i = 0; i < STATES; i += (step)) { \
            double *to = (step) > 1 ? out : out + i % RING * LARGEST; \
            call; \
        } \
        times[pass] = seconds() - start; \
        check += out[1]; \
    } \
    report(name, times, PASSES, STATES)

#endif
