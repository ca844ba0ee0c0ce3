/* SPDX-License-Identifier: 0BSD */
/* Compares every function of two_link, in every layout, with reference values from its model. Status 0 if all agree. */
#include "two_link/two_link.h"

typedef double real;

#include "reference.h"
#include "layouts.h"
#include "compare.h"

static real q_rows[COUNT * N], q_lanes[BLOCKS * LANES * N];
static real qd_rows[COUNT * N], qd_lanes[BLOCKS * LANES * N];
static real qdd_rows[COUNT * N], qdd_lanes[BLOCKS * LANES * N];
static real tau_rows[COUNT * N], tau_lanes[BLOCKS * LANES * N];
static real tau_theta_rows[COUNT * N], tau_theta_lanes[BLOCKS * LANES * N];
static real qd_r_rows[COUNT * N], qd_r_lanes[BLOCKS * LANES * N];
static real qdd_r_rows[COUNT * N], qdd_r_lanes[BLOCKS * LANES * N];

static void check_inverse_dynamics(void)
{
    const real *expected = inverse_dynamics_expected[0];
    double worst;
    int status = 0;

    clear();
    for (size_t row = 0; row < COUNT; row++) {
        two_link_inverse_dynamics(q_rows + row * N, qd_rows + row * N, qdd_rows + row * N, found + row * 2);
    }
    worst = error(COUNT, 2, 1, expected);
    report("inverse_dynamics", "one state", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_inverse_dynamics_batch(count, q_rows, qd_rows, qdd_rows, found);
        worst = fmax(worst, error(count, 2, 1, expected));
    }
    report("inverse_dynamics", "rows", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_inverse_dynamics_batch_soa(count, q_lanes, qd_lanes, qdd_lanes, blocks);
        to_rows(count, 2);
        worst = fmax(worst, error(count, 2, 1, expected));
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
        two_link_inverse_dynamics_theta(q_rows + row * N, qd_rows + row * N, qdd_rows + row * N, theta_b_given, found + row * 2);
    }
    worst = error(COUNT, 2, 1, expected);
    report("inverse_dynamics_theta", "one state", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_inverse_dynamics_theta_batch(count, q_rows, qd_rows, qdd_rows, theta_b_given, found);
        worst = fmax(worst, error(count, 2, 1, expected));
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
        status |= two_link_forward_dynamics(q_rows + row * N, qd_rows + row * N, tau_rows + row * N, found + row * 2) != 0;
    }
    worst = error(COUNT, 2, 1, expected);
    report("forward_dynamics", "one state", worst, status, 1e-7);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        status |= two_link_forward_dynamics_batch(count, q_rows, qd_rows, tau_rows, found) != 0;
        worst = fmax(worst, error(count, 2, 1, expected));
    }
    report("forward_dynamics", "rows", worst, status, 1e-7);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        status |= two_link_forward_dynamics_batch_soa(count, q_lanes, qd_lanes, tau_lanes, blocks) != 0;
        to_rows(count, 2);
        worst = fmax(worst, error(count, 2, 1, expected));
    }
    report("forward_dynamics", "lane by lane", worst, status, 1e-7);
}

static void check_forward_dynamics_theta(void)
{
    const real *expected = forward_dynamics_theta_expected[0];
    double worst;
    int status = 0;

    clear();
    for (size_t row = 0; row < COUNT; row++) {
        status |= two_link_forward_dynamics_theta(q_rows + row * N, qd_rows + row * N, tau_theta_rows + row * N, theta_b_given, found + row * 2) != 0;
    }
    worst = error(COUNT, 2, 1, expected);
    report("forward_dynamics_theta", "one state", worst, status, 1e-7);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        status |= two_link_forward_dynamics_theta_batch(count, q_rows, qd_rows, tau_theta_rows, theta_b_given, found) != 0;
        worst = fmax(worst, error(count, 2, 1, expected));
    }
    report("forward_dynamics_theta", "rows", worst, status, 1e-7);
}

static void check_mass_matrix(void)
{
    const real *expected = mass_matrix_expected[0];
    double worst;
    int status = 0;

    clear();
    for (size_t row = 0; row < COUNT; row++) {
        two_link_mass_matrix(q_rows + row * N, found + row * 4);
    }
    worst = error(COUNT, 2, 2, expected);
    report("mass_matrix", "one state", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_mass_matrix_batch(count, q_rows, found);
        worst = fmax(worst, error(count, 2, 2, expected));
    }
    report("mass_matrix", "rows", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_mass_matrix_batch_soa(count, q_lanes, blocks);
        to_rows(count, 4);
        worst = fmax(worst, error(count, 2, 2, expected));
    }
    report("mass_matrix", "lane by lane", worst, status, 1e-10);
}

