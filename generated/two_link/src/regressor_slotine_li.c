/* SPDX-License-Identifier: 0BSD */
/* regressor_slotine_li: regressor Y of adaptive control (Slotine and Li): Y theta_b = M(q) qdd_r + C(q, qd) qd_r + g(q) */
#include "internal.h"
#include "rows.h"

#include "one_state.h"

void two_link_regressor_slotine_li(const double *q, const double *qd, const double *qd_r, const double *qdd_r, double *Y)
{
#include "regressor_slotine_li.inc"
}

#include "lane_states.h"

static void regressor_slotine_li_lanes(const real *q, const real *qd, const real *qd_r, const real *qdd_r, real *Y)
{
#include "regressor_slotine_li.inc"
}

#include "lane_rows.h"

static void regressor_slotine_li_rows(const real *q, const real *qd, const real *qd_r, const real *qdd_r, real *const *Y_row)
{
    KEEP_ROWS(Y, Y_row);
#include "regressor_slotine_li.inc"
}

#include "lane_states.h"

void two_link_regressor_slotine_li_batch(size_t count, const double *q, const double *qd, const double *qd_r, const double *qdd_r, double *Y)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        const size_t first = block * LANES;
        const size_t rows = count - first < LANES ? count - first : LANES;
        real q_block[2 * LANES] ALIGNED;
        real qd_block[2 * LANES] ALIGNED;
        real qd_r_block[2 * LANES] ALIGNED;
        real qdd_r_block[2 * LANES] ALIGNED;
        fetch_ahead(block, count / LANES, q, 2 * LANES);
        load_rows(2, rows, q + first * 2, q_block);
        fetch_ahead(block, count / LANES, qd, 2 * LANES);
        load_rows(2, rows, qd + first * 2, qd_block);
        fetch_ahead(block, count / LANES, qd_r, 2 * LANES);
        load_rows(2, rows, qd_r + first * 2, qd_r_block);
        fetch_ahead(block, count / LANES, qdd_r, 2 * LANES);
        load_rows(2, rows, qdd_r + first * 2, qdd_r_block);
        real *Y_row[LANES];
        find_rows(8, rows, Y + first * 8, Y_row);
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            regressor_slotine_li_rows(q_block + lane, qd_block + lane, qd_r_block + lane, qdd_r_block + lane, Y_row + lane);
        }
    }
}

void two_link_regressor_slotine_li_batch_soa(size_t count, const double *q, const double *qd, const double *qd_r, const double *qdd_r, double *Y)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        fetch_ahead(block, blocks, q, 2 * LANES);
        const real *q_block = q + block * 2 * LANES;
        fetch_ahead(block, blocks, qd, 2 * LANES);
        const real *qd_block = qd + block * 2 * LANES;
        fetch_ahead(block, blocks, qd_r, 2 * LANES);
        const real *qd_r_block = qd_r + block * 2 * LANES;
        fetch_ahead(block, blocks, qdd_r, 2 * LANES);
        const real *qdd_r_block = qdd_r + block * 2 * LANES;
        real *Y_block = Y + block * 8 * LANES;
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            regressor_slotine_li_lanes(q_block + lane, qd_block + lane, qd_r_block + lane, qdd_r_block + lane, Y_block + lane);
        }
    }
}
