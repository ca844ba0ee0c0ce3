/* SPDX-License-Identifier: 0BSD */
/* Private to the sources of two_link: real numbers, vectors of them, sines and cosines. */
#ifndef two_link_INTERNAL_H
#define two_link_INTERNAL_H

#include <math.h>
#include <stddef.h>

#include "two_link/two_link.h"

#define LANES two_link_LANES

typedef double real;

#include "vectors.h"

#if defined(two_link_OPENMP) && defined(_OPENMP)
#define PRAGMA(text) _Pragma(#text)
#define PARALLEL_FOR PRAGMA(omp parallel for schedule(static))
#define PARALLEL_FOR_FIRST(failed) PRAGMA(omp parallel for schedule(static) reduction(min : failed))
#else
#define PARALLEL_FOR
#define PARALLEL_FOR_FIRST(failed)
#endif

/* Asks for block + AHEAD of an input, `size` reals a block: batches beyond the cache wait less for memory. */
#define AHEAD 2
static inline void fetch_ahead(size_t block, size_t blocks, const real *vector, size_t size)
{
#if defined(__GNUC__)
    if (block + AHEAD < blocks) {
        const real *next = vector + (block + AHEAD) * size;
        for (size_t k = 0; k < size; k += 64 / sizeof(real)) {
            __builtin_prefetch(next + k);
        }
    }
#else
    (void)block, (void)blocks, (void)vector, (void)size;
#endif
}

#include "sincos.h"

#endif
