/* SPDX-License-Identifier: 0BSD */
/* Vectors of reals in GCC's and clang's extension; on other targets a "vector" is one real. */
#ifndef two_link_VECTORS_H
#define two_link_VECTORS_H

/* WIDTH: reals in one vector register of the target; it divides LANES. 1: no vectors, plain C. */
#if !(defined(__GNUC__) && (!defined(__i386__) || defined(__SSE2_MATH__))) || defined(two_link_NO_VECTORS)
#define WIDTH 1
#elif defined(__AVX512F__)
#define WIDTH 8
#elif defined(__AVX__)
#define WIDTH 4
#else
#define WIDTH 2
#endif

/* ANGLE_WIDTH: reals in a vector of one state's angles, narrower where wide ones slow the scalar code around them. */
#if WIDTH == 8 && !(defined(__znver3__) || defined(__znver4__) || defined(__znver5__))
#define ANGLE_WIDTH 4
#else
#define ANGLE_WIDTH WIDTH
#endif

/* lanes: one real per lane. lanes_at: the same at any address of a real. angles: several of one state's.
   LANES_FROM(count, at), ANGLES_FROM: up to as many reals as the vector has, the rest zero, as an initialiser: filled
   one by one, a vector would pass through memory and stall. */
#if WIDTH > 1
typedef real lanes __attribute__((vector_size(WIDTH * sizeof(real))));
typedef real lanes_at __attribute__((vector_size(WIDTH * sizeof(real)), aligned(sizeof(real)), may_alias));
typedef long long lane_bits __attribute__((vector_size(WIDTH * sizeof(real))));
typedef real angles __attribute__((vector_size(ANGLE_WIDTH * sizeof(real))));
typedef long long angle_bits __attribute__((vector_size(ANGLE_WIDTH * sizeof(real))));
#define ALIGNED __attribute__((aligned(64)))
#define UNROLL _Pragma("GCC unroll 16")
#if defined(__clang__) || __GNUC__ >= 12
#define SHUFFLE(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#define SHUFFLE(a, b, ...) __builtin_shuffle(a, b, (lane_bits){__VA_ARGS__})
#endif
#else
typedef real lanes;
typedef real lanes_at;
#define ALIGNED
#define LANES_FROM(count, at) ((at)[0])
#endif

#if WIDTH == 8 || ANGLE_WIDTH == 8
#define FROM_8(count, at) { \
    0 < (count) ? (at)[0] : 0, \
    1 < (count) ? (at)[1] : 0, \
    2 < (count) ? (at)[2] : 0, \
    3 < (count) ? (at)[3] : 0, \
    4 < (count) ? (at)[4] : 0, \
    5 < (count) ? (at)[5] : 0, \
    6 < (count) ? (at)[6] : 0, \
    7 < (count) ? (at)[7] : 0 }
#endif
#if WIDTH == 8
#define LANES_FROM FROM_8
#endif
#if ANGLE_WIDTH == 8
#define ANGLES_FROM FROM_8
#endif

#if WIDTH == 4 || ANGLE_WIDTH == 4
#define FROM_4(count, at) { \
    0 < (count) ? (at)[0] : 0, \
    1 < (count) ? (at)[1] : 0, \
    2 < (count) ? (at)[2] : 0, \
    3 < (count) ? (at)[3] : 0 }
#endif
#if WIDTH == 4
#define LANES_FROM FROM_4
#endif
#if ANGLE_WIDTH == 4
#define ANGLES_FROM FROM_4
#endif

#if WIDTH == 2 || ANGLE_WIDTH == 2
#define FROM_2(count, at) { \
    0 < (count) ? (at)[0] : 0, \
    1 < (count) ? (at)[1] : 0 }
#endif
#if WIDTH == 2
#define LANES_FROM FROM_2
#endif
#if ANGLE_WIDTH == 2
#define ANGLES_FROM FROM_2
#endif

#if WIDTH == 8
/* WIDTH vectors of WIDTH lanes: vector i, lane k becomes vector k, lane i. transpose_pieces: the same in each square
   of 4 vectors and as many neighbouring lanes. */
