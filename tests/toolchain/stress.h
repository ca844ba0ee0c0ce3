/* Calls every function of a package in every layout with values that no controller should send, and compares each
   state's result with the same state's alone. The includer defines real, L, LANES and KERNELS; over all functions, VECTORS
   and OUTPUTS, the most inputs and outputs of one; WIDEST, the longest input; MOST, the longest array of one state.

   -DHEAP     every array is a block of malloc of exactly its size (for address sanitizers and memcheck)
   -DTHREADS  four threads call everything at once on shared inputs (for thread sanitizers)
   else       every array ends, or begins, at a page that faults when it is touched */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define COUNT (2 * LANES + 1)
#define BLOCKS 3
#define ROLES (VECTORS + 1 + OUTPUTS) /* the inputs, theta_b, the outputs */
#define THETA VECTORS
#define OUT (VECTORS + 1)

typedef size_t call_one(const real *const *in, const real *theta, real *const *out);
typedef size_t call_many(size_t count, const real *const *in, const real *theta, real *const *out);

/* Lengths per state of each input and output, and of all outputs together. */
struct kernel {
    const char *name;
    size_t inputs, in_size[VECTORS], outputs, out_size[OUTPUTS], all;
    int takes_theta;
    call_one *one;
    call_many *rows, *lanes;
};

static const struct kernel kernels[] = {KERNELS};

#if defined(THREADS)
#define COUNTER _Thread_local
#else
#define COUNTER
#endif
static COUNTER unsigned long calls = 0, faults = 0;

static const int is_single = sizeof(real) == 4;

/* The state's value of one variable: kinds 0 to 11, so that lanes of a block differ in what is odd about them. */
static real made(size_t state, size_t vector, size_t k)
{
    const double ordinary = sin(1.0 + 3.7 * (double)state + 1.3 * (double)vector + 0.7 * (double)k);
    const double largest = is_single ? FLT_MAX : DBL_MAX, smallest = is_single ? 1e-45 : 5e-324;
    switch ((state * 7 + (state % 5 == 3) * (vector + k)) % 12) {
    case 1: return (real)0.0;
    case 2: return (real)-0.0;
    case 3: return (real)NAN;
    case 4: return (real)INFINITY;
    case 5: return (real)-INFINITY;
    case 6: return (real)(smallest * (double)(1 + k));
    case 7: return (real)(ordinary * largest);
    case 8: return (real)(ordinary * (is_single ? 3e3 : 3e5));
    case 9: return (real)(ordinary * 1e22);
    case 10: return (real)(ordinary * 1e-30);
    default: return (real)ordinary;
    }
}

/* Made once: inlined in two places the same expression may be fused differently, and the inputs differ. */
static real values[BLOCKS * LANES][VECTORS][WIDEST];

static real odd(size_t state, size_t vector, size_t k)
{
    return values[state][vector][k];
}

static void make_values(void)
{
    for (size_t state = 0; state < BLOCKS * LANES; state++) {
        for (size_t vector = 0; vector < VECTORS; vector++) {
            for (size_t k = 0; k < WIDEST; k++) {
                values[state][vector][k] = made(state, vector, k);
            }
        }
    }
}

static real odd_theta(int kind, const real *own, size_t k)
{
    switch (kind) {
    case 1: return (real)0.0;
    case 2: return (real)NAN;
    case 3: return -own[k];
    case 4: return (real)(is_single ? FLT_MAX : DBL_MAX);
    case 5: return (real)(is_single ? 1e-45 : 5e-324);
    default: return own[k];
    }
}

#if defined(HEAP) || defined(THREADS)
static real *place(int role, size_t reals, int at_front)
{
    (void)role, (void)at_front;
    real *array = malloc(reals * sizeof(real) + (reals == 0));
    if (!array) {
        exit(3);
    }
    return array;
}
static void give_back(real *array) { free(array); }
#else
#include <sys/mman.h>
#include <unistd.h>

