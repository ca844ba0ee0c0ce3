/* One emitted library timed by hand, sharing no code with the bench: its figures must agree with the page's within 15 %.
 *
 *   psdmc derive examples/robots/kr6.toml -o generated/kr6.npz && psdmc emit-c generated/kr6.npz -o generated/kr6
 *   gcc -O3 -march=native -ffp-contract=fast -fno-math-errno -fno-trapping-math -Igenerated/kr6/include \
 *       -DROBOT=kr6 -DHEADER='<kr6/kr6.h>' benchmarks/by_hand.c generated/kr6/src/[a-z]*.c -lm -o generated/by_hand
 *   generated/by_hand
 */
#define _POSIX_C_SOURCE 200809L
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include HEADER

#define JOIN2(a, b) a##b
#define JOIN(a, b) JOIN2(a, b)
#define OF_ROBOT(name) JOIN(ROBOT, name)

enum { N = OF_ROBOT(_DOF), STATES = 65536, PASSES = 15, RING = 4096 };

static double q[STATES * N], qd[STATES * N], x[STATES * N], out[RING * N];

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

static void report(const char *name, double *passes)
{
    qsort(passes, PASSES, sizeof *passes, ascending);
    printf("%-24s median %7.1f, best %7.1f ns per state\n", name, 1e9 * passes[PASSES / 2] / STATES, 1e9 * passes[0] / STATES);
}

int main(void)
{
    double passes[PASSES], check = 0.0;
    for (size_t i = 0; i < STATES * N; ++i) {
        q[i] = random_in(3.0);
        qd[i] = random_in(3.0);
        x[i] = random_in(15.0);
    }
    for (int pass = 0; pass < PASSES; ++pass) {
        const double start = seconds();
        for (size_t i = 0; i < STATES; ++i)
            OF_ROBOT(_inverse_dynamics)(q + i * N, qd + i * N, x + i * N, out + i % RING * N);
        passes[pass] = seconds() - start;
        check += out[N];
    }
    report("inverse_dynamics", passes);
    for (int pass = 0; pass < PASSES; ++pass) {
        const double start = seconds();
        for (size_t i = 0; i < STATES; ++i)
            OF_ROBOT(_forward_dynamics)(q + i * N, qd + i * N, x + i * N, out + i % RING * N);
        passes[pass] = seconds() - start;
        check += out[N];
    }
    report("forward_dynamics", passes);
    for (int pass = 0; pass < PASSES; ++pass) {
        const double start = seconds();
        for (size_t i = 0; i < STATES; i += RING)
            OF_ROBOT(_inverse_dynamics_batch)(RING, q + i * N, qd + i * N, x + i * N, out);
        passes[pass] = seconds() - start;
        check += out[N];
    }
    report("inverse_dynamics_batch", passes);
    return check == 0.0;
}
