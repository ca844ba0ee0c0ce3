/* Shared libraries of one emitted robot timed in turn: what a change of the generator, or of a flag, is worth.
   benchmarks/compare.sh builds the libraries and runs it. */
#define _POSIX_C_SOURCE 200809L
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include HEADER

#define TEXT2(name) #name
#define TEXT(name) TEXT2(name)
#define JOIN2(a, b) a##b
#define JOIN(a, b) JOIN2(a, b)

enum { N = JOIN(ROBOT, _DOF), L = JOIN(ROBOT, _BASE_PARAMETERS), STATES = 65536, ROUNDS = 21, MOST = 8, BLOCK = 1024 };
enum { RING = BLOCK * N * (L > N ? L : N) };

/* Results are looked at by no one: forward dynamics returns a status, the others nothing. */
typedef int one(const double *, const double *, const double *, double *);
typedef size_t many(size_t, const double *, const double *, const double *, double *);
typedef int of_q(const double *, double *);
typedef size_t many_of_q(size_t, const double *, double *);

static _Alignas(64) double q[STATES * N], qd[STATES * N], x[STATES * N], out[RING];

static double nanoseconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return 1e9 * (double)now.tv_sec + (double)now.tv_nsec;
}

static int ascending(const void *a, const void *b)
{
    const double left = *(const double *)a, right = *(const double *)b;
    return (left > right) - (left < right);
}

/* ns per state, the median block's. */
static double median_block(void *function, int is_batch, int takes_q)
{
    static double blocks[STATES / BLOCK];
    for (size_t b = 0; b < STATES / BLOCK; b++) {
        const size_t at = b * BLOCK * N;
        const double start = nanoseconds();
        if (is_batch && takes_q) {
            ((many_of_q *)function)(BLOCK, q + at, out);
        } else if (is_batch) {
            ((many *)function)(BLOCK, q + at, qd + at, x + at, out);
        }
        for (size_t i = at; !is_batch && i < at + BLOCK * N; i += N) {
            double *to = out + i / N % 128 * N * L;
            takes_q ? ((of_q *)function)(q + i, to) : ((one *)function)(q + i, qd + i, x + i, to);
        }
        blocks[b] = (nanoseconds() - start) / BLOCK;
    }
    qsort(blocks, STATES / BLOCK, sizeof *blocks, ascending);
    return blocks[STATES / BLOCK / 2];
}

int main(int count, char **paths)
{
    static const struct { const char *name; int is_batch, takes_q; } cases[] = {
        {"inverse_dynamics", 0, 0},           {"forward_dynamics", 0, 0},           {"mass_matrix", 0, 1},
        {"regressor", 0, 0},                  {"inverse_dynamics_batch", 1, 0},     {"forward_dynamics_batch", 1, 0},
        {"inverse_dynamics_batch_soa", 1, 0}, {"forward_dynamics_batch_soa", 1, 0}, {"mass_matrix_batch_soa", 1, 1},
    };
    void *libraries[MOST];
    if (count < 2 || count > MOST + 1) {
        fprintf(stderr, "usage: %s LIBRARY...   (at most %d)\n", paths[0], MOST);
        return 2;
    }
    for (int k = 1; k < count; k++) {
        if ((libraries[k - 1] = dlopen(paths[k], RTLD_NOW)) == NULL) {
            fprintf(stderr, "%s\n", dlerror());
            return 2;
        }
    }
    for (size_t i = 0; i < STATES * N; i++) {
        q[i] = 6.0 * rand() / RAND_MAX - 3.0;
        qd[i] = 6.0 * rand() / RAND_MAX - 3.0;
        x[i] = 30.0 * rand() / RAND_MAX - 15.0;
    }
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        static double found[MOST][ROUNDS];
        char symbol[256];
        snprintf(symbol, sizeof symbol, TEXT(ROBOT) "_%s", cases[c].name);
        printf("%-28s", cases[c].name);
        for (int round = 0; round < ROUNDS; round++) {
            for (int k = 0; k < count - 1; k++) {
                void *function = dlsym(libraries[k], symbol);
                if (function != NULL) {
                    found[k][round] = median_block(function, cases[c].is_batch, cases[c].takes_q);
                }
            }
        }
        for (int k = 0; k < count - 1; k++) {
            qsort(found[k], ROUNDS, sizeof **found, ascending);
            printf("  %7.2f", found[k][ROUNDS / 2]);
        }
        puts(" ns");
    }
    return 0;
}
