/* SPDX-License-Identifier: 0BSD */
/* Sines and cosines of several angles at once, one angle per vector lane. */
#ifndef two_link_SINCOS_H
#define two_link_SINCOS_H

#include <math.h>

/* TWO_LINK_TRIG_KEEP_*(v): the compiler may not look through v, so that -ffast-math cannot undo what rounding is for.
   Free where v fits a register; elsewhere through memory, and only in fast-math modes. */
#if defined(__GNUC__)
#define TWO_LINK_TRIG_INLINE static inline __attribute__((always_inline))
#define TWO_LINK_TRIG_RARE static __attribute__((noinline, cold))
#define TWO_LINK_TRIG_UNLIKELY(condition) __builtin_expect((condition), 0)
#if defined(__FAST_MATH__) || defined(__ASSOCIATIVE_MATH__)
#define TWO_LINK_TRIG_KEEP_WIDE(v) __asm__("" : "+m"(v))
#else
#define TWO_LINK_TRIG_KEEP_WIDE(v) ((void)0)
#endif
#if defined(__SSE2_MATH__)
#define TWO_LINK_TRIG_KEEP_16(v) __asm__("" : "+v"(v))
#elif defined(__aarch64__)
#define TWO_LINK_TRIG_KEEP_16(v) __asm__("" : "+w"(v))
#else
#define TWO_LINK_TRIG_KEEP_16(v) TWO_LINK_TRIG_KEEP_WIDE(v)
#endif
#if defined(__AVX__)
#define TWO_LINK_TRIG_KEEP_32(v) __asm__("" : "+v"(v))
#else
#define TWO_LINK_TRIG_KEEP_32(v) TWO_LINK_TRIG_KEEP_WIDE(v)
#endif
#if defined(__AVX512F__)
#define TWO_LINK_TRIG_KEEP_64(v) __asm__("" : "+v"(v))
#else
#define TWO_LINK_TRIG_KEEP_64(v) TWO_LINK_TRIG_KEEP_WIDE(v)
#endif
#define TWO_LINK_TRIG_KEEP_SCALAR(v) TWO_LINK_TRIG_KEEP_16(v)
#else
#define TWO_LINK_TRIG_INLINE static inline
#define TWO_LINK_TRIG_RARE static
#define TWO_LINK_TRIG_UNLIKELY(condition) (condition)
#define TWO_LINK_TRIG_KEEP_SCALAR(v) do { volatile double kept_ = (v); (v) = kept_; } while (0)
#endif

#if WIDTH > 1 && (WIDTH == 8 || ANGLE_WIDTH == 8)
typedef double two_link_f64x8 __attribute__((vector_size(64)));
typedef long long two_link_i64x8 __attribute__((vector_size(64)));

/* Lanes beyond 100000.0 rad, infinities and NaN, through libm. */
TWO_LINK_TRIG_RARE void two_link_sincos_far_f64x8(const two_link_f64x8 *x, two_link_f64x8 *s, two_link_f64x8 *c)
{
    for (int lane = 0; lane < 8; ++lane) {
        const double angle = (*x)[lane];
        if (angle >= -100000.0 && angle <= 100000.0)
            continue;
        (*s)[lane] = sin(angle);
        (*c)[lane] = cos(angle);
    }
}

/* Whether any lane's sign bit is set. */
TWO_LINK_TRIG_INLINE int two_link_any_sign_f64x8(const two_link_i64x8 *bits)
{
#if defined(__AVX512DQ__)
    return __builtin_ia32_cvtq2mask512((two_link_i64x8)*bits) != 0;
#else
    return ((*bits)[0] | (*bits)[1] | (*bits)[2] | (*bits)[3] | (*bits)[4] | (*bits)[5] | (*bits)[6] | (*bits)[7]) < 0;
#endif
}

