/* Nanoseconds per call of one sincos: throughput (independent calls) and latency (each angle from the last result).

   Included after a rendered sincos; needs VEC (its vector type), LANES, REAL and SINCOS. Least of many trials. */
#include <stddef.h>
#include <stdio.h>
#include <time.h>

enum { CALLS = 256, TRIALS = 60000 };

static VEC angles[CALLS], sines[CALLS], cosines[CALLS];

static double now_ns(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return 1e9 * (double)time.tv_sec + (double)time.tv_nsec;
}

static __attribute__((noinline)) void independent(void)
{
    for (size_t i = 0; i < CALLS; ++i)
        SINCOS(&angles[i], &sines[i], &cosines[i]);
}

static __attribute__((noinline)) void dependent(void)
{
    VEC angle = angles[0], s = angle, c = angle;
    for (size_t i = 0; i < CALLS; ++i) {
        SINCOS(&angle, &s, &c);
        angle = angle + s;
    }
    sines[0] = s;
    cosines[0] = c;
}

static double least_ns(void (*run)(void))
{
    double least = 1e300;
    for (int trial = 0; trial < TRIALS; ++trial) {
        const double start = now_ns();
        run();
        __asm__ volatile("" : : "r"(sines), "r"(cosines) : "memory");
        const double spent = now_ns() - start;
        least = spent < least ? spent : least;
    }
    return least / CALLS;
}

int main(void)
{
    REAL *each = (REAL *)angles;
    for (size_t i = 0; i < (size_t)CALLS * LANES; ++i)
        each[i] = (REAL)(((double)((i * 2654435761u) % 65536u) - 32768.0) * 1e-4);
    printf("throughput %.2f ns, latency %.2f ns (with one addition)\n", least_ns(independent), least_ns(dependent));
    return 0;
}
