/* Calls every function of a package in every layout with values that no controller should send, and compares each
   state's result with the same state's alone. The includer defines real, N, L, LANES, MOST and KERNELS.

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
#define VECTORS 4
#define ROLES (VECTORS + 2) /* the inputs, theta_b, the output */
#define THETA VECTORS
#define OUT (VECTORS + 1)

typedef size_t call_one(const real *const *in, const real *theta, real *out);
typedef size_t call_many(size_t count, const real *const *in, const real *theta, real *out);

struct kernel {
    const char *name;
    size_t inputs, size;
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
static real values[BLOCKS * LANES][VECTORS][N];

static real odd(size_t state, size_t vector, size_t k)
{
    return values[state][vector][k];
}

static void make_values(void)
{
    for (size_t state = 0; state < BLOCKS * LANES; state++) {
        for (size_t vector = 0; vector < VECTORS; vector++) {
            for (size_t k = 0; k < N; k++) {
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
    const size_t room = (BLOCKS * LANES * (size_t)(MOST > L ? MOST : L) * sizeof(real) / page + 1) * page;
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

/* Equal, or both no number: which of several NaNs comes out is the compiler's business. */
static void same(const struct kernel *kernel, const char *what, size_t state, const real *found, size_t found_step,
                 const real *wanted, size_t wanted_step)
{
    for (size_t k = 0; k < kernel->size; k++) {
        const real a = found[k * found_step], b = wanted[k * wanted_step];
        if (!(a == b || (a != a && b != b))) {
            faults++;
            if (faults < 10) {
                fprintf(stderr, "%s, %s: state %zu, entry %zu: %.17g, alone %.17g\n", kernel->name, what, state, k, (double)a, (double)b);
            }
        }
    }
}

/* [state][variable], or blocks of [variable][lane]. */
static void fill_rows(real *rows, size_t count, size_t vector)
{
    for (size_t state = 0; state < count; state++) {
        for (size_t k = 0; k < N; k++) {
            rows[state * N + k] = odd(state, vector, k);
        }
    }
}

static void fill_lanes(real *lanes, size_t states, size_t vector)
{
    for (size_t state = 0; state < states; state++) {
        for (size_t k = 0; k < N; k++) {
            lanes[(state / LANES * N + k) * LANES + state % LANES] = odd(state, vector, k);
        }
    }
}

/* What each state gives alone: as a batch of one row, and as a block of equal lanes. */
static void alone(const struct kernel *kernel, const real *theta, real *by_row, real *by_lane)
{
    for (size_t state = 0; state < BLOCKS * LANES; state++) {
        real rows[VECTORS][N], lanes[VECTORS][N * LANES], *block = malloc(kernel->size * LANES * sizeof(real));
        const real *in[VECTORS], *in_lanes[VECTORS];
        for (size_t vector = 0; vector < VECTORS; vector++) {
            for (size_t k = 0; k < N * LANES; k++) {
                rows[vector][k / LANES] = lanes[vector][k] = odd(state, vector, k / LANES);
            }
            in[vector] = rows[vector], in_lanes[vector] = lanes[vector];
        }
        kernel->rows(1, in, theta, by_row + state * kernel->size), calls++;
        if (kernel->lanes && block) {
            kernel->lanes(LANES, in_lanes, theta, block), calls++;
            for (size_t k = 0; k < kernel->size; k++) {
                by_lane[state * kernel->size + k] = block[k * LANES];
            }
        }
        free(block);
    }
}

/* One batch by rows or by lanes; `shared`: the input that the output overwrites, VECTORS for none. */
static void batch(const struct kernel *kernel, const real *theta, const real *wanted, size_t count, int by_lane, size_t shared, int at_front)
{
    const size_t states = by_lane ? (count + LANES - 1) / LANES * LANES : count;
    real *in[VECTORS], *out;
    for (size_t vector = 0; vector < kernel->inputs; vector++) {
        in[vector] = place((int)vector, states * N, at_front);
        (by_lane ? fill_lanes : fill_rows)(in[vector], states, vector);
    }
    out = shared < VECTORS ? in[shared] : place(OUT, states * kernel->size, at_front);
    (by_lane ? kernel->lanes : kernel->rows)(count, (const real *const *)in, theta, out), calls++;
    for (size_t state = 0; state < count; state++) {
        const real *found = by_lane ? out + state / LANES * LANES * kernel->size + state % LANES : out + state * kernel->size;
        same(kernel, by_lane ? "lanes" : "rows", state, found, by_lane ? LANES : 1, wanted + state * kernel->size, 1);
    }
    for (size_t vector = 0; vector < kernel->inputs; vector++) {
        give_back(in[vector]);
    }
    if (shared == VECTORS) {
        give_back(out);
    }
}

/* One state a call; then again with the output over each input, wherever it begins in it. */
static void single(const struct kernel *kernel, const real *theta, size_t state, int at_front)
{
    real *in[VECTORS], *out = place(OUT, kernel->size, at_front);
    for (size_t vector = 0; vector < kernel->inputs; vector++) {
        in[vector] = place((int)vector, N, at_front);
        for (size_t k = 0; k < N; k++) {
            in[vector][k] = odd(state, vector, k);
        }
    }
    kernel->one((const real *const *)in, theta, out), calls++;
    for (size_t vector = 0; vector < kernel->inputs; vector++) {
        for (size_t shift = 0; shift < N; shift++) {
            const real *over[VECTORS];
            real *both = malloc((kernel->size + 2 * N) * sizeof(real));
            for (size_t other = 0; other < kernel->inputs; other++) {
                over[other] = in[other];
            }
            memcpy(both + shift, in[vector], N * sizeof(real));
            over[vector] = both + shift;
            kernel->one(over, theta, both), calls++;
            same(kernel, "over an input", state, both, 1, out, 1);
            free(both);
        }
    }
    for (size_t vector = 0; vector < kernel->inputs; vector++) {
        give_back(in[vector]);
    }
    give_back(out);
}

static void stress(const struct kernel *kernel, const real *theta, int at_front)
{
    const size_t room = BLOCKS * LANES * kernel->size * sizeof(real);
    real *by_row = malloc(room), *by_lane = malloc(room);
    const real *none[VECTORS] = {0};
    alone(kernel, theta, by_row, by_lane);
    kernel->rows(0, none, theta, NULL), calls++;
    for (size_t state = 0; state < COUNT; state++) {
        single(kernel, theta, state, at_front);
    }
    for (size_t count = 0; count <= COUNT; count++) {
        batch(kernel, theta, by_row, count, 0, VECTORS, at_front);
        if (kernel->lanes) {
            batch(kernel, theta, by_lane, count, 1, VECTORS, at_front);
        }
        for (size_t shared = 0; kernel->size == N && shared < kernel->inputs; shared++) {
            batch(kernel, theta, by_row, count, 0, shared, at_front);
            if (kernel->lanes) {
                batch(kernel, theta, by_lane, count, 1, shared, at_front);
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
#include <pthread.h>

#define WORKERS 4
static real shared_rows[VECTORS][BLOCKS * LANES * N], shared_lanes[VECTORS][BLOCKS * LANES * N];
static const real *shared_theta;
static unsigned long all_calls[WORKERS];

/* The same inputs for all threads; outputs of its own. */
static void *work(void *number)
{
    const real *rows[VECTORS], *lanes[VECTORS];
    for (size_t vector = 0; vector < VECTORS; vector++) {
        rows[vector] = shared_rows[vector], lanes[vector] = shared_lanes[vector];
    }
    for (size_t k = 0; k < sizeof kernels / sizeof *kernels; k++) {
        real *out = malloc(BLOCKS * LANES * kernels[k].size * sizeof(real));
        for (size_t count = 0; count <= COUNT; count++) {
            kernels[k].rows(count, rows, shared_theta, out), calls++;
            if (kernels[k].lanes) {
                kernels[k].lanes(count, lanes, shared_theta, out), calls++;
            }
            kernels[k].one(rows, shared_theta, out), calls++;
        }
        free(out);
    }
    *(unsigned long *)number = calls;
    return NULL;
}

static void stress_threads(const real *own)
{
    pthread_t threads[WORKERS];
    shared_theta = own;
    for (size_t vector = 0; vector < VECTORS; vector++) {
        fill_rows(shared_rows[vector], BLOCKS * LANES, vector);
        fill_lanes(shared_lanes[vector], BLOCKS * LANES, vector);
    }
    for (size_t k = 0; k < WORKERS; k++) {
        pthread_create(&threads[k], NULL, work, &all_calls[k]);
    }
    for (size_t k = 0; k < WORKERS; k++) {
        pthread_join(threads[k], NULL);
        calls += all_calls[k];
    }
}
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
