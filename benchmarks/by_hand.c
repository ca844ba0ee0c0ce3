/* The emitted KR6 library timed by hand, sharing no code with the bench. benchmarks/by_hand.sh compiles and runs it. */
#define _POSIX_C_SOURCE 200809L
#include <kr6/kr6.h>

#include "by_hand_timing.h"

enum { N = kr6_DOF, STATES = 65536, PASSES = 15, BLOCK = 4096, SOME = 256, LARGEST = kr6_DOF * kr6_BASE_PARAMETERS, SQUARE = N * N, RING = 128 };

static _Alignas(64) double q[STATES * N], qd[STATES * N], x[STATES * N], out[RING * LARGEST];
static _Alignas(64) double by_q[SOME * SQUARE], by_qd[SOME * SQUARE], by_x[SOME * SQUARE], found[SOME * N];

int main(void)
{
    double times[PASSES], check = 0.0;
    for (size_t i = 0; i < STATES * N; ++i) {
        q[i] = random_in(3.0);
        qd[i] = random_in(3.0);
        x[i] = random_in(15.0);
    }
    TIME("inverse_dynamics", 1, kr6_inverse_dynamics(q + i * N, qd + i * N, x + i * N, to));
    TIME("forward_dynamics", 1, kr6_forward_dynamics(q + i * N, qd + i * N, x + i * N, to));
    TIME("mass_matrix", 1, kr6_mass_matrix(q + i * N, to));
    TIME("regressor", 1, kr6_regressor(q + i * N, qd + i * N, x + i * N, to));
    TIME("inverse_dynamics rows", BLOCK, kr6_inverse_dynamics_batch(BLOCK, q + i * N, qd + i * N, x + i * N, to));
    TIME("forward_dynamics rows", BLOCK, kr6_forward_dynamics_batch(BLOCK, q + i * N, qd + i * N, x + i * N, to));
    TIME("inverse_dynamics lanes", BLOCK, kr6_inverse_dynamics_batch_soa(BLOCK, q + i * N, qd + i * N, x + i * N, to));
    TIME("forward_dynamics lanes", BLOCK, kr6_forward_dynamics_batch_soa(BLOCK, q + i * N, qd + i * N, x + i * N, to));
    /* One state: outputs go round, as above. Many: so few a call that outputs stay in L2. */
    TIME("inverse derivatives", 1, (to = by_q + i % RING * SQUARE,
         kr6_inverse_dynamics_derivatives(q + i * N, qd + i * N, x + i * N, to, by_qd + (to - by_q), by_x + (to - by_q))));
    TIME("forward derivatives", 1, (to = by_q + i % RING * SQUARE,
         kr6_forward_dynamics_derivatives(q + i * N, qd + i * N, x + i * N, found, to, by_qd + (to - by_q), by_x + (to - by_q))));
    TIME("inverse derivatives rows", SOME, (to = out,
         kr6_inverse_dynamics_derivatives_batch(SOME, q + i * N, qd + i * N, x + i * N, by_q, by_qd, by_x)));
    TIME("forward derivatives rows", SOME, (to = out,
         kr6_forward_dynamics_derivatives_batch(SOME, q + i * N, qd + i * N, x + i * N, found, by_q, by_qd, by_x)));
    TIME("inverse derivatives lanes", SOME, (to = out,
         kr6_inverse_dynamics_derivatives_batch_soa(SOME, q + i * N, qd + i * N, x + i * N, by_q, by_qd, by_x)));
    TIME("forward derivatives lanes", SOME, (to = out,
         kr6_forward_dynamics_derivatives_batch_soa(SOME, q + i * N, qd + i * N, x + i * N, found, by_q, by_qd, by_x)));
    /* The cotangent is whatever numbers are at hand: x. */
    TIME("inverse vjp", 1, (to = by_q + i % RING * N,
         kr6_inverse_dynamics_vjp(q + i * N, qd + i * N, x + i * N, x + i * N, to, by_qd + (to - by_q), by_x + (to - by_q), found)));
    TIME("forward vjp", 1, (to = by_q + i % RING * N,
         kr6_forward_dynamics_vjp(q + i * N, qd + i * N, x + i * N, x + i * N, to, by_qd + (to - by_q), by_x + (to - by_q), found)));
    TIME("inverse vjp rows", SOME, (to = out,
         kr6_inverse_dynamics_vjp_batch(SOME, q + i * N, qd + i * N, x + i * N, x + i * N, found, by_q, by_qd, by_x)));
    TIME("forward vjp rows", SOME, (to = out,
         kr6_forward_dynamics_vjp_batch(SOME, q + i * N, qd + i * N, x + i * N, x + i * N, found, by_q, by_qd, by_x)));
    TIME("inverse vjp lanes", SOME, (to = out,
         kr6_inverse_dynamics_vjp_batch_soa(SOME, q + i * N, qd + i * N, x + i * N, x + i * N, found, by_q, by_qd, by_x)));
    TIME("forward vjp lanes", SOME, (to = out,
         kr6_forward_dynamics_vjp_batch_soa(SOME, q + i * N, qd + i * N, x + i * N, x + i * N, found, by_q, by_qd, by_x)));
    return check + by_q[7] + by_qd[7] + by_x[7] + found[1] == 0.0;
}
