/* SPDX-License-Identifier: 0BSD */
/* forward_dynamics: joint accelerations that torques cause, qdd = M(q)^-1 (tau - h(q, qd)) */
#include "internal.h"
#include "rows.h"
#include "pivots.h"

#include "one_state.h"

int two_link_forward_dynamics(const double *q, const double *qd, const double *tau, double *qdd)
{
    real pivot[2];
#include "forward_dynamics.inc"
    if (!(pivot[0] > 0)) {
        return fail(qdd, 1);
    }
    if (!(pivot[1] > 0)) {
        return fail(qdd, 2);
    }
    return 0;
}

int two_link_forward_dynamics_theta(const double *q, const double *qd, const double *tau, const double *theta_b, double *qdd)
{
    real pivot[2];
#include "forward_dynamics_theta.inc"
    if (!(pivot[0] > 0)) {
        return fail(qdd, 1);
    }
    if (!(pivot[1] > 0)) {
        return fail(qdd, 2);
    }
    return 0;
}

#include "lane_states.h"

static void forward_dynamics_lanes(const real *q, const real *qd, const real *tau, real *qdd, real *pivot)
{
#include "forward_dynamics_lanes.inc"
}

size_t two_link_forward_dynamics_batch(size_t count, const double *q, const double *qd, const double *tau, double *qdd)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    size_t failed = count;
    PARALLEL_FOR_FIRST(failed)
    for (size_t block = 0; block < blocks; block++) {
        const size_t first = block * LANES;
        const size_t rows = count - first < LANES ? count - first : LANES;
        real q_block[2 * LANES] ALIGNED;
        real qd_block[2 * LANES] ALIGNED;
        real tau_block[2 * LANES] ALIGNED;
        real qdd_block[2 * LANES] ALIGNED;
        real pivot_block[2 * LANES] ALIGNED;
        fetch_ahead(block, count / LANES, q, 2 * LANES);
        load_rows(2, rows, q + first * 2, q_block);
        fetch_ahead(block, count / LANES, qd, 2 * LANES);
        load_rows(2, rows, qd + first * 2, qd_block);
        fetch_ahead(block, count / LANES, tau, 2 * LANES);
        load_rows(2, rows, tau + first * 2, tau_block);
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            forward_dynamics_lanes(q_block + lane, qd_block + lane, tau_block + lane, qdd_block + lane, pivot_block + lane);
        }
        const size_t bad = mark_failed(rows, pivot_block, qdd_block);
        if (bad < rows && first + bad < failed) {
            failed = first + bad;
        }
        store_rows(2, rows, qdd_block, qdd + first * 2);
    }
    return failed < count ? failed + 1 : 0;
}

size_t two_link_forward_dynamics_batch_soa(size_t count, const double *q, const double *qd, const double *tau, double *qdd)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    size_t failed = count;
    PARALLEL_FOR_FIRST(failed)
    for (size_t block = 0; block < blocks; block++) {
        fetch_ahead(block, blocks, q, 2 * LANES);
        const real *q_block = q + block * 2 * LANES;
        fetch_ahead(block, blocks, qd, 2 * LANES);
        const real *qd_block = qd + block * 2 * LANES;
        fetch_ahead(block, blocks, tau, 2 * LANES);
        const real *tau_block = tau + block * 2 * LANES;
        real *qdd_block = qdd + block * 2 * LANES;
        real pivot_block[2 * LANES] ALIGNED;
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            forward_dynamics_lanes(q_block + lane, qd_block + lane, tau_block + lane, qdd_block + lane, pivot_block + lane);
        }
        const size_t first = block * LANES;
        const size_t rows = count - first < LANES ? count - first : LANES;
        const size_t bad = mark_failed(rows, pivot_block, qdd_block);
        if (bad < rows && first + bad < failed) {
            failed = first + bad;
        }
    }
    return failed < count ? failed + 1 : 0;
}

static void forward_dynamics_theta_lanes(const real *q, const real *qd, const real *tau, const real *theta_b, real *qdd, real *pivot)
{
#include "forward_dynamics_theta.inc"
}

size_t two_link_forward_dynamics_theta_batch(size_t count, const double *q, const double *qd, const double *tau, const double *theta_b, double *qdd)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    size_t failed = count;
    PARALLEL_FOR_FIRST(failed)
    for (size_t block = 0; block < blocks; block++) {
        const size_t first = block * LANES;
        const size_t rows = count - first < LANES ? count - first : LANES;
        real q_block[2 * LANES] ALIGNED;
        real qd_block[2 * LANES] ALIGNED;
        real tau_block[2 * LANES] ALIGNED;
        real qdd_block[2 * LANES] ALIGNED;
        real pivot_block[2 * LANES] ALIGNED;
        fetch_ahead(block, count / LANES, q, 2 * LANES);
        load_rows(2, rows, q + first * 2, q_block);
        fetch_ahead(block, count / LANES, qd, 2 * LANES);
        load_rows(2, rows, qd + first * 2, qd_block);
        fetch_ahead(block, count / LANES, tau, 2 * LANES);
        load_rows(2, rows, tau + first * 2, tau_block);
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            forward_dynamics_theta_lanes(q_block + lane, qd_block + lane, tau_block + lane, theta_b, qdd_block + lane, pivot_block + lane);
        }
        const size_t bad = mark_failed(rows, pivot_block, qdd_block);
        if (bad < rows && first + bad < failed) {
            failed = first + bad;
        }
        store_rows(2, rows, qdd_block, qdd + first * 2);
    }
    return failed < count ? failed + 1 : 0;
}
