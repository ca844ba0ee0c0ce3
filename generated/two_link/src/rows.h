/* SPDX-License-Identifier: 0BSD */
/* Between NumPy rows, [state][variable], and one block of lanes, [variable][LANES]. */
#ifndef two_link_ROWS_H
#define two_link_ROWS_H

#include "internal.h"

#if WIDTH > 1
/* WIDTH rows of n reals into the lanes of a block. A load may reach into the next row, not beyond the last. */
static inline void load_full_rows(size_t n, const real *rows, real *block)
{
    for (size_t column = 0; column < n; column += WIDTH) {
        const size_t used = n - column < WIDTH ? n - column : WIDTH;
        lanes vector[WIDTH];
        UNROLL
        for (size_t row = 0; row < WIDTH; row++) {
            const real *at = rows + row * n + column;
            if (row * n + column + WIDTH <= WIDTH * n) {
                vector[row] = *(const lanes_at *)at;
            } else {
                vector[row] = (lanes)LANES_FROM(used, at);
            }
        }
        transpose(vector);
        UNROLL
        for (size_t k = 0; k < WIDTH; k++) {
            if (k < used) {
                *(lanes_at *)(block + (column + k) * LANES) = vector[k];
            }
        }
    }
}

/* The lanes of a block into WIDTH rows of n reals. A store may spill into the next row's first columns, which are
   written after it: columns go from last to first, rows from first to last. */
static inline void store_full_rows(size_t n, const real *block, real *rows)
{
    for (size_t column = (n - 1) / WIDTH * WIDTH; column < n; column -= WIDTH) {
        const size_t used = n - column < WIDTH ? n - column : WIDTH;
        lanes vector[WIDTH];
        UNROLL
        for (size_t k = 0; k < WIDTH; k++) {
            vector[k] = *(const lanes_at *)(block + (column + (k < used ? k : 0)) * LANES);
        }
        transpose(vector);
        UNROLL
        for (size_t row = 0; row < WIDTH; row++) {
            real *at = rows + row * n + column;
            if (row * n + column + WIDTH <= WIDTH * n) {
                *(lanes_at *)at = vector[row];
            } else {
                for (size_t k = 0; k < used; k++) {
                    at[k] = vector[row][k];
                }
            }
        }
    }
}
#else
static inline void load_full_rows(size_t n, const real *rows, real *block)
{
    for (size_t k = 0; k < n; k++) {
        block[k * LANES] = rows[k];
    }
}

static inline void store_full_rows(size_t n, const real *block, real *rows)
{
    for (size_t k = 0; k < n; k++) {
        rows[k] = block[k * LANES];
    }
}
#endif

/* `count` rows (1 to LANES) of n reals; lanes without a row repeat the last. */
static inline void load_rows(size_t n, size_t count, const real *rows, real *block)
{
    if (count == LANES) {
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            load_full_rows(n, rows + lane * n, block + lane);
        }
        return;
    }
    for (size_t lane = 0; lane < LANES; lane++) {
        const real *row = rows + (lane < count ? lane : count - 1) * n;
        for (size_t k = 0; k < n; k++) {
            block[k * LANES + lane] = row[k];
        }
    }
}

static inline void store_rows(size_t n, size_t count, const real *block, real *rows)
{
    if (count == LANES) {
        for (size_t lane = 0; lane < LANES; lane += WIDTH) {
            store_full_rows(n, block + lane, rows + lane * n);
        }
        return;
    }
    for (size_t lane = 0; lane < count; lane++) {
        for (size_t k = 0; k < n; k++) {
            rows[lane * n + k] = block[k * LANES + lane];
        }
    }
}

#endif