/* Sine and cosine, error below 1 ulp for |x| <= 100000.0 rad; beyond, the sign bit of far. Needs round-to-nearest. */
TWO_LINK_TRIG_INLINE void two_link_sincos_near_f64x8(const two_link_f64x8 *x_in, two_link_f64x8 *s, two_link_f64x8 *c, two_link_i64x8 *far)
{
    const two_link_f64x8 x = *x_in;
    /* 0x1.8p+52 is so large that its last bit is worth 1: adding it rounds, and leaves k in the low bits. */
    two_link_f64x8 rounded = x * 0x1.45f306dc9c883p-1 + 0x1.8p+52;
    TWO_LINK_TRIG_KEEP_64(rounded);
    const two_link_f64x8 k = rounded - 0x1.8p+52;
    const two_link_i64x8 index = (two_link_i64x8)rounded;
    /* Sign bit set where |x| is too large, infinite or not a number; in integers, which no fast-math mode touches. */
    const two_link_i64x8 beyond = (two_link_i64x8)(two_link_f64x8){100000.0, 100000.0, 100000.0, 100000.0, 100000.0, 100000.0, 100000.0, 100000.0} - ((two_link_i64x8)x & ~(two_link_i64x8)(two_link_f64x8){-0.0, -0.0, -0.0, -0.0, -0.0, -0.0, -0.0, -0.0});
    *far = beyond;

    /* r - low = x - k pi/2. Each k * part is exact, so that fused and separate multiplication agree;
       r0 - r1 is exact, and what r1 - r2 (...) rounds away is kept in low. */
    two_link_f64x8 r1 = x - k * 0x1.921fb5444p+0;
    TWO_LINK_TRIG_KEEP_64(r1);
    two_link_f64x8 turn2 = k * 0x1.68c234c4cp-39;
    TWO_LINK_TRIG_KEEP_64(turn2);
    two_link_f64x8 r2 = r1 - turn2;
    TWO_LINK_TRIG_KEEP_64(r2);
    two_link_f64x8 lost2 = r1 - r2;
    TWO_LINK_TRIG_KEEP_64(lost2);
    lost2 = lost2 - turn2;
    TWO_LINK_TRIG_KEEP_64(lost2);
    two_link_f64x8 low = k * 0x1.98a2e03707345p-77 - (lost2);
    const two_link_f64x8 r = r2;
    const two_link_f64x8 z = r * r;
    const two_link_f64x8 z2 = z * z;

    /* cos(r - low) = (1 - z/2) + (what that rounds away + r low + z^2 Q(z)) */
    two_link_f64x8 half_z = 0.5 * z;
    TWO_LINK_TRIG_KEEP_64(half_z);
    two_link_f64x8 head = 1.0 - half_z;
    TWO_LINK_TRIG_KEEP_64(head);
    two_link_f64x8 rest = 1.0 - head;
    TWO_LINK_TRIG_KEEP_64(rest);
    rest = rest - half_z;
    TWO_LINK_TRIG_KEEP_64(rest);
    two_link_f64x8 turned = r * low;
    TWO_LINK_TRIG_KEEP_64(turned);
    two_link_f64x8 cosine = z2 * (((0x1.555555555554bp-5 + z * -0x1.6c16c16c15005p-10) + z2 * ((0x1.a01a019c8c7ebp-16 + z * -0x1.27e4f7ef0fb2cp-22) + z2 * (0x1.1ee9d9c92ad75p-29 + z * -0x1.8fa5556f03cf5p-37)))) + (rest + turned);
    TWO_LINK_TRIG_KEEP_64(cosine);
    cosine = head + cosine;

    /* sin(r - low) = r - (r^3 P(z) + low cos r), where 1 - z/2 will do for cos r */
    two_link_f64x8 sine = (r * z) * (((0x1.5555555555548p-3 + z * -0x1.111111110f75p-7) + z2 * ((0x1.a01a019bef683p-13 + z * -0x1.71de355bf0914p-19) + z2 * (0x1.ae5e5196ad133p-26 + z * -0x1.5d8d45baae607p-33)))) + low * head;
    TWO_LINK_TRIG_KEEP_64(sine);
    sine = r - sine;

    /* Odd k swaps the two; bit 1 of k is the sine's sign, bit 1 xor bit 0 the cosine's. */
    const two_link_i64x8 sine_bits = (two_link_i64x8)(sine);
    const two_link_i64x8 cosine_bits = (two_link_i64x8)(cosine);
    const two_link_i64x8 swap = (sine_bits ^ cosine_bits) & ((index << 63) >> 63);
    const two_link_i64x8 sine_sign = (index << 62) & (two_link_i64x8)(two_link_f64x8){-0.0, -0.0, -0.0, -0.0, -0.0, -0.0, -0.0, -0.0};
    const two_link_i64x8 cosine_sign = ((index << 62) ^ (index << 63)) & (two_link_i64x8)(two_link_f64x8){-0.0, -0.0, -0.0, -0.0, -0.0, -0.0, -0.0, -0.0};
    sine = (two_link_f64x8)((sine_bits ^ sine_sign) ^ swap);
    cosine = (two_link_f64x8)((cosine_bits ^ cosine_sign) ^ swap);
    *s = sine;
    *c = cosine;
}

