/* SPDX-License-Identifier: 0BSD */
/* jacobian: linear then angular velocity of the tip per unit joint rate, base frame */
#include "internal.h"
#include "rows.h"

#include "one_state.h"

void two_link_jacobian(const double *q, double *J)
{
#include "jacobian.inc"
}

#include "lane_states.h"

static void jacobian_lanes(const real *q, real *J)
{
#include "jacobian.inc"
}

#include "lane_rows.h"

static void jacobian_rows(const real *q, real *const *J_row)
{
    KEEP_ROWS(J, J_row);
#include "jacobian.inc"
}

#include "lane_states.h"

void two_link_jacobian_batch(size_t count, const double *q, double *J)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        const size_t first = block * LANES;
        const size_t rows = count - first < LANES ? count - first : LANES;
        real q_block[2 * LANES] ALIGNED;
        fetch_ahead(block, count / LANES, q, 2 * LANES);
        load_rows(2, rows, q + first * 2, q_block);
        real *J_row[LANES];
        find_rows(12, rows, J + first * 12, J_row);
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            jacobian_rows(q_block + lane, J_row + lane);
        }
    }
}

void two_link_jacobian_batch_soa(size_t count, const double *q, double *J)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        fetch_ahead(block, blocks, q, 2 * LANES);
        const real *q_block = q + block * 2 * LANES;
        real *J_block = J + block * 12 * LANES;
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            jacobian_lanes(q_block + lane, J_block + lane);
        }
    }
}
