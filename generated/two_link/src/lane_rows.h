/* SPDX-License-Identifier: 0BSD */
/* Bodies included after this header compute WIDTH states, one per vector lane, and write each state's output into a
   row of its own: their output is an array of WIDTH pointers. No include guard: lane_states.h undoes it. */
#include "groups.h"

#undef STORE
#undef STORE_GROUP

#define STORE(vector, index, value) ((void)0)
#define STORE_GROUP(vector, index, ...) \
    do { \
        lanes group[4] = {__VA_ARGS__}; \
        store_group(group, index, vector); \
    } while (0)
