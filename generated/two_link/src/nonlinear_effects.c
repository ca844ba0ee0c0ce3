/* SPDX-License-Identifier: 0BSD */
/* nonlinear_effects: Coriolis, centrifugal and gravity torques, h(q, qd) = C(q, qd) qd + g(q) */
#include "internal.h"
#include "rows.h"

#include "one_state.h"

void two_link_nonlinear_effects(const double *q, const double *qd, double *h)
{
#include "nonlinear_effects.inc"
}

void two_link_nonlinear_effects_theta(const double *q, const double *qd, const double *theta_b, double *h)
{
#include "nonlinear_effects_theta.inc"
}

#include "lane_states.h"

static void nonlinear_effects_lanes(const real *q, const real *qd, real *h)
{
#include "nonlinear_effects.inc"
}

void two_link_nonlinear_effects_batch(size_t count, const double *q, const double *qd, double *h)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        const size_t first = block * LANES;
        const size_t rows = count - first < LANES ? count - first : LANES;
        real q_block[2 * LANES] ALIGNED;
        real qd_block[2 * LANES] ALIGNED;
        real h_block[2 * LANES] ALIGNED;
        fetch_ahead(block, count / LANES, q, 2 * LANES);
        load_rows(2, rows, q + first * 2, q_block);
        fetch_ahead(block, count / LANES, qd, 2 * LANES);
        load_rows(2, rows, qd + first * 2, qd_block);
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            nonlinear_effects_lanes(q_block + lane, qd_block + lane, h_block + lane);
        }
        store_rows(2, rows, h_block, h + first * 2);
    }
}

void two_link_nonlinear_effects_batch_soa(size_t count, const double *q, const double *qd, double *h)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        fetch_ahead(block, blocks, q, 2 * LANES);
        const real *q_block = q + block * 2 * LANES;
        fetch_ahead(block, blocks, qd, 2 * LANES);
        const real *qd_block = qd + block * 2 * LANES;
        real *h_block = h + block * 2 * LANES;
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            nonlinear_effects_lanes(q_block + lane, qd_block + lane, h_block + lane);
        }
    }
}

static void nonlinear_effects_theta_lanes(const real *q, const real *qd, const real *theta_b, real *h)
{
#include "nonlinear_effects_theta.inc"
}

void two_link_nonlinear_effects_theta_batch(size_t count, const double *q, const double *qd, const double *theta_b, double *h)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        const size_t first = block * LANES;
        const size_t rows = count - first < LANES ? count - first : LANES;
        real q_block[2 * LANES] ALIGNED;
        real qd_block[2 * LANES] ALIGNED;
        real h_block[2 * LANES] ALIGNED;
        fetch_ahead(block, count / LANES, q, 2 * LANES);
        load_rows(2, rows, q + first * 2, q_block);
        fetch_ahead(block, count / LANES, qd, 2 * LANES);
        load_rows(2, rows, qd + first * 2, qd_block);
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            nonlinear_effects_theta_lanes(q_block + lane, qd_block + lane, theta_b, h_block + lane);
        }
        store_rows(2, rows, h_block, h + first * 2);
    }
}