static void check_mass_matrix_theta(void)
{
    const real *expected = mass_matrix_theta_expected[0];
    double worst;
    int status = 0;

    clear();
    for (size_t row = 0; row < COUNT; row++) {
        two_link_mass_matrix_theta(q_rows + row * N, theta_b_given, found + row * 4);
    }
    worst = error(COUNT, 2, 2, expected);
    report("mass_matrix_theta", "one state", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_mass_matrix_theta_batch(count, q_rows, theta_b_given, found);
        worst = fmax(worst, error(count, 2, 2, expected));
    }
    report("mass_matrix_theta", "rows", worst, status, 1e-10);
}

static void check_nonlinear_effects(void)
{
    const real *expected = nonlinear_effects_expected[0];
    double worst;
    int status = 0;

    clear();
    for (size_t row = 0; row < COUNT; row++) {
        two_link_nonlinear_effects(q_rows + row * N, qd_rows + row * N, found + row * 2);
    }
    worst = error(COUNT, 2, 1, expected);
    report("nonlinear_effects", "one state", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_nonlinear_effects_batch(count, q_rows, qd_rows, found);
        worst = fmax(worst, error(count, 2, 1, expected));
    }
    report("nonlinear_effects", "rows", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_nonlinear_effects_batch_soa(count, q_lanes, qd_lanes, blocks);
        to_rows(count, 2);
        worst = fmax(worst, error(count, 2, 1, expected));
    }
    report("nonlinear_effects", "lane by lane", worst, status, 1e-10);
}

static void check_nonlinear_effects_theta(void)
{
    const real *expected = nonlinear_effects_theta_expected[0];
    double worst;
    int status = 0;

    clear();
    for (size_t row = 0; row < COUNT; row++) {
        two_link_nonlinear_effects_theta(q_rows + row * N, qd_rows + row * N, theta_b_given, found + row * 2);
    }
    worst = error(COUNT, 2, 1, expected);
    report("nonlinear_effects_theta", "one state", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_nonlinear_effects_theta_batch(count, q_rows, qd_rows, theta_b_given, found);
        worst = fmax(worst, error(count, 2, 1, expected));
    }
    report("nonlinear_effects_theta", "rows", worst, status, 1e-10);
}

static void check_coriolis_matrix(void)
{
    const real *expected = coriolis_matrix_expected[0];
    double worst;
    int status = 0;

    clear();
    for (size_t row = 0; row < COUNT; row++) {
        two_link_coriolis_matrix(q_rows + row * N, qd_rows + row * N, found + row * 4);
    }
    worst = error(COUNT, 2, 2, expected);
    report("coriolis_matrix", "one state", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_coriolis_matrix_batch(count, q_rows, qd_rows, found);
        worst = fmax(worst, error(count, 2, 2, expected));
    }
    report("coriolis_matrix", "rows", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_coriolis_matrix_batch_soa(count, q_lanes, qd_lanes, blocks);
        to_rows(count, 4);
        worst = fmax(worst, error(count, 2, 2, expected));
    }
    report("coriolis_matrix", "lane by lane", worst, status, 1e-10);
}

static void check_coriolis_matrix_theta(void)
{
    const real *expected = coriolis_matrix_theta_expected[0];
    double worst;
    int status = 0;

    clear();
    for (size_t row = 0; row < COUNT; row++) {
        two_link_coriolis_matrix_theta(q_rows + row * N, qd_rows + row * N, theta_b_given, found + row * 4);
    }
    worst = error(COUNT, 2, 2, expected);
    report("coriolis_matrix_theta", "one state", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_coriolis_matrix_theta_batch(count, q_rows, qd_rows, theta_b_given, found);
        worst = fmax(worst, error(count, 2, 2, expected));
    }
    report("coriolis_matrix_theta", "rows", worst, status, 1e-10);
}

static void check_gravity(void)
{
    const real *expected = gravity_expected[0];
    double worst;
    int status = 0;

    clear();
    for (size_t row = 0; row < COUNT; row++) {
        two_link_gravity(q_rows + row * N, found + row * 2);
    }
    worst = error(COUNT, 2, 1, expected);
    report("gravity", "one state", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_gravity_batch(count, q_rows, found);
        worst = fmax(worst, error(count, 2, 1, expected));
    }
    report("gravity", "rows", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_gravity_batch_soa(count, q_lanes, blocks);
        to_rows(count, 2);
        worst = fmax(worst, error(count, 2, 1, expected));
    }
    report("gravity", "lane by lane", worst, status, 1e-10);
}

