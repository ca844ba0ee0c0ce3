/* Compares two_link with reference states from its model. Status 0 if all agree. */
#include <math.h>
#include <stdio.h>

#include "two_link/two_link.h"

#include "reference.h"

#define N 2

typedef double real;

static int failures = 0;

/* Differences relative to each joint's largest reference value; a NaN counts as a failure. */
static void compare(const char *what, const real (*found)[N], const real (*expected)[N], double tolerance)
{
    double worst = 0.0;
    int good = 1;
    for (int joint = 0; joint < N; joint++) {
        double largest = 0.0;
        for (int row = 0; row < REFERENCE_COUNT; row++) {
            largest = fmax(largest, fabs((double)expected[row][joint]));
        }
        for (int row = 0; row < REFERENCE_COUNT; row++) {
            const double difference = fabs((double)found[row][joint] - (double)expected[row][joint]);
            const double error = largest > 0.0 ? difference / largest : difference;
            good &= error <= tolerance;
            worst = fmax(worst, error);
        }
    }
    printf("%-28s error %.2e, tolerance %.0e: %s\n", what, worst, tolerance, good ? "ok" : "FAILED");
    failures += !good;
}

int main(void)
{
    real found[REFERENCE_COUNT][N];

    for (int row = 0; row < REFERENCE_COUNT; row++) {
        (void)two_link_inverse_dynamics(reference_q[row], reference_qd[row], reference_qdd[row], found[row]);
    }
    compare("inverse_dynamics", (const real (*)[N])found, reference_tau, 1e-10);
    (void)two_link_inverse_dynamics_batch(REFERENCE_COUNT, reference_q[0], reference_qd[0], reference_qdd[0], found[0]);
    compare("inverse_dynamics, batch", (const real (*)[N])found, reference_tau, 1e-10);

    for (int row = 0; row < REFERENCE_COUNT; row++) {
        (void)two_link_inverse_dynamics_theta(reference_q[row], reference_qd[row], reference_qdd[row], two_link_theta_b, found[row]);
    }
    compare("inverse_dynamics_theta", (const real (*)[N])found, reference_tau, 1e-10);
    (void)two_link_inverse_dynamics_theta_batch(REFERENCE_COUNT, reference_q[0], reference_qd[0], reference_qdd[0], two_link_theta_b, found[0]);
    compare("inverse_dynamics_theta, batch", (const real (*)[N])found, reference_tau, 1e-10);

    for (int row = 0; row < REFERENCE_COUNT; row++) {
        (void)two_link_forward_dynamics(reference_q[row], reference_qd[row], reference_tau[row], found[row]);
    }
    compare("forward_dynamics", (const real (*)[N])found, reference_qdd, 1e-7);
    (void)two_link_forward_dynamics_batch(REFERENCE_COUNT, reference_q[0], reference_qd[0], reference_tau[0], found[0]);
    compare("forward_dynamics, batch", (const real (*)[N])found, reference_qdd, 1e-7);

    for (int row = 0; row < REFERENCE_COUNT; row++) {
        (void)two_link_forward_dynamics_theta(reference_q[row], reference_qd[row], reference_tau[row], two_link_theta_b, found[row]);
    }
    compare("forward_dynamics_theta", (const real (*)[N])found, reference_qdd, 1e-7);
    (void)two_link_forward_dynamics_theta_batch(REFERENCE_COUNT, reference_q[0], reference_qd[0], reference_tau[0], two_link_theta_b, found[0]);
    compare("forward_dynamics_theta, batch", (const real (*)[N])found, reference_qdd, 1e-7);

    return failures ? 1 : 0;
}
