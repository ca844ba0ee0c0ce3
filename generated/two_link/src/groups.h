/* SPDX-License-Identifier: 0BSD */
/* Four consecutive outputs, one state per lane, into rows [state][variable]. */
#ifndef two_link_GROUPS_H
#define two_link_GROUPS_H

#include "internal.h"

/* row[k]: the row of lane k. Lanes without a state repeat the last one and share its row. */
static inline void find_rows(size_t n, size_t count, real *rows, real **row)
{
    for (size_t lane = 0; lane < LANES; lane++) {
        row[lane] = rows + (lane < count ? lane : count - 1) * n;
    }
}

/* A copy of the pointers that no store can change: the compiler keeps it in registers. */
#define KEEP_ROWS(copy, row) \
    real *copy[WIDTH]; \
    for (size_t lane = 0; lane < WIDTH; lane++) { \
        copy[lane] = row[lane]; \
    }

#if WIDTH > 1
/* PIECE neighbours in a row: four, or all that a vector has. */
#define PIECE (WIDTH < 4 ? WIDTH : 4)
typedef real piece __attribute__((vector_size(PIECE * sizeof(real)), may_alias));
typedef real piece_at __attribute__((vector_size(PIECE * sizeof(real)), aligned(sizeof(real)), may_alias));

/* Always inline: a call would save and fetch every vector register. */
static inline __attribute__((always_inline)) void store_group(lanes *group, size_t index, real *const *row)
{
    UNROLL
    for (size_t first = 0; first < 4; first += PIECE) {
        transpose_pieces(group + first);
        UNROLL
        for (size_t lane = 0; lane < WIDTH; lane++) {
            *(piece_at *)(row[lane] + index + first) = ((const piece *)&group[first + lane % PIECE])[lane / PIECE];
        }
    }
}
#else
static inline void store_group(const lanes *group, size_t index, real *const *row)
{
    for (size_t k = 0; k < 4; k++) {
        row[0][index + k] = group[k];
    }
}
#endif

#endif
