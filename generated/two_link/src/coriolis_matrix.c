/* SPDX-License-Identifier: 0BSD */
/* coriolis_matrix: Coriolis matrix C(q, qd), for which dM/dt - 2 C is skew-symmetric */
#include "internal.h"
#include "rows.h"

#include "one_state.h"

void two_link_coriolis_matrix(const double *q, const double *qd, double *C)
{
#include "coriolis_matrix.inc"
}

void two_link_coriolis_matrix_theta(const double *q, const double *qd, const double *theta_b, double *C)
{
#include "coriolis_matrix_theta.inc"
}

#include "lane_states.h"

static void coriolis_matrix_lanes(const real *q, const real *qd, real *C)
{
#include "coriolis_matrix.inc"
}

#include "lane_rows.h"

static void coriolis_matrix_rows(const real *q, const real *qd, real *const *C_row)
{
    KEEP_ROWS(C, C_row);
#include "coriolis_matrix.inc"
}

#include "lane_states.h"

void two_link_coriolis_matrix_batch(size_t count, const double *q, const double *qd, double *C)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        const size_t first = block * LANES;
        const size_t rows = count - first < LANES ? count - first : LANES;
        real q_block[2 * LANES] ALIGNED;
        real qd_block[2 * LANES] ALIGNED;
        fetch_ahead(block, count / LANES, q, 2 * LANES);
        load_rows(2, rows, q + first * 2, q_block);
        fetch_ahead(block, count / LANES, qd, 2 * LANES);
        load_rows(2, rows, qd + first * 2, qd_block);
        real *C_row[LANES];
        find_rows(4, rows, C + first * 4, C_row);
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            coriolis_matrix_rows(q_block + lane, qd_block + lane, C_row + lane);
        }
    }
}

void two_link_coriolis_matrix_batch_soa(size_t count, const double *q, const double *qd, double *C)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        fetch_ahead(block, blocks, q, 2 * LANES);
        const real *q_block = q + block * 2 * LANES;
        fetch_ahead(block, blocks, qd, 2 * LANES);
        const real *qd_block = qd + block * 2 * LANES;
        real *C_block = C + block * 4 * LANES;
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            coriolis_matrix_lanes(q_block + lane, qd_block + lane, C_block + lane);
        }
    }
}

#include "lane_rows.h"

static void coriolis_matrix_theta_rows(const real *q, const real *qd, const real *theta_b, real *const *C_row)
{
    KEEP_ROWS(C, C_row);
#include "coriolis_matrix_theta.inc"
}

#include "lane_states.h"

void two_link_coriolis_matrix_theta_batch(size_t count, const double *q, const double *qd, const double *theta_b, double *C)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        const size_t first = block * LANES;
        const size_t rows = count - first < LANES ? count - first : LANES;
        real q_block[2 * LANES] ALIGNED;
        real qd_block[2 * LANES] ALIGNED;
        fetch_ahead(block, count / LANES, q, 2 * LANES);
        load_rows(2, rows, q + first * 2, q_block);
        fetch_ahead(block, count / LANES, qd, 2 * LANES);
        load_rows(2, rows, qd + first * 2, qd_block);
        real *C_row[LANES];
        find_rows(4, rows, C + first * 4, C_row);
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            coriolis_matrix_theta_rows(q_block + lane, qd_block + lane, theta_b, C_row + lane);
        }
    }
}
