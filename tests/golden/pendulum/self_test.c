/* SPDX-License-Identifier: 0BSD */
/* Compares every function of pendulum, in every layout, with reference values from its model. Status 0 if all agree. */
#include "pendulum/pendulum.h"

typedef double real;

#include "reference.h"
#include "layouts.h"
#include "compare.h"

static real q_rows[COUNT * N], q_lanes[BLOCKS * LANES * N];
static real qd_rows[COUNT * N], qd_lanes[BLOCKS * LANES * N];
static real qdd_rows[COUNT * N], qdd_lanes[BLOCKS * LANES * N];
static real tau_rows[COUNT * N], tau_lanes[BLOCKS * LANES * N];

static void check_inverse_dynamics(void)
{
    const real *expected = inverse_dynamics_expected[0];
    double worst;
    int status = 0;

    clear();
    for (size_t row = 0; row < COUNT; row++) {
        pendulum_inverse_dynamics(q_rows + row * N, qd_rows + row * N, qdd_rows + row * N, found + row * 1);
    }
    worst = error(COUNT, 1, 1, expected);
    report("inverse_dynamics", "one state", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        pendulum_inverse_dynamics_batch(count, q_rows, qd_rows, qdd_rows, found);
        worst = fmax(worst, error(count, 1, 1, expected));
    }
    report("inverse_dynamics", "rows", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        pendulum_inverse_dynamics_batch_soa(count, q_lanes, qd_lanes, qdd_lanes, blocks);
        to_rows(count, 1);
        worst = fmax(worst, error(count, 1, 1, expected));
    }
    report("inverse_dynamics", "lane by lane", worst, status, 1e-10);
}

static void check_inverse_dynamics_theta(void)
{
    const real *expected = inverse_dynamics_theta_expected[0];
    double worst;
    int status = 0;

    clear();
    for (size_t row = 0; row < COUNT; row++) {
        pendulum_inverse_dynamics_theta(q_rows + row * N, qd_rows + row * N, qdd_rows + row * N, theta_b_given, found + row * 1);
    }
    worst = error(COUNT, 1, 1, expected);
    report("inverse_dynamics_theta", "one state", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        pendulum_inverse_dynamics_theta_batch(count, q_rows, qd_rows, qdd_rows, theta_b_given, found);
        worst = fmax(worst, error(count, 1, 1, expected));
    }
    report("inverse_dynamics_theta", "rows", worst, status, 1e-10);
}

static void check_forward_dynamics(void)
{
    const real *expected = forward_dynamics_expected[0];
    double worst;
    int status = 0;

    clear();
    for (size_t row = 0; row < COUNT; row++) {
        status |= pendulum_forward_dynamics(q_rows + row * N, qd_rows + row * N, tau_rows + row * N, found + row * 1) != 0;
    }
    worst = error(COUNT, 1, 1, expected);
    report("forward_dynamics", "one state", worst, status, 1e-7);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        status |= pendulum_forward_dynamics_batch(count, q_rows, qd_rows, tau_rows, found) != 0;
        worst = fmax(worst, error(count, 1, 1, expected));
    }
    report("forward_dynamics", "rows", worst, status, 1e-7);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        status |= pendulum_forward_dynamics_batch_soa(count, q_lanes, qd_lanes, tau_lanes, blocks) != 0;
        to_rows(count, 1);
        worst = fmax(worst, error(count, 1, 1, expected));
    }
    report("forward_dynamics", "lane by lane", worst, status, 1e-7);
}

int main(void)
{
    repeat(q_given, q_rows, q_lanes);
    repeat(qd_given, qd_rows, qd_lanes);
    repeat(qdd_given, qdd_rows, qdd_lanes);
    repeat(tau_given, tau_rows, tau_lanes);
    check_inverse_dynamics();
    check_inverse_dynamics_theta();
    check_forward_dynamics();
    printf("pendulum: %d checks of 3 functions, %d failed\n", checks, failures);
    return failures || checks == 0;
}
