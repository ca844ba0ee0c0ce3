/* SPDX-License-Identifier: 0BSD */
/* Bodies included after this header compute one state. No include guard: lane_states.h redefines the same names. */
#include "internal.h"

#undef V
#undef LOAD
#undef STORE
#undef STORE_GROUP
#undef SPLAT
#undef SINCOS

#define V real
#define LOAD(vector, index) ((vector)[index])
#define STORE(vector, index, value) ((vector)[index] = (value))
#define STORE_GROUP(vector, index, ...) ((void)0)
#define SPLAT(value) (value)
#define SINCOS(count, angle, sine, cosine) sincos_reals(count, angle, sine, cosine)
