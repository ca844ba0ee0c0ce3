/* SPDX-License-Identifier: 0BSD */
/* regressor: regressor Y(q, qd, qdd): tau = Y theta_b */
#include "internal.h"
#include "rows.h"

#include "one_state.h"

void two_link_regressor(const double *q, const double *qd, const double *qdd, double *Y)
{
#include "regressor.inc"
}

#include "lane_states.h"

static void regressor_lanes(const real *q, const real *qd, const real *qdd, real *Y)
{
#include "regressor.inc"
}

#include "lane_rows.h"

static void regressor_rows(const real *q, const real *qd, const real *qdd, real *const *Y_row)
{
    KEEP_ROWS(Y, Y_row);
#include "regressor.inc"
}

#include "lane_states.h"

void two_link_regressor_batch(size_t count, const double *q, const double *qd, const double *qdd, double *Y)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        const size_t first = block * LANES;
        const size_t rows = count - first < LANES ? count - first : LANES;
        real q_block[2 * LANES] ALIGNED;
        real qd_block[2 * LANES] ALIGNED;
        real qdd_block[2 * LANES] ALIGNED;
        fetch_ahead(block, count / LANES, q, 2 * LANES);
        load_rows(2, rows, q + first * 2, q_block);
        fetch_ahead(block, count / LANES, qd, 2 * LANES);
        load_rows(2, rows, qd + first * 2, qd_block);
        fetch_ahead(block, count / LANES, qdd, 2 * LANES);
        load_rows(2, rows, qdd + first * 2, qdd_block);
        real *Y_row[LANES];
        find_rows(8, rows, Y + first * 8, Y_row);
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            regressor_rows(q_block + lane, qd_block + lane, qdd_block + lane, Y_row + lane);
        }
    }
}

void two_link_regressor_batch_soa(size_t count, const double *q, const double *qd, const double *qdd, double *Y)
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
        real *Y_block = Y + block * 8 * LANES;
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            regressor_lanes(q_block + lane, qd_block + lane, qdd_block + lane, Y_block + lane);
        }
    }
}
