/* Calls a batch function of a compiled robot, whose number of arrays is known at run time only. */
#ifndef PSDMC_CALLED_ARRAYS_H
#define PSDMC_CALLED_ARRAYS_H
#include <stddef.h>

/* The functions' own pointers are to const or plain reals: all pointers to objects are passed alike on the machines that
   psdmc.compile builds for. */
#define ARRAYS_1 void *
#define ARRAYS_2 ARRAYS_1, void *
#define ARRAYS_3 ARRAYS_2, void *
#define ARRAYS_4 ARRAYS_3, void *
#define ARRAYS_5 ARRAYS_4, void *
#define ARRAYS_6 ARRAYS_5, void *
#define ARRAYS_7 ARRAYS_6, void *
#define ARRAYS_8 ARRAYS_7, void *
#define ARRAYS_9 ARRAYS_8, void *
#define ARRAYS_10 ARRAYS_9, void *
#define ARRAYS_11 ARRAYS_10, void *
#define ARRAYS_12 ARRAYS_11, void *
#define ARRAYS_13 ARRAYS_12, void *
#define ARRAYS_14 ARRAYS_13, void *
#define ARRAYS_15 ARRAYS_14, void *
#define ARRAYS_16 ARRAYS_15, void *
#define ARRAYS_17 ARRAYS_16, void *
#define ARRAYS_18 ARRAYS_17, void *
#define ARRAYS_19 ARRAYS_18, void *
#define ARRAYS_20 ARRAYS_19, void *
#define GIVEN_2 a[0], a[1]
#define GIVEN_3 GIVEN_2, a[2]
#define GIVEN_4 GIVEN_3, a[3]
#define GIVEN_5 GIVEN_4, a[4]
#define GIVEN_6 GIVEN_5, a[5]
#define GIVEN_7 GIVEN_6, a[6]
#define GIVEN_8 GIVEN_7, a[7]
#define GIVEN_9 GIVEN_8, a[8]
#define GIVEN_10 GIVEN_9, a[9]
#define GIVEN_11 GIVEN_10, a[10]
#define GIVEN_12 GIVEN_11, a[11]
#define GIVEN_13 GIVEN_12, a[12]
#define GIVEN_14 GIVEN_13, a[13]
#define GIVEN_15 GIVEN_14, a[14]
#define GIVEN_16 GIVEN_15, a[15]
#define GIVEN_17 GIVEN_16, a[16]
#define GIVEN_18 GIVEN_17, a[17]
#define GIVEN_19 GIVEN_18, a[18]
#define GIVEN_20 GIVEN_19, a[19]
#define CASE(k) \
    case k: \
        if (failures) return ((size_t (*)(size_t, ARRAYS_##k))batch)(count, GIVEN_##k); \
        ((void (*)(size_t, ARRAYS_##k))batch)(count, GIVEN_##k); \
        return 0;

enum { LEAST_CALLED = 2, MOST_CALLED = 20 };    /* arrays of the cases below */

/* Of a function that can fail, 1 + the first state that does; else 0. */
static size_t run(void (*batch)(void), int failures, size_t count, int arrays, void **a)
{
    switch (arrays) {
    CASE(2) CASE(3) CASE(4) CASE(5) CASE(6) CASE(7) CASE(8) CASE(9) CASE(10) CASE(11) CASE(12)
    CASE(13) CASE(14) CASE(15) CASE(16) CASE(17) CASE(18) CASE(19) CASE(20)
    default: return 0;
    }
}

#endif
