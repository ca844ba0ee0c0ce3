/* Dynamics of many states of a legged robot: throughput STATES. As rows, one state after the other, as NumPy and PyTorch keep
 * them; and lane by lane, blocks of robot_LANES states variable by variable, which needs no transposing: a simulation that
 * keeps its states so saves that in every step. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include <robot/robot.h>

enum { NQ = robot_NQ, NV = robot_NV, LANES = robot_LANES, JOINTS_FROM = 7, PASSES = 5 };

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

static double *reals(size_t count)
{
    double *memory = aligned_alloc(64, (count * sizeof(double) + 63) / 64 * 64);
    if (memory) return memory;
    fprintf(stderr, "error: not enough memory for %zu numbers\n", count);
    exit(1);
}

/* Rows of `width` reals in whole blocks of LANES states, variable by variable. */
static double *in_blocks(const double *rows, size_t states, size_t width)
{
    double *blocks = reals(states * width);
    for (size_t i = 0; i < states; ++i)
        for (size_t j = 0; j < width; ++j) blocks[(i / LANES * width + j) * LANES + i % LANES] = rows[i * width + j];
    return blocks;
}

/* A trunk anywhere, turned any way: its quaternion (x, y, z, w) has length one. Joints within a radian. */
static void draw(double *q, double *v, double *x)
{
    double square = 0.0;
    for (int j = 0; j < NQ; ++j) q[j] = random_in(1.0);
    for (int j = 3; j < JOINTS_FROM; ++j) square += q[j] * q[j];
    for (int j = 3; j < JOINTS_FROM; ++j) q[j] /= sqrt(square);
    for (int j = 0; j < NV; ++j) v[j] = random_in(2.0), x[j] = random_in(5.0);
}

static void report(const char *what, double best, size_t states)
{
    printf("%-32s %8.1f ns a state, %7.2f million states a second\n", what, 1e9 * best / (double)states, 1e-6 * (double)states / best);
}

#define TIME(what, call) \
    do { \
        double best = INFINITY; \
        for (int pass = 0; pass < PASSES; ++pass) { \
            const double start = seconds(); \
            call; \
            best = fmin(best, seconds() - start); \
        } \
        report(what, best, states); \
    } while (0)

/* Largest difference between a result as rows and the same in blocks, beside the largest value. */
static double difference(const double *rows, const double *blocks, size_t states)
{
    double error = 0.0, largest = 0.0;
    for (size_t i = 0; i < states; ++i)
        for (size_t j = 0; j < NV; ++j) {
            const double value = rows[i * NV + j], other = blocks[(i / LANES * NV + j) * LANES + i % LANES];
            error = fmax(error, fabs(value - other)), largest = fmax(largest, fabs(value));
        }
    return error / largest;
}

int main(int count, char **arguments)
{
    const long asked = count == 2 ? atol(arguments[1]) : 0;
    if (asked < LANES) return fprintf(stderr, "usage: throughput STATES (at least %d)\n", LANES), 2;
    const size_t states = (size_t)asked / LANES * LANES;
    double *q = reals(states * NQ), *v = reals(states * NV), *a = reals(states * NV), *tau = reals(states * NV), *found = reals(states * NV);
    for (size_t i = 0; i < states; ++i) draw(q + i * NQ, v + i * NV, a + i * NV);
    double *q_soa = in_blocks(q, states, NQ), *v_soa = in_blocks(v, states, NV), *a_soa = in_blocks(a, states, NV);
    double *tau_soa = reals(states * NV), *found_soa = reals(states * NV);

    printf("%zu states, %d positions, %d rates\n", states, NQ, NV);
    TIME("inverse dynamics, rows", robot_inverse_dynamics_batch(states, q, v, a, tau));
    TIME("inverse dynamics, lanes", robot_inverse_dynamics_batch_soa(states, q_soa, v_soa, a_soa, tau_soa));
    size_t failed = 0;
    TIME("forward dynamics, rows", failed = robot_forward_dynamics_batch(states, q, v, tau, found));
    TIME("forward dynamics, lanes", (void)robot_forward_dynamics_batch_soa(states, q_soa, v_soa, tau_soa, found_soa));
    printf("rows and lanes differ by %.1e, accelerations come back to %.1e\n", difference(tau, tau_soa, states), difference(found, a_soa, states));
    if (failed) fprintf(stderr, "error: the mass matrix of state %zu is not positive definite\n", failed - 1);
    return failed != 0;
}
