/* The emitted library of a floating anymal_b timed by hand, sharing no code with the bench. benchmarks/by_hand_anymal.sh
 * compiles and runs it. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>

#include <anymal/anymal.h>

#include "by_hand_timing.h"

enum { NQ = anymal_NQ, NV = anymal_NV, STATES = 65536, PASSES = 15, BLOCK = 2048, LARGEST = NV * NV };

/* Eight matrices of 2.6 kB stay in the first cache, as the one that Pinocchio writes does. */
enum { RING = 8 };

static _Alignas(64) double q[STATES * NQ], qd[STATES * NV], x[STATES * NV], out[BLOCK * NV > RING * LARGEST ? BLOCK * NV : RING * LARGEST];
static _Alignas(64) double q_soa[STATES * NQ], qd_soa[STATES * NV], x_soa[STATES * NV];

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

int main(void)
{
    double times[PASSES], check = 0.0;
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
