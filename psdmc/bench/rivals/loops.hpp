// The timing loops, one source for every contestant: what is timed differs, how it is timed does not.
//
// A contestant is a callable (q, qd, x, output) on one state, or (count, q, qd, x, output) on many; x is qdd or tau.
#pragma once

#include <time.h>

#include <cstddef>

#if defined(__GNUC__)
#define PSDMC_EXPORT extern "C" __attribute__((visibility("default"), noinline))
#else
#define PSDMC_EXPORT extern "C"
#endif

namespace bench {

constexpr std::size_t LONGEST_INPUT = 64;
constexpr std::size_t BLOCK = 64;

/// What a loop runs over; laid out like `Work` in psdmc/bench/contestant.py.
struct Work {
  std::size_t count;    // states
  std::size_t n;        // joints: length of q, qd and x
  std::size_t outputs;  // length of one state's output
  std::size_t ring;     // states that the output holds before it starts again; of a batch call, its states
  const double *q;
  const double *qd;
  const double *x;
  double *output;
};

inline double now() {
  timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

/// Outputs count as read: the compiler can drop no call and move none past the clock.
inline void keep() { asm volatile("" ::: "memory"); }

/// Seconds for all states, one after the other, none waiting for another.
template <class Call>
double throughput(const Work &w, Call call) {
  std::size_t slot = 0;
  const double start = now();
  for (std::size_t i = 0; i < w.count; ++i) {
    call(w.q + i * w.n, w.qd + i * w.n, w.x + i * w.n, w.output + slot * w.outputs);
    keep();
    slot = slot + 1 == w.ring ? 0 : slot + 1;
  }
  return now() - start;
}

/// Seconds for all states where each call's inputs wait for the last call's output, as in a simulation.
template <class Call>
double latency(const Work &w, Call call) {
  double q[LONGEST_INPUT], qd[LONGEST_INPUT], x[LONGEST_INPUT];
  for (std::size_t j = 0; j < w.outputs; ++j) w.output[j] = 0.0;
  const double start = now();
  for (std::size_t i = 0; i < w.count; ++i) {
    for (std::size_t j = 0; j < w.n; ++j) {
      // Too small to change a digit, too real to be optimised away.
      const double wait = 1e-200 * w.output[j];
      q[j] = w.q[i * w.n + j] + wait;
      qd[j] = w.qd[i * w.n + j] + wait;
      x[j] = w.x[i * w.n + j] + wait;
    }
    call(q, qd, x, w.output);
    keep();
  }
  return now() - start;
}

/// Seconds of each block of 64 calls, clock included.
template <class Call>
double blocks(const Work &w, double *seconds, Call call) {
  std::size_t slot = 0;
  const double start = now();
  for (std::size_t b = 0; b < w.count / BLOCK; ++b) {
    const double begin = now();
    for (std::size_t i = b * BLOCK; i < (b + 1) * BLOCK; ++i) {
      call(w.q + i * w.n, w.qd + i * w.n, w.x + i * w.n, w.output + slot * w.outputs);
      keep();
      slot = slot + 1 == w.ring ? 0 : slot + 1;
    }
    seconds[b] = now() - begin;
  }
  return now() - start;
}

/// Seconds for all states, handed over `ring` at a time.
template <class Call>
double batch_throughput(const Work &w, Call call) {
  const double start = now();
  for (std::size_t i = 0; i + w.ring <= w.count; i += w.ring) {
    call(w.ring, w.q + i * w.n, w.qd + i * w.n, w.x + i * w.n, w.output);
    keep();
  }
  return now() - start;
}

}  // namespace bench

#define PSDMC_CONTESTANT(symbol, call)                                                         \
  PSDMC_EXPORT double symbol##_throughput(const bench::Work *w) { return bench::throughput(*w, call); } \
  PSDMC_EXPORT double symbol##_latency(const bench::Work *w) { return bench::latency(*w, call); }       \
  PSDMC_EXPORT double symbol##_blocks(const bench::Work *w, double *seconds) {                 \
    return bench::blocks(*w, seconds, call);                                                   \
  }

#define PSDMC_BATCH_CONTESTANT(symbol, call) \
  PSDMC_EXPORT double symbol##_throughput(const bench::Work *w) { return bench::batch_throughput(*w, call); }
