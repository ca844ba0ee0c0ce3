/* SPDX-License-Identifier: 0BSD */
/* inverse_dynamics: joint torques of a motion, tau = M(q) qdd + h(q, qd) */
#include "internal.h"
#include "rows.h"

#include "one_state.h"

void two_link_inverse_dynamics(const double *q, const double *qd, const double *qdd, double *tau)
{
#include "inverse_dynamics.inc"
}

void two_link_inverse_dynamics_theta(const double *q, const double *qd, const double *qdd, const double *theta_b, double *tau)
{
#include "inverse_dynamics_theta.inc"
}

#include "lane_states.h"

static void inverse_dynamics_lanes(const real *q, const real *qd, const real *qdd, real *tau)
{
#include "inverse_dynamics.inc"
}

void two_link_inverse_dynamics_batch(size_t count, const double *q, const double *qd, const double *qdd, double *tau)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        const size_t first = block * LANES;
        const size_t rows = count - first < LANES ? count - first : LANES;
        real q_block[2 * LANES] ALIGNED;
        real qd_block[2 * LANES] ALIGNED;
        real qdd_block[2 * LANES] ALIGNED;
        real tau_block[2 * LANES] ALIGNED;
        fetch_ahead(block, count / LANES, q, 2 * LANES);
        load_rows(2, rows, q + first * 2, q_block);
        fetch_ahead(block, count / LANES, qd, 2 * LANES);
        load_rows(2, rows, qd + first * 2, qd_block);
        fetch_ahead(block, count / LANES, qdd, 2 * LANES);
        load_rows(2, rows, qdd + first * 2, qdd_block);
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            inverse_dynamics_lanes(q_block + lane, qd_block + lane, qdd_block + lane, tau_block + lane);
        }
        store_rows(2, rows, tau_block, tau + first * 2);
    }
}

void two_link_inverse_dynamics_batch_soa(size_t count, const double *q, const double *qd, const double *qdd, double *tau)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        fetch_ahead(block, blocks, q, 2 * LANES);
        const real *q_block = q + block * 2 * LANES;
        fetch_ahead(block, blocks, qd, 2 * LANES);
        const real *qd_block = qd + block * 2 * LANES;
        fetch_ahead(block, blocks, qdd, 2 * LANES);
        const real *qdd_block = qdd + block * 2 * LANES;
        real *tau_block = tau + block * 2 * LANES;
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            inverse_dynamics_lanes(q_block + lane, qd_block + lane, qdd_block + lane, tau_block + lane);
        }
    }
}

static void inverse_dynamics_theta_lanes(const real *q, const real *qd, const real *qdd, const real *theta_b, real *tau)
{
#include "inverse_dynamics_theta.inc"
}

void two_link_inverse_dynamics_theta_batch(size_t count, const double *q, const double *qd, const double *qdd, const double *theta_b, double *tau)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        const size_t first = block * LANES;
        const size_t rows = count - first < LANES ? count - first : LANES;
        real q_block[2 * LANES] ALIGNED;
        real qd_block[2 * LANES] ALIGNED;
        real qdd_block[2 * LANES] ALIGNED;
        real tau_block[2 * LANES] ALIGNED;
        fetch_ahead(block, count / LANES, q, 2 * LANES);
        load_rows(2, rows, q + first * 2, q_block);
        fetch_ahead(block, count / LANES, qd, 2 * LANES);
        load_rows(2, rows, qd + first * 2, qd_block);
        fetch_ahead(block, count / LANES, qdd, 2 * LANES);
        load_rows(2, rows, qdd + first * 2, qdd_block);
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            inverse_dynamics_theta_lanes(q_block + lane, qd_block + lane, qdd_block + lane, theta_b, tau_block + lane);
        }
        store_rows(2, rows, tau_block, tau + first * 2);
    }
}
