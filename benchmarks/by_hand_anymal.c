/* The emitted library of a floating anymal_b timed by hand, sharing no code with the bench. benchmarks/by_hand_anymal.sh
 * compiles and runs it. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include <anymal/anymal.h>

enum { NQ = anymal_NQ, NV = anymal_NV, STATES = 65536, PASSES = 15, BLOCK = 2048, RING = 64, LARGEST = NV * NV };

static _Alignas(64) double q[STATES * NQ], qd[STATES * NV], x[STATES * NV], out[BLOCK * NV > RING * LARGEST ? BLOCK * NV : RING * LARGEST];
static _Alignas(64) double q_soa[STATES * NQ], qd_soa[STATES * NV], x_soa[STATES * NV];

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
    printf("psdmc      %-28s %8.1f ns\n", name, 1e9 * passes[PASSES / 2] / STATES);
}

/* Quaternions of length one; joints within half a turn. */
static void draw_states(void)
{
    for (size_t i = 0; i < STATES; ++i) {
        double *position = q + i * NQ, length = 0.0;
        for (int j = 0; j < NQ; ++j) position[j] = random_in(j < 7 ? 1.0 : 1.5);
        for (int j = 3; j < 7; ++j) length += position[j] * position[j];
        for (int j = 3; j < 7; ++j) position[j] /= sqrt(length);
        for (int j = 0; j < NV; ++j) {
            qd[i * NV + j] = random_in(3.0);
            x[i * NV + j] = random_in(15.0);
        }
    }
}

/* Rows in blocks of anymal_LANES states, variable by variable. */
static void lay_out(const double *rows, double *blocks, size_t width)
{
    for (size_t i = 0; i < STATES; ++i)
        for (size_t j = 0; j < width; ++j)
            blocks[(i / anymal_LANES * width + j) * anymal_LANES + i % anymal_LANES] = rows[i * width + j];
}

/* The median pass over all states, `step` of them a call. */
#define TIME(name, step, call) \
    for (int pass = 0; pass < PASSES; ++pass) { \
        const double start = seconds(); \
        for (size_t i = 0; i < STATES; i += (step)) { \
            double *to = (step) > 1 ? out : out + i % RING * LARGEST; \
            call; \
        } \
        passes[pass] = seconds() - start; \
        check += out[1]; \
    } \
    report(name, passes)

int main(void)
{
    double passes[PASSES], check = 0.0;
    draw_states();
    lay_out(q, q_soa, NQ), lay_out(qd, qd_soa, NV), lay_out(x, x_soa, NV);
    TIME("inverse_dynamics", 1, anymal_inverse_dynamics(q + i * NQ, qd + i * NV, x + i * NV, to));
    TIME("forward_dynamics", 1, anymal_forward_dynamics(q + i * NQ, qd + i * NV, x + i * NV, to));
    TIME("mass_matrix", 1, anymal_mass_matrix(q + i * NQ, to));
    TIME("inverse_dynamics rows", BLOCK, anymal_inverse_dynamics_batch(BLOCK, q + i * NQ, qd + i * NV, x + i * NV, to));
    TIME("forward_dynamics rows", BLOCK, anymal_forward_dynamics_batch(BLOCK, q + i * NQ, qd + i * NV, x + i * NV, to));
    TIME("inverse_dynamics lanes", BLOCK, anymal_inverse_dynamics_batch_soa(BLOCK, q_soa + i * NQ, qd_soa + i * NV, x_soa + i * NV, to));
    TIME("forward_dynamics lanes", BLOCK, anymal_forward_dynamics_batch_soa(BLOCK, q_soa + i * NQ, qd_soa + i * NV, x_soa + i * NV, to));
    return check == 0.0;
}