/* Sine and cosine, error below 1 ulp for |x| <= 100000.0 rad; beyond, libm's sine and cosine. Needs round-to-nearest. */
TWO_LINK_TRIG_INLINE void two_link_sincos_f64x8(const two_link_f64x8 *x, two_link_f64x8 *s, two_link_f64x8 *c)
{
    two_link_i64x8 beyond;
    two_link_f64x8 sine, cosine;
    two_link_sincos_near_f64x8(x, &sine, &cosine, &beyond);
    if (TWO_LINK_TRIG_UNLIKELY(two_link_any_sign_f64x8(&beyond))) {
        const two_link_f64x8 far_x = *x;
        two_link_f64x8 far_sine = sine;
        two_link_f64x8 far_cosine = cosine;
        two_link_sincos_far_f64x8(&far_x, &far_sine, &far_cosine);
        sine = far_sine;
        cosine = far_cosine;
    }
    *s = sine;
    *c = cosine;
}
#endif
#if WIDTH > 1 && WIDTH == 8
#define lanes_near two_link_sincos_near_f64x8
#define lanes_far two_link_sincos_far_f64x8
#define lanes_any_far two_link_any_sign_f64x8
#endif
#if WIDTH > 1 && ANGLE_WIDTH == 8
#define angles_near two_link_sincos_near_f64x8
#define angles_far two_link_sincos_far_f64x8
#define angles_any_far two_link_any_sign_f64x8
#endif

#if WIDTH > 1 && (WIDTH == 4 || ANGLE_WIDTH == 4)
typedef double two_link_f64x4 __attribute__((vector_size(32)));
typedef long long two_link_i64x4 __attribute__((vector_size(32)));

/* Lanes beyond 100000.0 rad, infinities and NaN, through libm. */
TWO_LINK_TRIG_RARE void two_link_sincos_far_f64x4(const two_link_f64x4 *x, two_link_f64x4 *s, two_link_f64x4 *c)
{
    for (int lane = 0; lane < 4; ++lane) {
        const double angle = (*x)[lane];
        if (angle >= -100000.0 && angle <= 100000.0)
            continue;
        (*s)[lane] = sin(angle);
        (*c)[lane] = cos(angle);
    }
}

/* Whether any lane's sign bit is set. */
TWO_LINK_TRIG_INLINE int two_link_any_sign_f64x4(const two_link_i64x4 *bits)
{
#if defined(__AVX__)
    return __builtin_ia32_movmskpd256((two_link_f64x4)*bits) != 0;
#else
    return ((*bits)[0] | (*bits)[1] | (*bits)[2] | (*bits)[3]) < 0;
#endif
}

