/* CUDA's language and run time on a CPU, as far as psdmc's packages use them. A block's threads are fibres that run one
   after the other until each of them waits at __syncthreads() or has ended: what a GPU may do, in one order. */
#ifndef SHIM_CUDA_RUNTIME_API_H
#define SHIM_CUDA_RUNTIME_API_H

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <ucontext.h>

#include <functional>
#include <tuple>
#include <utility>
#include <vector>

#define __device__
#define __global__
#define __forceinline__ inline
#define __noinline__ __attribute__((noinline))
#define __launch_bounds__(threads)
#define __shared__ static

struct dim3 {
    unsigned x, y, z;
    dim3(unsigned x = 1, unsigned y = 1, unsigned z = 1) : x(x), y(y), z(z) {}
};
typedef enum { cudaSuccess = 0, cudaErrorInvalidValue = 1 } cudaError_t;
typedef enum { cudaMemcpyHostToDevice, cudaMemcpyDeviceToHost } cudaMemcpyKind;
typedef struct shim_stream *cudaStream_t;

static inline const char *cudaGetErrorString(cudaError_t) { return "an error of the shim"; }
static inline cudaError_t cudaMalloc(void **place, size_t bytes) { return *place = malloc(bytes), cudaSuccess; }
static inline cudaError_t cudaFree(void *place) { return free(place), cudaSuccess; }
static inline cudaError_t cudaMemcpy(void *to, const void *from, size_t bytes, cudaMemcpyKind)
{
    return memcpy(to, from, bytes), cudaSuccess;
}

static dim3 gridDim, blockDim, blockIdx, threadIdx;

#define SHIM_STACK (1 << 20) /* bytes of a thread's stack */
static ucontext_t shim_block;
static std::vector<ucontext_t> shim_threads;
static std::vector<char> shim_over;
static std::function<void()> shim_kernel;

static void __syncthreads() { swapcontext(&shim_threads[threadIdx.x], &shim_block); }

static void shim_run()
{
    shim_kernel();
    shim_over[threadIdx.x] = 1;
}

template <class... Given, size_t... Number>
static void shim_call(void (*kernel)(Given...), void **arguments, std::index_sequence<Number...>)
{
    kernel(*(Given *)arguments[Number]...);
}

template <class... Given>
static cudaError_t cudaLaunchKernel(
    void (*kernel)(Given...), dim3 grid, dim3 block, void **arguments, size_t, cudaStream_t)
{
    static std::vector<char> stacks;
    stacks.resize((size_t)block.x * SHIM_STACK);
    shim_kernel = [=] { shim_call(kernel, arguments, std::index_sequence_for<Given...>()); };
    gridDim = grid;
    blockDim = block;
    for (blockIdx.x = 0; blockIdx.x < grid.x; blockIdx.x++) {
        shim_threads.assign(block.x, ucontext_t());
        shim_over.assign(block.x, 0);
        for (unsigned k = 0; k < block.x; k++) {
            getcontext(&shim_threads[k]);
            shim_threads[k].uc_stack.ss_sp = &stacks[(size_t)k * SHIM_STACK];
            shim_threads[k].uc_stack.ss_size = SHIM_STACK;
            shim_threads[k].uc_link = &shim_block;
            makecontext(&shim_threads[k], shim_run, 0);
        }
        for (bool going = true; going;) {
            going = false;
            for (unsigned k = 0; k < block.x; k++) {
                if (!shim_over[k]) {
                    threadIdx.x = k;
                    swapcontext(&shim_block, &shim_threads[k]);
                    going = going || !shim_over[k];
                }
            }
        }
    }
    return cudaSuccess;
}

#endif
