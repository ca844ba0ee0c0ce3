// CasADi's generated C with one state per SIMD lane: its number becomes a vector, its sin and cos glibc's vector ones.
#pragma once

#include <math.h>  // before the generated C includes it inside a namespace

#if defined(__AVX512F__)
#define PSDMC_LANES 8
#define PSDMC_VECTOR_FUNCTION(name) _ZGVeN8v_##name
#elif defined(__AVX2__)
#define PSDMC_LANES 4
#define PSDMC_VECTOR_FUNCTION(name) _ZGVdN4v_##name
#else
#define PSDMC_LANES 2
#define PSDMC_VECTOR_FUNCTION(name) _ZGVbN2v_##name
#endif

typedef double Vector __attribute__((vector_size(8 * PSDMC_LANES)));

extern "C" Vector PSDMC_VECTOR_FUNCTION(sin)(Vector);
extern "C" Vector PSDMC_VECTOR_FUNCTION(cos)(Vector);

/// As many doubles as a register holds, loaded from anywhere.
struct Lanes {
  typedef double Loose __attribute__((vector_size(8 * PSDMC_LANES), aligned(8)));
  Loose v;

  Lanes() = default;
  Lanes(Vector values) : v(values) {}
  Lanes(double value) : v(Vector{} + value) {}

  Lanes &operator+=(Lanes b) { return v += b.v, *this; }
  Lanes &operator-=(Lanes b) { return v -= b.v, *this; }
  Lanes &operator*=(Lanes b) { return v *= b.v, *this; }
  Lanes &operator/=(Lanes b) { return v /= b.v, *this; }
};

inline Lanes operator+(Lanes a, Lanes b) { return a.v + b.v; }
inline Lanes operator-(Lanes a, Lanes b) { return a.v - b.v; }
inline Lanes operator*(Lanes a, Lanes b) { return a.v * b.v; }
inline Lanes operator/(Lanes a, Lanes b) { return a.v / b.v; }
inline Lanes operator-(Lanes a) { return -a.v; }
inline Lanes sqrt(Lanes a) {
  for (int k = 0; k < PSDMC_LANES; ++k) a.v[k] = __builtin_sqrt(a.v[k]);
  return a;
}
inline Lanes sin(Lanes a) { return PSDMC_VECTOR_FUNCTION(sin)(a.v); }
inline Lanes cos(Lanes a) { return PSDMC_VECTOR_FUNCTION(cos)(a.v); }

#define casadi_real Lanes