/* Sine and cosine, error below 1 ulp for |x| <= 100000.0 rad; beyond, the sign bit of far. Needs round-to-nearest. */
TWO_LINK_TRIG_INLINE void two_link_sincos_near_f64x4(const two_link_f64x4 *x_in, two_link_f64x4 *s, two_link_f64x4 *c, two_link_i64x4 *far)
{
    const two_link_f64x4 x = *x_in;
    /* 0x1.8p+52 is so large that its last bit is worth 1: adding it rounds, and leaves k in the low bits. */
    two_link_f64x4 rounded = x * 0x1.45f306dc9c883p-1 + 0x1.8p+52;
    TWO_LINK_TRIG_KEEP_32(rounded);
    const two_link_f64x4 k = rounded - 0x1.8p+52;
    const two_link_i64x4 index = (two_link_i64x4)rounded;
    /* Sign bit set where |x| is too large, infinite or not a number; in integers, which no fast-math mode touches. */
    const two_link_i64x4 beyond = (two_link_i64x4)(two_link_f64x4){100000.0, 100000.0, 100000.0, 100000.0} - ((two_link_i64x4)x & ~(two_link_i64x4)(two_link_f64x4){-0.0, -0.0, -0.0, -0.0});
    *far = beyond;

    /* r - low = x - k pi/2. Each k * part is exact, so that fused and separate multiplication agree;
       r0 - r1 is exact, and what r1 - r2 (...) rounds away is kept in low. */
    two_link_f64x4 r1 = x - k * 0x1.921fb5444p+0;
    TWO_LINK_TRIG_KEEP_32(r1);
    two_link_f64x4 turn2 = k * 0x1.68c234c4cp-39;
    TWO_LINK_TRIG_KEEP_32(turn2);
    two_link_f64x4 r2 = r1 - turn2;
    TWO_LINK_TRIG_KEEP_32(r2);
    two_link_f64x4 lost2 = r1 - r2;
    TWO_LINK_TRIG_KEEP_32(lost2);
    lost2 = lost2 - turn2;
    TWO_LINK_TRIG_KEEP_32(lost2);
    two_link_f64x4 low = k * 0x1.98a2e03707345p-77 - (lost2);
    const two_link_f64x4 r = r2;
    const two_link_f64x4 z = r * r;
    const two_link_f64x4 z2 = z * z;

    /* cos(r - low) = (1 - z/2) + (what that rounds away + r low + z^2 Q(z)) */
    two_link_f64x4 half_z = 0.5 * z;
    TWO_LINK_TRIG_KEEP_32(half_z);
    two_link_f64x4 head = 1.0 - half_z;
    TWO_LINK_TRIG_KEEP_32(head);
    two_link_f64x4 rest = 1.0 - head;
    TWO_LINK_TRIG_KEEP_32(rest);
    rest = rest - half_z;
    TWO_LINK_TRIG_KEEP_32(rest);
    two_link_f64x4 turned = r * low;
    TWO_LINK_TRIG_KEEP_32(turned);
    two_link_f64x4 cosine = z2 * (((0x1.555555555554bp-5 + z * -0x1.6c16c16c15005p-10) + z2 * ((0x1.a01a019c8c7ebp-16 + z * -0x1.27e4f7ef0fb2cp-22) + z2 * (0x1.1ee9d9c92ad75p-29 + z * -0x1.8fa5556f03cf5p-37)))) + (rest + turned);
    TWO_LINK_TRIG_KEEP_32(cosine);
    cosine = head + cosine;

    /* sin(r - low) = r - (r^3 P(z) + low cos r), where 1 - z/2 will do for cos r */
    two_link_f64x4 sine = (r * z) * (((0x1.5555555555548p-3 + z * -0x1.111111110f75p-7) + z2 * ((0x1.a01a019bef683p-13 + z * -0x1.71de355bf0914p-19) + z2 * (0x1.ae5e5196ad133p-26 + z * -0x1.5d8d45baae607p-33)))) + low * head;
    TWO_LINK_TRIG_KEEP_32(sine);
    sine = r - sine;

    /* Odd k swaps the two; bit 1 of k is the sine's sign, bit 1 xor bit 0 the cosine's. */
    const two_link_i64x4 sine_bits = (two_link_i64x4)(sine);
    const two_link_i64x4 cosine_bits = (two_link_i64x4)(cosine);
    const two_link_i64x4 swap = (sine_bits ^ cosine_bits) & ((index << 63) >> 63);
    const two_link_i64x4 sine_sign = (index << 62) & (two_link_i64x4)(two_link_f64x4){-0.0, -0.0, -0.0, -0.0};
    const two_link_i64x4 cosine_sign = ((index << 62) ^ (index << 63)) & (two_link_i64x4)(two_link_f64x4){-0.0, -0.0, -0.0, -0.0};
    sine = (two_link_f64x4)((sine_bits ^ sine_sign) ^ swap);
    cosine = (two_link_f64x4)((cosine_bits ^ cosine_sign) ^ swap);
    *s = sine;
    *c = cosine;
}

