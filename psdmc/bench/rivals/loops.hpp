// The timing loops, one source for every contestant: what is timed differs, how it is timed does not.
//
// A contestant is a callable (q, qd, x, output) on one state, or (count, q, qd, x, output) on many; x is qdd or tau. Where
// its function reads a fourth input, that is y before the output.
#pragma once

#include <time.h>

#include <cstddef>
#include <type_traits>

#if defined(__GNUC__)
#define PSDMC_EXPORT extern "C" __attribute__((visibility("default"), noinline))
#else
#define PSDMC_EXPORT extern "C"
#endif

namespace bench {

constexpr std::size_t LONGEST_INPUT = 256;  // LONGEST_INPUT in psdmc/bench/case.py

/// What a loop runs over; laid out like `Work` in psdmc/bench/contestant.py.
struct Work {
  std::size_t count;    // states
  std::size_t nq;       // length of q
  std::size_t nv;       // length of qd and x
  std::size_t outputs;  // length of one state's output
  std::size_t ring;     // states that the output holds before it starts again
  const double *q;
  const double *qd;
  const double *x;
  double *output;
  std::size_t more;  // length of a fourth input; 0 where there is none
  const double *y;
};

inline double now() {
  timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

/// Outputs count as read: the compiler can drop no call and move none past the clock.
inline void keep() { asm volatile("" ::: "memory"); }

/// The contestant with the inputs that it reads.
template <class Call>
inline void call_one(Call call, const double *q, const double *qd, const double *x, const double *y, double *output) {
  if constexpr (std::is_invocable_v<Call, const double *, const double *, const double *, const double *, double *>)
    call(q, qd, x, y, output);
  else
    call(q, qd, x, output);
}

template <class Call>
inline void call_many(Call call, const Work &w, std::size_t count, std::size_t i) {
  const double *q = w.q + i * w.nq, *qd = w.qd + i * w.nv, *x = w.x + i * w.nv;
  if constexpr (std::is_invocable_v<Call, std::size_t, const double *, const double *, const double *, const double *, double *>)
    call(count, q, qd, x, w.y + i * w.more, w.output);
  else
    call(count, q, qd, x, w.output);
}

/// Seconds of each block of calls, one after the other, none waiting for another.
template <class Call>
inline void throughput(const Work &w, std::size_t nq, std::size_t nv, std::size_t block, double *seconds, Call call) {
  std::size_t slot = 0;
  for (std::size_t b = 0; b < w.count / block; ++b) {
    const double start = now();
    for (std::size_t i = b * block; i < (b + 1) * block; ++i) {
      call_one(call, w.q + i * nq, w.qd + i * nv, w.x + i * nv, w.y + i * w.more, w.output + slot * w.outputs);
      keep();
      slot = slot + 1 == w.ring ? 0 : slot + 1;
    }
    seconds[b] = now() - start;
  }
}

/// The same; two bodies, because where q is as long as its rates the loop takes two instructions less.
template <class Call>
void throughput(const Work &w, std::size_t block, double *seconds, Call call) {
  if (w.nq == w.nv)
    throughput(w, w.nv, w.nv, block, seconds, call);
  else
    throughput(w, w.nq, w.nv, block, seconds, call);
}

/// The same where each call's inputs wait for the last call's output, as in a simulation.
template <class Call>
void latency(const Work &w, std::size_t block, double *seconds, Call call) {
  double q[LONGEST_INPUT], qd[LONGEST_INPUT], x[LONGEST_INPUT];
  for (std::size_t j = 0; j < w.outputs; ++j) w.output[j] = 0.0;
  for (std::size_t b = 0; b < w.count / block; ++b) {
    const double start = now();
    for (std::size_t i = b * block; i < (b + 1) * block; ++i) {
      for (std::size_t j = 0; j < w.nq; ++j) {
        // Too small to change a digit, too real to be optimised away.
        const double wait = 1e-200 * w.output[j < w.outputs ? j : 0];
        q[j] = w.q[i * w.nq + j] + wait;
        if (j >= w.nv) continue;
        qd[j] = w.qd[i * w.nv + j] + wait;
        x[j] = w.x[i * w.nv + j] + wait;
      }
      call_one(call, q, qd, x, w.y + i * w.more, w.output);
      keep();
    }
    seconds[b] = now() - start;
  }
}

/// Nothing that ran before is in a cache: memory of twice their size is read, a cache line at a time, and more machine code
/// than the first cache of instructions holds is run.
__attribute__((noinline)) inline void sweep(const double *memory, std::size_t reals) {
  double sum = 0.0;
  for (std::size_t i = 0; i < reals; i += 8) sum += memory[i];
  asm volatile("" : : "g"(&sum) : "memory");
  asm volatile(".rept 131072\n nop\n .endr");
}

/// Seconds of single calls, each after a sweep. The clock has been read just before, so that it costs what it does warm.
template <class Call>
void cold(const Work &w, std::size_t calls, const double *memory, std::size_t reals, double *seconds, Call call) {
  for (std::size_t i = 0; i < calls; ++i) {
    sweep(memory, reals);
    now();
    keep();
    const double start = now();
    call_one(call, w.q + i * w.nq, w.qd + i * w.nv, w.x + i * w.nv, w.y + i * w.more, w.output);
    keep();
    seconds[i] = now() - start;
  }
}

/// Seconds of each call that takes a whole block of states.
template <class Call>
void batch(const Work &w, std::size_t block, double *seconds, Call call) {
  for (std::size_t b = 0; b < w.count / block; ++b) {
    const std::size_t i = b * block;
    const double start = now();
    call_many(call, w, block, i);
    keep();
    seconds[b] = now() - start;
  }
}

}  // namespace bench

#define PSDMC_CONTESTANT(symbol, ...)                                                              \
  PSDMC_EXPORT void symbol##_throughput(const bench::Work *w, std::size_t block, double *seconds) { \
    bench::throughput(*w, block, seconds, __VA_ARGS__);                                            \
  }                                                                                                \
  PSDMC_EXPORT void symbol##_latency(const bench::Work *w, std::size_t block, double *seconds) {   \
    bench::latency(*w, block, seconds, __VA_ARGS__);                                               \
  }                                                                                                \
  PSDMC_EXPORT void symbol##_cold(const bench::Work *w, std::size_t calls, const double *memory, std::size_t reals, \
                                  double *seconds) {                                               \
    bench::cold(*w, calls, memory, reals, seconds, __VA_ARGS__);                                   \
  }

#define PSDMC_BATCH_CONTESTANT(symbol, ...)                                                        \
  PSDMC_EXPORT void symbol##_throughput(const bench::Work *w, std::size_t block, double *seconds) { \
    bench::batch(*w, block, seconds, __VA_ARGS__);                                                 \
  }

/// What reading the clock costs: an empty block.
PSDMC_EXPORT void clock_cost(std::size_t count, double *seconds) {
  for (std::size_t b = 0; b < count; ++b) {
    const double start = bench::now();
    bench::keep();
    seconds[b] = bench::now() - start;
  }
}
