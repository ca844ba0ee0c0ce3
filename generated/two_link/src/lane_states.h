/* SPDX-License-Identifier: 0BSD */
/* Bodies included after this header compute WIDTH states, one per vector lane; their pointers point at
   [variable][LANES] blocks. No include guard: one_state.h redefines the same names. */
#include "internal.h"

#undef V
#undef LOAD
#undef STORE
#undef STORE_GROUP
#undef SPLAT
#undef SINCOS

#define V lanes
#define LOAD(vector, index) (*(const lanes_at *)((vector) + (index) * LANES))
#define STORE(vector, index, value) (*(lanes_at *)((vector) + (index) * LANES) = (value))
#define STORE_GROUP(vector, index, ...) ((void)0)
#define SPLAT(value) ((lanes){0} + (value))
#define SINCOS(count, angle, sine, cosine) sincos_lanes(count, angle, sine, cosine)
