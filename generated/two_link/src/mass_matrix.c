/* SPDX-License-Identifier: 0BSD */
/* mass_matrix: mass matrix M(q), both triangles */
#include "internal.h"
#include "rows.h"

#include "one_state.h"

void two_link_mass_matrix(const double *q, double *M)
{
#include "mass_matrix.inc"
}

void two_link_mass_matrix_theta(const double *q, const double *theta_b, double *M)
{
#include "mass_matrix_theta.inc"
}

#include "lane_states.h"

static void mass_matrix_lanes(const real *q, real *M)
{
#include "mass_matrix.inc"
}

#include "lane_rows.h"

static void mass_matrix_rows(const real *q, real *const *M_row)
{
    KEEP_ROWS(M, M_row);
#include "mass_matrix.inc"
}

#include "lane_states.h"

void two_link_mass_matrix_batch(size_t count, const double *q, double *M)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        const size_t first = block * LANES;
        const size_t rows = count - first < LANES ? count - first : LANES;
        real q_block[2 * LANES] ALIGNED;
        fetch_ahead(block, count / LANES, q, 2 * LANES);
        load_rows(2, rows, q + first * 2, q_block);
        real *M_row[LANES];
        find_rows(4, rows, M + first * 4, M_row);
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            mass_matrix_rows(q_block + lane, M_row + lane);
        }
    }
}

void two_link_mass_matrix_batch_soa(size_t count, const double *q, double *M)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        fetch_ahead(block, blocks, q, 2 * LANES);
        const real *q_block = q + block * 2 * LANES;
        real *M_block = M + block * 4 * LANES;
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            mass_matrix_lanes(q_block + lane, M_block + lane);
        }
    }
}

#include "lane_rows.h"

static void mass_matrix_theta_rows(const real *q, const real *theta_b, real *const *M_row)
{
    KEEP_ROWS(M, M_row);
#include "mass_matrix_theta.inc"
}

#include "lane_states.h"

void two_link_mass_matrix_theta_batch(size_t count, const double *q, const double *theta_b, double *M)
{
    const size_t blocks = count / LANES + (count % LANES != 0);
    PARALLEL_FOR
    for (size_t block = 0; block < blocks; block++) {
        const size_t first = block * LANES;
        const size_t rows = count - first < LANES ? count - first : LANES;
        real q_block[2 * LANES] ALIGNED;
        fetch_ahead(block, count / LANES, q, 2 * LANES);
        load_rows(2, rows, q + first * 2, q_block);
        real *M_row[LANES];
        find_rows(4, rows, M + first * 4, M_row);
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            mass_matrix_theta_rows(q_block + lane, theta_b, M_row + lane);
        }
    }
}
