/* The part of stress.h under -DTHREADS: four threads call everything at once on shared inputs. */
#include <pthread.h>

#define WORKERS 4
#define FUNCTIONS (sizeof kernels / sizeof *kernels)
static real *shared_rows[FUNCTIONS][VECTORS], *shared_lanes[FUNCTIONS][VECTORS];
static const real *shared_theta;
static unsigned long all_calls[WORKERS];

/* The same inputs for all threads; outputs of its own. */
static void *work(void *number)
{
    for (size_t k = 0; k < FUNCTIONS; k++) {
        const real *const *rows = (const real *const *)shared_rows[k], *const *lanes = (const real *const *)shared_lanes[k];
        real *block = malloc(BLOCKS * LANES * kernels[k].all * sizeof(real)), *out[OUTPUTS];
        split(&kernels[k], block, BLOCKS * LANES, out);
        for (size_t count = 0; count <= COUNT; count++) {
            kernels[k].rows(count, rows, shared_theta, out), calls++;
            if (kernels[k].lanes) {
                kernels[k].lanes(count, lanes, shared_theta, out), calls++;
            }
            kernels[k].one(rows, shared_theta, out), calls++;
        }
        free(block);
    }
    *(unsigned long *)number = calls;
    return NULL;
}

static void share_inputs(size_t k, size_t vector)
{
    const size_t size = kernels[k].in_size[vector], reals = BLOCKS * LANES * size;
    shared_rows[k][vector] = place((int)vector, reals, 0), shared_lanes[k][vector] = place((int)vector, reals, 0);
    fill_rows(shared_rows[k][vector], BLOCKS * LANES, vector, size);
    fill_lanes(shared_lanes[k][vector], BLOCKS * LANES, vector, size);
}

static void stress_threads(const real *own)
{
    pthread_t threads[WORKERS];
    shared_theta = own;
    for (size_t k = 0; k < FUNCTIONS; k++) {
        for (size_t vector = 0; vector < kernels[k].inputs; vector++) {
            share_inputs(k, vector);
        }
    }
    for (size_t k = 0; k < WORKERS; k++) {
        pthread_create(&threads[k], NULL, work, &all_calls[k]);
    }
    for (size_t k = 0; k < WORKERS; k++) {
        pthread_join(threads[k], NULL);
        calls += all_calls[k];
    }
    for (size_t k = 0; k < FUNCTIONS; k++) {
        for (size_t vector = 0; vector < kernels[k].inputs; vector++) {
            give_back(shared_rows[k][vector]), give_back(shared_lanes[k][vector]);
        }
    }
}