/* Sine and cosine, error below 1 ulp for |x| <= 100000.0 rad; beyond, libm's sine and cosine. Needs round-to-nearest. */
TWO_LINK_TRIG_INLINE void two_link_sincos_f64x4(const two_link_f64x4 *x, two_link_f64x4 *s, two_link_f64x4 *c)
{
    two_link_i64x4 beyond;
    two_link_f64x4 sine, cosine;
    two_link_sincos_near_f64x4(x, &sine, &cosine, &beyond);
    if (TWO_LINK_TRIG_UNLIKELY(two_link_any_sign_f64x4(&beyond))) {
        const two_link_f64x4 far_x = *x;
        two_link_f64x4 far_sine = sine;
        two_link_f64x4 far_cosine = cosine;
        two_link_sincos_far_f64x4(&far_x, &far_sine, &far_cosine);
        sine = far_sine;
        cosine = far_cosine;
    }
    *s = sine;
    *c = cosine;
}
#endif
#if WIDTH > 1 && WIDTH == 4
#define lanes_near two_link_sincos_near_f64x4
#define lanes_far two_link_sincos_far_f64x4
#define lanes_any_far two_link_any_sign_f64x4
#endif
#if WIDTH > 1 && ANGLE_WIDTH == 4
#define angles_near two_link_sincos_near_f64x4
#define angles_far two_link_sincos_far_f64x4
#define angles_any_far two_link_any_sign_f64x4
#endif

#if WIDTH > 1 && (WIDTH == 2 || ANGLE_WIDTH == 2)
typedef double two_link_f64x2 __attribute__((vector_size(16)));
typedef long long two_link_i64x2 __attribute__((vector_size(16)));

/* Lanes beyond 100000.0 rad, infinities and NaN, through libm. */
TWO_LINK_TRIG_RARE void two_link_sincos_far_f64x2(const two_link_f64x2 *x, two_link_f64x2 *s, two_link_f64x2 *c)
{
    for (int lane = 0; lane < 2; ++lane) {
        const double angle = (*x)[lane];
        if (angle >= -100000.0 && angle <= 100000.0)
            continue;
        (*s)[lane] = sin(angle);
        (*c)[lane] = cos(angle);
    }
}

/* Whether any lane's sign bit is set. */
TWO_LINK_TRIG_INLINE int two_link_any_sign_f64x2(const two_link_i64x2 *bits)
{
#if defined(__SSE2__)
    return __builtin_ia32_movmskpd((two_link_f64x2)*bits) != 0;
#else
    return ((*bits)[0] | (*bits)[1]) < 0;
#endif
}

