/* SPDX-License-Identifier: 0BSD */
/* A pivot that is not positive: the accelerations become NaN. */
#ifndef two_link_PIVOTS_H
#define two_link_PIVOTS_H

#include "internal.h"

/* One state: NaN in qdd, and the status to return. */
static inline int fail(real *qdd, int status)
{
    for (int k = 0; k < 2; k++) {
        qdd[k] = (real)NAN;
    }
    return status;
}

/* One block: NaN in every lane with such a pivot. The first of these lanes, LANES where there is none. */
static inline size_t mark_failed(size_t count, const real *pivot, real *qdd)
{
    int bad = 0;
    for (size_t k = 0; k < 2 * LANES; k++) {
        bad |= !(pivot[k] > 0);
    }
    size_t first = LANES;
    for (size_t lane = count; bad && lane-- > 0;) {
        int positive = 1;
        for (size_t k = 0; k < 2; k++) {
            positive &= pivot[k * LANES + lane] > 0;
        }
        if (!positive) {
            first = lane;
            for (size_t k = 0; k < 2; k++) {
                qdd[k * LANES + lane] = (real)NAN;
            }
        }
    }
    return first;
}

#endif
