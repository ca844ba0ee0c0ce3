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

#include "sincos.h"

#endif