/* Sine and cosine, error below 1 ulp for |x| <= 100000.0 rad; beyond, the sign bit of far. Needs round-to-nearest. */
TWO_LINK_TRIG_INLINE void two_link_sincos_near_f64x2(const two_link_f64x2 *x_in, two_link_f64x2 *s, two_link_f64x2 *c, two_link_i64x2 *far)
{
    const two_link_f64x2 x = *x_in;
    /* 0x1.8p+52 is so large that its last bit is worth 1: adding it rounds, and leaves k in the low bits. */
    two_link_f64x2 rounded = x * 0x1.45f306dc9c883p-1 + 0x1.8p+52;
    TWO_LINK_TRIG_KEEP_16(rounded);
    const two_link_f64x2 k = rounded - 0x1.8p+52;
    const two_link_i64x2 index = (two_link_i64x2)rounded;
    /* Sign bit set where |x| is too large, infinite or not a number; in integers, which no fast-math mode touches. */
    const two_link_i64x2 beyond = (two_link_i64x2)(two_link_f64x2){100000.0, 100000.0} - ((two_link_i64x2)x & ~(two_link_i64x2)(two_link_f64x2){-0.0, -0.0});
    *far = beyond;

    /* r - low = x - k pi/2. Each k * part is exact, so that fused and separate multiplication agree;
       r0 - r1 is exact, and what r1 - r2 (...) rounds away is kept in low. */
    two_link_f64x2 r1 = x - k * 0x1.921fb5444p+0;
    TWO_LINK_TRIG_KEEP_16(r1);
    two_link_f64x2 turn2 = k * 0x1.68c234c4cp-39;
    TWO_LINK_TRIG_KEEP_16(turn2);
    two_link_f64x2 r2 = r1 - turn2;
    TWO_LINK_TRIG_KEEP_16(r2);
    two_link_f64x2 lost2 = r1 - r2;
    TWO_LINK_TRIG_KEEP_16(lost2);
    lost2 = lost2 - turn2;
    TWO_LINK_TRIG_KEEP_16(lost2);
    two_link_f64x2 low = k * 0x1.98a2e03707345p-77 - (lost2);
    const two_link_f64x2 r = r2;
    const two_link_f64x2 z = r * r;
    const two_link_f64x2 z2 = z * z;

    /* cos(r - low) = (1 - z/2) + (what that rounds away + r low + z^2 Q(z)) */
    two_link_f64x2 half_z = 0.5 * z;
    TWO_LINK_TRIG_KEEP_16(half_z);
    two_link_f64x2 head = 1.0 - half_z;
    TWO_LINK_TRIG_KEEP_16(head);
    two_link_f64x2 rest = 1.0 - head;
    TWO_LINK_TRIG_KEEP_16(rest);
    rest = rest - half_z;
    TWO_LINK_TRIG_KEEP_16(rest);
    two_link_f64x2 turned = r * low;
    TWO_LINK_TRIG_KEEP_16(turned);
    two_link_f64x2 cosine = z2 * (((0x1.555555555554bp-5 + z * -0x1.6c16c16c15005p-10) + z2 * ((0x1.a01a019c8c7ebp-16 + z * -0x1.27e4f7ef0fb2cp-22) + z2 * (0x1.1ee9d9c92ad75p-29 + z * -0x1.8fa5556f03cf5p-37)))) + (rest + turned);
    TWO_LINK_TRIG_KEEP_16(cosine);
    cosine = head + cosine;

    /* sin(r - low) = r - (r^3 P(z) + low cos r), where 1 - z/2 will do for cos r */
    two_link_f64x2 sine = (r * z) * (((0x1.5555555555548p-3 + z * -0x1.111111110f75p-7) + z2 * ((0x1.a01a019bef683p-13 + z * -0x1.71de355bf0914p-19) + z2 * (0x1.ae5e5196ad133p-26 + z * -0x1.5d8d45baae607p-33)))) + low * head;
    TWO_LINK_TRIG_KEEP_16(sine);
    sine = r - sine;

    /* Odd k swaps the two; bit 1 of k is the sine's sign, bit 1 xor bit 0 the cosine's. */
    const two_link_i64x2 sine_bits = (two_link_i64x2)(sine);
    const two_link_i64x2 cosine_bits = (two_link_i64x2)(cosine);
    const two_link_i64x2 swap = (sine_bits ^ cosine_bits) & ((index << 63) >> 63);
    const two_link_i64x2 sine_sign = (index << 62) & (two_link_i64x2)(two_link_f64x2){-0.0, -0.0};
    const two_link_i64x2 cosine_sign = ((index << 62) ^ (index << 63)) & (two_link_i64x2)(two_link_f64x2){-0.0, -0.0};
    sine = (two_link_f64x2)((sine_bits ^ sine_sign) ^ swap);
    cosine = (two_link_f64x2)((cosine_bits ^ cosine_sign) ^ swap);
    *s = sine;
    *c = cosine;
}

/* Sine and cosine, error below 1 ulp for |x| <= 100000.0 rad; beyond, libm's sine and cosine. Needs round-to-nearest. */
TWO_LINK_TRIG_INLINE void two_link_sincos_f64x2(const two_link_f64x2 *x, two_link_f64x2 *s, two_link_f64x2 *c)
{
    two_link_i64x2 beyond;
    two_link_f64x2 sine, cosine;
    two_link_sincos_near_f64x2(x, &sine, &cosine, &beyond);
    if (TWO_LINK_TRIG_UNLIKELY(two_link_any_sign_f64x2(&beyond))) {
        const two_link_f64x2 far_x = *x;
        two_link_f64x2 far_sine = sine;
        two_link_f64x2 far_cosine = cosine;
        two_link_sincos_far_f64x2(&far_x, &far_sine, &far_cosine);
        sine = far_sine;
        cosine = far_cosine;
    }
    *s = sine;
    *c = cosine;
}
#endif
#if WIDTH > 1 && WIDTH == 2
#define lanes_near two_link_sincos_near_f64x2
#define lanes_far two_link_sincos_far_f64x2
#define lanes_any_far two_link_any_sign_f64x2
#endif
#if WIDTH > 1 && ANGLE_WIDTH == 2
#define angles_near two_link_sincos_near_f64x2
#define angles_far two_link_sincos_far_f64x2
#define angles_any_far two_link_any_sign_f64x2
#endif