/* One region per role, with a page that faults on either side. */
static real *place(int role, size_t reals, int at_front)
{
    static char *regions[ROLES];
    const size_t page = (size_t)sysconf(_SC_PAGESIZE);
    const size_t room = (BLOCKS * LANES * (size_t)MOST * sizeof(real) / page + 1) * page;
    if (!regions[role]) {
        char *all = mmap(NULL, room + 2 * page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (all == MAP_FAILED || mprotect(all, page, PROT_NONE) || mprotect(all + page + room, page, PROT_NONE)) {
            exit(3);
        }
        regions[role] = all + page;
    }
    return (real *)(void *)(regions[role] + (at_front ? 0 : room - reals * sizeof(real)));
}
static void give_back(real *array) { (void)array; }
#endif

/* Equal, or both no number: which of several NaNs comes out is the compiler's business. `wanted`: all outputs of the state
   behind each other; `step` from one entry of a found one to the next. */
static void same(const struct kernel *kernel, const char *what, size_t state, real *const *found, size_t step, const real *wanted)
{
    for (size_t output = 0; output < kernel->outputs; wanted += kernel->out_size[output], output++) {
        for (size_t k = 0; k < kernel->out_size[output]; k++) {
            const real a = found[output][k * step], b = wanted[k];
            if (!(a == b || (a != a && b != b))) {
                faults++;
                if (faults < 10) {
                    fprintf(stderr, "%s, %s: state %zu, output %zu, entry %zu: %.17g, alone %.17g\n", kernel->name, what, state,
                            output, k, (double)a, (double)b);
                }
            }
        }
    }
}

/* [state][variable], or blocks of [variable][lane]. */
static void fill_rows(real *rows, size_t count, size_t vector, size_t size)
{
    for (size_t state = 0; state < count; state++) {
        for (size_t k = 0; k < size; k++) {
            rows[state * size + k] = odd(state, vector, k);
        }
    }
}

static void fill_lanes(real *lanes, size_t states, size_t vector, size_t size)
{
    for (size_t state = 0; state < states; state++) {
        for (size_t k = 0; k < size; k++) {
            lanes[(state / LANES * size + k) * LANES + state % LANES] = odd(state, vector, k);
        }
    }
}

/* Outputs behind each other in one block, `count` states of each. */
static void split(const struct kernel *kernel, real *block, size_t count, real **out)
{
    for (size_t output = 0; output < kernel->outputs; output++) {
        out[output] = block;
        block += count * kernel->out_size[output];
    }
}

/* What each state gives alone: as a batch of one row, and as a block of equal lanes. */
static void alone(const struct kernel *kernel, const real *theta, real *by_row, real *by_lane)
{
    for (size_t state = 0; state < BLOCKS * LANES; state++) {
        real rows[VECTORS][WIDEST], lanes[VECTORS][WIDEST * LANES];
        real *block = malloc(kernel->all * LANES * sizeof(real)), *out[OUTPUTS];
        const real *in[VECTORS], *in_lanes[VECTORS];
        for (size_t vector = 0; vector < VECTORS; vector++) {
            for (size_t k = 0; k < WIDEST * LANES; k++) {
                rows[vector][k / LANES] = lanes[vector][k] = odd(state, vector, k / LANES);
            }
            in[vector] = rows[vector], in_lanes[vector] = lanes[vector];
        }
        split(kernel, by_row + state * kernel->all, 1, out);
        kernel->rows(1, in, theta, out), calls++;
        if (kernel->lanes && block) {
            split(kernel, block, LANES, out);
            kernel->lanes(LANES, in_lanes, theta, out), calls++;
            for (size_t k = 0; k < kernel->all; k++) {
                by_lane[state * kernel->all + k] = block[k * LANES];
            }
        }
        free(block);
    }
}

/* One batch by rows or by lanes; the output `over` overwrites the input `shared`, or (VECTORS) none does. */
static void batch(const struct kernel *kernel, const real *theta, const real *wanted, size_t count, int by_lane, size_t shared, size_t over, int at_front)
{
    const size_t states = by_lane ? (count + LANES - 1) / LANES * LANES : count;
    real *in[VECTORS], *out[OUTPUTS], *found[OUTPUTS];
    for (size_t vector = 0; vector < kernel->inputs; vector++) {
        in[vector] = place((int)vector, states * kernel->in_size[vector], at_front);
        (by_lane ? fill_lanes : fill_rows)(in[vector], states, vector, kernel->in_size[vector]);
    }
    for (size_t output = 0; output < kernel->outputs; output++) {
        const int is_shared = shared < VECTORS && output == over;
        out[output] = is_shared ? in[shared] : place(OUT + (int)output, states * kernel->out_size[output], at_front);
    }
    (by_lane ? kernel->lanes : kernel->rows)(count, (const real *const *)in, theta, out), calls++;
    for (size_t state = 0; state < count; state++) {
        for (size_t output = 0; output < kernel->outputs; output++) {
            const size_t size = kernel->out_size[output];
            found[output] = out[output] + (by_lane ? state / LANES * LANES * size + state % LANES : state * size);
        }
        same(kernel, by_lane ? "lanes" : "rows", state, found, by_lane ? LANES : 1, wanted + state * kernel->all);
    }
    for (size_t vector = 0; vector < kernel->inputs; vector++) {
        give_back(in[vector]);
    }
    for (size_t output = 0; output < kernel->outputs; output++) {
        if (shared == VECTORS || output != over) {
            give_back(out[output]);
        }
    }
}

/* One state again, an output over an input, `shift` reals before it. */
static void overlapping(const struct kernel *kernel, const real *theta, size_t state, real *const *in, real *const *out,
                        const real *wanted, size_t vector, size_t output, size_t shift)
{
    const real *given[VECTORS];
    real *written[OUTPUTS], *both = malloc((kernel->out_size[output] + 2 * kernel->in_size[vector]) * sizeof(real));
    for (size_t other = 0; other < kernel->inputs; other++) {
        given[other] = in[other];
    }
    for (size_t other = 0; other < kernel->outputs; other++) {
        written[other] = out[other];
    }
    memcpy(both + shift, in[vector], kernel->in_size[vector] * sizeof(real));
    given[vector] = both + shift, written[output] = both;
    kernel->one(given, theta, written), calls++;
    same(kernel, "over an input", state, written, 1, wanted);
    free(both);
}

/* One state a call; then again with each output over each input, wherever it begins in it. */
static void single(const struct kernel *kernel, const real *theta, size_t state, int at_front)
{
    real *in[VECTORS], *out[OUTPUTS], *wanted = malloc(kernel->all * sizeof(real)), *copies[OUTPUTS];
    for (size_t vector = 0; vector < kernel->inputs; vector++) {
        in[vector] = place((int)vector, kernel->in_size[vector], at_front);
        for (size_t k = 0; k < kernel->in_size[vector]; k++) {
            in[vector][k] = odd(state, vector, k);
        }
    }
    for (size_t output = 0; output < kernel->outputs; output++) {
        out[output] = place(OUT + (int)output, kernel->out_size[output], at_front);
    }
    kernel->one((const real *const *)in, theta, out), calls++;
    split(kernel, wanted, 1, copies);
    for (size_t output = 0; output < kernel->outputs; output++) {
        memcpy(copies[output], out[output], kernel->out_size[output] * sizeof(real));
    }
    for (size_t output = 0; output < kernel->outputs; output++) {
        for (size_t vector = 0; vector < kernel->inputs; vector++) {
            for (size_t shift = 0; shift < kernel->in_size[vector]; shift++) {
                overlapping(kernel, theta, state, in, out, wanted, vector, output, shift);
            }
        }
    }
    for (size_t vector = 0; vector < kernel->inputs; vector++) {
        give_back(in[vector]);
    }
    for (size_t output = 0; output < kernel->outputs; output++) {
        give_back(out[output]);
    }
    free(wanted);
}

static void batches(const struct kernel *kernel, const real *theta, const real *by_row, const real *by_lane, size_t count, size_t shared, size_t over, int at_front)
{
    batch(kernel, theta, by_row, count, 0, shared, over, at_front);
    if (kernel->lanes) {
        batch(kernel, theta, by_lane, count, 1, shared, over, at_front);
    }
}

static void stress(const struct kernel *kernel, const real *theta, int at_front)
{
    const size_t room = BLOCKS * LANES * kernel->all * sizeof(real);
    real *by_row = malloc(room), *by_lane = malloc(room), *nowhere[OUTPUTS] = {0};
    const real *none[VECTORS] = {0};
    alone(kernel, theta, by_row, by_lane);
    kernel->rows(0, none, theta, nowhere), calls++;
    for (size_t state = 0; state < COUNT; state++) {
        single(kernel, theta, state, at_front);
    }
    for (size_t count = 0; count <= COUNT; count++) {
        batches(kernel, theta, by_row, by_lane, count, VECTORS, 0, at_front);
        for (size_t output = 0; output < kernel->outputs; output++) {
            for (size_t shared = 0; shared < kernel->inputs; shared++) {
                if (kernel->out_size[output] == kernel->in_size[shared]) {
                    batches(kernel, theta, by_row, by_lane, count, shared, output, at_front);
                }
            }
        }
    }
    free(by_row);
    free(by_lane);
}

static void stress_all(const real *own)
{
    for (size_t k = 0; k < sizeof kernels / sizeof *kernels; k++) {
        for (int kind = 0; kind < (kernels[k].takes_theta ? 6 : 1); kind++) {
            for (int at_front = 0; at_front < 2; at_front++) {
                real *theta = place(THETA, L, at_front);
                for (size_t entry = 0; entry < L; entry++) {
                    theta[entry] = odd_theta(kind, own, entry);
                }
                stress(&kernels[k], theta, at_front);
                give_back(theta);
            }
        }
    }
}

#if defined(THREADS)
#include "stress_threads.h"
#endif

static int stress_main(const real *own)
{
    make_values();
#if defined(THREADS)
    stress_threads(own);
#else
    stress_all(own);
#endif
    printf("calls %lu differences %lu\n", calls, faults);
    return faults != 0;
}