static inline void transpose(lanes *vector)
{
    UNROLL
    for (int i = 0; i < 8; i++) {
        if (!(i & 1)) {
            const lanes a = vector[i], b = vector[i + 1];
            vector[i] = SHUFFLE(a, b, 0, 8, 2, 10, 4, 12, 6, 14);
            vector[i + 1] = SHUFFLE(a, b, 1, 9, 3, 11, 5, 13, 7, 15);
        }
    }
    UNROLL
    for (int i = 0; i < 8; i++) {
        if (!(i & 2)) {
            const lanes a = vector[i], b = vector[i + 2];
            vector[i] = SHUFFLE(a, b, 0, 1, 8, 9, 4, 5, 12, 13);
            vector[i + 2] = SHUFFLE(a, b, 2, 3, 10, 11, 6, 7, 14, 15);
        }
    }
    UNROLL
    for (int i = 0; i < 8; i++) {
        if (!(i & 4)) {
            const lanes a = vector[i], b = vector[i + 4];
            vector[i] = SHUFFLE(a, b, 0, 1, 2, 3, 8, 9, 10, 11);
            vector[i + 4] = SHUFFLE(a, b, 4, 5, 6, 7, 12, 13, 14, 15);
        }
    }
}

static inline void transpose_pieces(lanes *vector)
{
    UNROLL
    for (int i = 0; i < 4; i++) {
        if (!(i & 1)) {
            const lanes a = vector[i], b = vector[i + 1];
            vector[i] = SHUFFLE(a, b, 0, 8, 2, 10, 4, 12, 6, 14);
            vector[i + 1] = SHUFFLE(a, b, 1, 9, 3, 11, 5, 13, 7, 15);
        }
    }
    UNROLL
    for (int i = 0; i < 4; i++) {
        if (!(i & 2)) {
            const lanes a = vector[i], b = vector[i + 2];
            vector[i] = SHUFFLE(a, b, 0, 1, 8, 9, 4, 5, 12, 13);
            vector[i + 2] = SHUFFLE(a, b, 2, 3, 10, 11, 6, 7, 14, 15);
        }
    }
}
#endif

#if WIDTH == 4
/* WIDTH vectors of WIDTH lanes: vector i, lane k becomes vector k, lane i. transpose_pieces: the same in each square
   of 4 vectors and as many neighbouring lanes. */
static inline void transpose(lanes *vector)
{
    UNROLL
    for (int i = 0; i < 4; i++) {
        if (!(i & 1)) {
            const lanes a = vector[i], b = vector[i + 1];
            vector[i] = SHUFFLE(a, b, 0, 4, 2, 6);
            vector[i + 1] = SHUFFLE(a, b, 1, 5, 3, 7);
        }
    }
    UNROLL
    for (int i = 0; i < 4; i++) {
        if (!(i & 2)) {
            const lanes a = vector[i], b = vector[i + 2];
            vector[i] = SHUFFLE(a, b, 0, 1, 4, 5);
            vector[i + 2] = SHUFFLE(a, b, 2, 3, 6, 7);
        }
    }
}

static inline void transpose_pieces(lanes *vector)
{
    UNROLL
    for (int i = 0; i < 4; i++) {
        if (!(i & 1)) {
            const lanes a = vector[i], b = vector[i + 1];
            vector[i] = SHUFFLE(a, b, 0, 4, 2, 6);
            vector[i + 1] = SHUFFLE(a, b, 1, 5, 3, 7);
        }
    }
    UNROLL
    for (int i = 0; i < 4; i++) {
        if (!(i & 2)) {
            const lanes a = vector[i], b = vector[i + 2];
            vector[i] = SHUFFLE(a, b, 0, 1, 4, 5);
            vector[i + 2] = SHUFFLE(a, b, 2, 3, 6, 7);
        }
    }
}
#endif

#if WIDTH == 2
/* WIDTH vectors of WIDTH lanes: vector i, lane k becomes vector k, lane i. transpose_pieces: the same in each square
   of 2 vectors and as many neighbouring lanes. */
static inline void transpose(lanes *vector)
{
    UNROLL
    for (int i = 0; i < 2; i++) {
        if (!(i & 1)) {
            const lanes a = vector[i], b = vector[i + 1];
            vector[i] = SHUFFLE(a, b, 0, 2);
            vector[i + 1] = SHUFFLE(a, b, 1, 3);
        }
    }
}

static inline void transpose_pieces(lanes *vector)
{
    UNROLL
    for (int i = 0; i < 2; i++) {
        if (!(i & 1)) {
            const lanes a = vector[i], b = vector[i + 1];
            vector[i] = SHUFFLE(a, b, 0, 2);
            vector[i + 1] = SHUFFLE(a, b, 1, 3);
        }
    }
}
#endif

#endif
