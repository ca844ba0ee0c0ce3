/* SPDX-License-Identifier: 0BSD */
/* gravity: gravity torques g(q), which hold the robot still */
#include "internal.h"
#include "rows.h"

#include "one_state.h"

void two_link_gravity(const double *q, double *g)
{
#include "gravity.inc"
}

void two_link_gravity_theta(const double *q, const double *theta_b, double *g)
{
#include "gravity_theta.inc"
}

#include "lane_states.h"

static void gravity_lanes(const real *q, real *g)
{
#include "gravity.inc"
}

void two_link_gravity_batch(size_t count, const double *q, double *g)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        const size_t first = block * LANES;
        const size_t rows = count - first < LANES ? count - first : LANES;
        real q_block[2 * LANES] ALIGNED;
        real g_block[2 * LANES] ALIGNED;
        fetch_ahead(block, count / LANES, q, 2 * LANES);
        load_rows(2, rows, q + first * 2, q_block);
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            gravity_lanes(q_block + lane, g_block + lane);
        }
        store_rows(2, rows, g_block, g + first * 2);
    }
}

void two_link_gravity_batch_soa(size_t count, const double *q, double *g)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        fetch_ahead(block, blocks, q, 2 * LANES);
        const real *q_block = q + block * 2 * LANES;
        real *g_block = g + block * 2 * LANES;
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            gravity_lanes(q_block + lane, g_block + lane);
        }
    }
}

static void gravity_theta_lanes(const real *q, const real *theta_b, real *g)
{
#include "gravity_theta.inc"
}

void two_link_gravity_theta_batch(size_t count, const double *q, const double *theta_b, double *g)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        const size_t first = block * LANES;
        const size_t rows = count - first < LANES ? count - first : LANES;
        real q_block[2 * LANES] ALIGNED;
        real g_block[2 * LANES] ALIGNED;
        fetch_ahead(block, count / LANES, q, 2 * LANES);
        load_rows(2, rows, q + first * 2, q_block);
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            gravity_theta_lanes(q_block + lane, theta_b, g_block + lane);
        }
        store_rows(2, rows, g_block, g + first * 2);
    }
}
