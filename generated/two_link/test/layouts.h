/* SPDX-License-Identifier: 0BSD */
/* Reference states as rows and as blocks of lanes, and places for what the functions give there. */
#include <stddef.h>

#define N 2
#define LANES two_link_LANES
#define COUNT (2 * LANES + 1)     /* states of the largest batch: two whole blocks and one more */
#define BLOCKS 3
#define MOST 12 /* reals of the largest output */
#define UNTOUCHED ((real)-12345)  /* in the output's place before a call, and behind it after */

static real found[(COUNT + 1) * MOST], blocks[(BLOCKS * LANES + 1) * MOST];

/* The reference states over and over: COUNT rows, and BLOCKS blocks of lanes. */
static void repeat(const real (*given)[N], real *rows, real *lanes)
{
    for (size_t state = 0; state < BLOCKS * LANES; state++) {
        for (size_t k = 0; k < N; k++) {
            const real value = given[state % REFERENCE_COUNT][k];
            if (state < COUNT) {
                rows[state * N + k] = value;
            }
            lanes[(state / LANES * N + k) * LANES + state % LANES] = value;
        }
    }
}

static void clear(void)
{
    for (size_t k = 0; k < sizeof found / sizeof *found; k++) {
        found[k] = UNTOUCHED;
    }
    for (size_t k = 0; k < sizeof blocks / sizeof *blocks; k++) {
        blocks[k] = UNTOUCHED;
    }
}

/* Blocks of lanes to rows; what lies behind the last whole block goes behind the last row. */
static inline void to_rows(size_t count, size_t size)
{
    const size_t whole = (count + LANES - 1) / LANES;
    for (size_t k = 0; k < size; k++) {
        for (size_t state = 0; state < count; state++) {
            found[state * size + k] = blocks[(state / LANES * size + k) * LANES + state % LANES];
        }
        found[count * size + k] = blocks[whole * LANES * size + k];
    }
}