#if WIDTH == 1
TWO_LINK_TRIG_INLINE unsigned long long two_link_bits_of_f64(double value)
{
    union { double value; unsigned long long bits; } both;
    both.value = value;
    return both.bits;
}

TWO_LINK_TRIG_INLINE double two_link_f64_of_bits(unsigned long long bits)
{
    union { double value; unsigned long long bits; } both;
    both.bits = bits;
    return both.value;
}

/* Sine and cosine, error below 1 ulp for |x| <= 100000.0 rad; beyond, libm's sine and cosine. Needs round-to-nearest. */
TWO_LINK_TRIG_INLINE void two_link_sincos_f64(const double *x_in, double *s, double *c)
{
    const double x = *x_in;
    /* 1 where |x| is too large, infinite or not a number; in integers, which no fast-math mode touches. */
    const unsigned long long beyond = (two_link_bits_of_f64(100000.0) - (two_link_bits_of_f64(x) & ~two_link_bits_of_f64(-0.0))) >> 63;
    if (TWO_LINK_TRIG_UNLIKELY(beyond != 0)) {
        *s = sin(x);
        *c = cos(x);
        return;
    }
    const double turns = x * 0x1.45f306dc9c883p-1;
    const long long nearest = (long long)(turns + (turns < 0.0 ? -0.5 : 0.5));
    const double k = (double)nearest;
    const unsigned long long index = (unsigned long long)nearest;

    /* r - low = x - k pi/2. Each k * part is exact, so that fused and separate multiplication agree;
       r0 - r1 is exact, and what r1 - r2 (...) rounds away is kept in low. */
    double r1 = x - k * 0x1.921fb5444p+0;
    TWO_LINK_TRIG_KEEP_SCALAR(r1);
    double turn2 = k * 0x1.68c234c4cp-39;
    TWO_LINK_TRIG_KEEP_SCALAR(turn2);
    double r2 = r1 - turn2;
    TWO_LINK_TRIG_KEEP_SCALAR(r2);
    double lost2 = r1 - r2;
    TWO_LINK_TRIG_KEEP_SCALAR(lost2);
    lost2 = lost2 - turn2;
    TWO_LINK_TRIG_KEEP_SCALAR(lost2);
    double low = k * 0x1.98a2e03707345p-77 - (lost2);
    const double r = r2;
    const double z = r * r;
    const double z2 = z * z;

    /* cos(r - low) = (1 - z/2) + (what that rounds away + r low + z^2 Q(z)) */
    double half_z = 0.5 * z;
    TWO_LINK_TRIG_KEEP_SCALAR(half_z);
    double head = 1.0 - half_z;
    TWO_LINK_TRIG_KEEP_SCALAR(head);
    double rest = 1.0 - head;
    TWO_LINK_TRIG_KEEP_SCALAR(rest);
    rest = rest - half_z;
    TWO_LINK_TRIG_KEEP_SCALAR(rest);
    double turned = r * low;
    TWO_LINK_TRIG_KEEP_SCALAR(turned);
    double cosine = z2 * (((0x1.555555555554bp-5 + z * -0x1.6c16c16c15005p-10) + z2 * ((0x1.a01a019c8c7ebp-16 + z * -0x1.27e4f7ef0fb2cp-22) + z2 * (0x1.1ee9d9c92ad75p-29 + z * -0x1.8fa5556f03cf5p-37)))) + (rest + turned);
    TWO_LINK_TRIG_KEEP_SCALAR(cosine);
    cosine = head + cosine;

    /* sin(r - low) = r - (r^3 P(z) + low cos r), where 1 - z/2 will do for cos r */
    double sine = (r * z) * (((0x1.5555555555548p-3 + z * -0x1.111111110f75p-7) + z2 * ((0x1.a01a019bef683p-13 + z * -0x1.71de355bf0914p-19) + z2 * (0x1.ae5e5196ad133p-26 + z * -0x1.5d8d45baae607p-33)))) + low * head;
    TWO_LINK_TRIG_KEEP_SCALAR(sine);
    sine = r - sine;

    /* Odd k swaps the two; bit 1 of k is the sine's sign, bit 1 xor bit 0 the cosine's. */
    const unsigned long long sine_bits = two_link_bits_of_f64(sine);
    const unsigned long long cosine_bits = two_link_bits_of_f64(cosine);
    const unsigned long long swap = (sine_bits ^ cosine_bits) & (0 - (index & 1));
    const unsigned long long sine_sign = (index << 62) & two_link_bits_of_f64(-0.0);
    const unsigned long long cosine_sign = ((index << 62) ^ (index << 63)) & two_link_bits_of_f64(-0.0);
    sine = two_link_f64_of_bits((sine_bits ^ sine_sign) ^ swap);
    cosine = two_link_f64_of_bits((cosine_bits ^ cosine_sign) ^ swap);
    *s = sine;
    *c = cosine;
}