static void check_gravity_theta(void)
{
    const real *expected = gravity_theta_expected[0];
    double worst;
    int status = 0;

    clear();
    for (size_t row = 0; row < COUNT; row++) {
        two_link_gravity_theta(q_rows + row * N, theta_b_given, found + row * 2);
    }
    worst = error(COUNT, 2, 1, expected);
    report("gravity_theta", "one state", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_gravity_theta_batch(count, q_rows, theta_b_given, found);
        worst = fmax(worst, error(count, 2, 1, expected));
    }
    report("gravity_theta", "rows", worst, status, 1e-10);
}

static void check_regressor(void)
{
    const real *expected = regressor_expected[0];
    double worst;
    int status = 0;

    clear();
    for (size_t row = 0; row < COUNT; row++) {
        two_link_regressor(q_rows + row * N, qd_rows + row * N, qdd_rows + row * N, found + row * 8);
    }
    worst = error(COUNT, 2, 4, expected);
    report("regressor", "one state", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_regressor_batch(count, q_rows, qd_rows, qdd_rows, found);
        worst = fmax(worst, error(count, 2, 4, expected));
    }
    report("regressor", "rows", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_regressor_batch_soa(count, q_lanes, qd_lanes, qdd_lanes, blocks);
        to_rows(count, 8);
        worst = fmax(worst, error(count, 2, 4, expected));
    }
    report("regressor", "lane by lane", worst, status, 1e-10);
}

static void check_regressor_slotine_li(void)
{
    const real *expected = regressor_slotine_li_expected[0];
    double worst;
    int status = 0;

    clear();
    for (size_t row = 0; row < COUNT; row++) {
        two_link_regressor_slotine_li(q_rows + row * N, qd_rows + row * N, qd_r_rows + row * N, qdd_r_rows + row * N, found + row * 8);
    }
    worst = error(COUNT, 2, 4, expected);
    report("regressor_slotine_li", "one state", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_regressor_slotine_li_batch(count, q_rows, qd_rows, qd_r_rows, qdd_r_rows, found);
        worst = fmax(worst, error(count, 2, 4, expected));
    }
    report("regressor_slotine_li", "rows", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_regressor_slotine_li_batch_soa(count, q_lanes, qd_lanes, qd_r_lanes, qdd_r_lanes, blocks);
        to_rows(count, 8);
        worst = fmax(worst, error(count, 2, 4, expected));
    }
    report("regressor_slotine_li", "lane by lane", worst, status, 1e-10);
}

static void check_jacobian(void)
{
    const real *expected = jacobian_expected[0];
    double worst;
    int status = 0;

    clear();
    for (size_t row = 0; row < COUNT; row++) {
        two_link_jacobian(q_rows + row * N, found + row * 12);
    }
    worst = error(COUNT, 6, 2, expected);
    report("jacobian", "one state", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_jacobian_batch(count, q_rows, found);
        worst = fmax(worst, error(count, 6, 2, expected));
    }
    report("jacobian", "rows", worst, status, 1e-10);

    worst = 0.0;
    for (size_t count = 0; count <= COUNT; count++) {
        clear();
        two_link_jacobian_batch_soa(count, q_lanes, blocks);
        to_rows(count, 12);
        worst = fmax(worst, error(count, 6, 2, expected));
    }
    report("jacobian", "lane by lane", worst, status, 1e-10);
}

int main(void)
{
    repeat(q_given, q_rows, q_lanes);
    repeat(qd_given, qd_rows, qd_lanes);
    repeat(qdd_given, qdd_rows, qdd_lanes);
    repeat(tau_given, tau_rows, tau_lanes);
    repeat(tau_theta_given, tau_theta_rows, tau_theta_lanes);
    repeat(qd_r_given, qd_r_rows, qd_r_lanes);
    repeat(qdd_r_given, qdd_r_rows, qdd_r_lanes);
    check_inverse_dynamics();
    check_inverse_dynamics_theta();
    check_forward_dynamics();
    check_forward_dynamics_theta();
    check_mass_matrix();
    check_mass_matrix_theta();
    check_nonlinear_effects();
    check_nonlinear_effects_theta();
    check_coriolis_matrix();
    check_coriolis_matrix_theta();
    check_gravity();
    check_gravity_theta();
    check_regressor();
    check_regressor_slotine_li();
    check_jacobian();
    printf("two_link: %d checks of 15 functions, %d failed\n", checks, failures);
    return failures || checks == 0;
}