#define sincos_one_vector two_link_sincos_f64
#endif

#if WIDTH > 1
/* Angles out of reach, one vector at a time. */
TWO_LINK_TRIG_RARE void sincos_lanes_far(int count, const lanes *angle, lanes *sine, lanes *cosine)
{
    for (int k = 0; k < count; k++) {
        lanes_far(&angle[k], &sine[k], &cosine[k]);
    }
}

/* Without a branch between the vectors, so that one fills the waiting of another. */
TWO_LINK_TRIG_INLINE void sincos_lanes(int count, const lanes *angle, lanes *sine, lanes *cosine)
{
    lane_bits any = {0};
    UNROLL
    for (int k = 0; k < count; k++) {
        lane_bits far;
        lanes_near(&angle[k], &sine[k], &cosine[k], &far);
        any |= far;
    }
    if (TWO_LINK_TRIG_UNLIKELY(lanes_any_far(&any))) {
        sincos_lanes_far(count, angle, sine, cosine);
    }
}

#if ANGLE_WIDTH == WIDTH
#define sincos_angles sincos_lanes
#else
/* Angles out of reach, one vector at a time. */
TWO_LINK_TRIG_RARE void sincos_angles_far(int count, const angles *angle, angles *sine, angles *cosine)
{
    for (int k = 0; k < count; k++) {
        angles_far(&angle[k], &sine[k], &cosine[k]);
    }
}

/* Without a branch between the vectors, so that one fills the waiting of another. */
TWO_LINK_TRIG_INLINE void sincos_angles(int count, const angles *angle, angles *sine, angles *cosine)
{
    angle_bits any = {0};
    UNROLL
    for (int k = 0; k < count; k++) {
        angle_bits far;
        angles_near(&angle[k], &sine[k], &cosine[k], &far);
        any |= far;
    }
    if (TWO_LINK_TRIG_UNLIKELY(angles_any_far(&any))) {
        sincos_angles_far(count, angle, sine, cosine);
    }
}
#endif

TWO_LINK_TRIG_INLINE void sincos_reals(int count, const real *angle, real *sine, real *cosine)
{
    enum { VECTORS = 4, TOGETHER = VECTORS * ANGLE_WIDTH };
    UNROLL
    for (int first = 0; first < count; first += TOGETHER) {
        const int used = count - first < TOGETHER ? count - first : TOGETHER;
        angles x[VECTORS], s[VECTORS], c[VECTORS];
        UNROLL
        for (int k = 0; k < used; k += ANGLE_WIDTH) {
            x[k / ANGLE_WIDTH] = (angles)ANGLES_FROM(used - k, angle + first + k);
        }
        sincos_angles((used + ANGLE_WIDTH - 1) / ANGLE_WIDTH, x, s, c);
        UNROLL
        for (int k = 0; k < used; k++) {
            sine[first + k] = s[k / ANGLE_WIDTH][k % ANGLE_WIDTH];
            cosine[first + k] = c[k / ANGLE_WIDTH][k % ANGLE_WIDTH];
        }
    }
}
#else
static inline void sincos_lanes(int count, const lanes *angle, lanes *sine, lanes *cosine)
{
    for (int k = 0; k < count; k++) {
        sincos_one_vector(&angle[k], &sine[k], &cosine[k]);
    }
}

#define sincos_reals sincos_lanes
#endif

#endif
