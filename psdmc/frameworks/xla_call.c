/* Calls compiled robots from XLA on a CPU: one handler of XLA's C interface for all functions of all robots.

   A call names its function by a number, the attribute "function", under which psdmc_xla_add stored the address. The number
   depends on nothing but the robot and the function: a program that XLA kept on disk finds the function again. */
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "xla/ffi/api/c_api.h"
#include "called_arrays.h"

enum { PLACES = 1024 };    /* of the table, a power of two; functions that share one are a list */

/* One batch function. Its arrays are the inputs, theta_b if it has that, and the outputs. */
typedef struct Function {
    int64_t number;
    void (*batch)(void);
    int failures, arrays, theta;            /* theta: the place of the theta_b of all states, or -1 */
    XLA_FFI_DataType type;
    size_t size[MOST_CALLED];               /* entries for one state; of that theta_b all */
    struct Function *next;
} Function;

static _Atomic(Function *) table[PLACES];

static Function *find(int64_t number)
{
    Function *found = atomic_load_explicit(&table[(uint64_t)number % PLACES], memory_order_acquire);
    while (found != NULL && found->number != number) found = found->next;
    return found;
}

/* Store a function for good; Python calls this for one at a time. 0 if there is no memory or there are too many arrays. */
int psdmc_xla_add(int64_t number, uintptr_t batch, int failures, int is_single, int arrays, int theta, const int64_t *sizes)
{
    if (find(number) != NULL) return 1;
    Function *made = arrays < LEAST_CALLED || arrays > MOST_CALLED ? NULL : calloc(1, sizeof *made);
    if (made == NULL) return 0;
    made->number = number;
    made->batch = (void (*)(void))batch;
    made->failures = failures;
    made->arrays = arrays;
    made->theta = theta;
    made->type = is_single ? XLA_FFI_DataType_F32 : XLA_FFI_DataType_F64;
    for (int k = 0; k < arrays; k++) made->size[k] = (size_t)sizes[k];
    _Atomic(Function *) *place = &table[(uint64_t)number % PLACES];
    made->next = atomic_load_explicit(place, memory_order_acquire);
    atomic_store_explicit(place, made, memory_order_release);
    return 1;
}

static XLA_FFI_Error *refuse(const XLA_FFI_CallFrame *frame, const char *message)
{
    XLA_FFI_Error_Create_Args args = {XLA_FFI_Error_Create_Args_STRUCT_SIZE, NULL, message, XLA_FFI_Error_Code_INVALID_ARGUMENT};
    return frame->api->XLA_FFI_Error_Create(&args);
}

static const Function *named(const XLA_FFI_Attrs *attributes)
{
    static const char name[] = "function";
    for (int64_t k = 0; k < attributes->size; k++) {
        const XLA_FFI_ByteSpan *own = attributes->names[k];
        if (own->len != sizeof name - 1 || memcmp(own->ptr, name, own->len) != 0) continue;
        const XLA_FFI_Scalar *scalar = attributes->attrs[k];
        if (attributes->types[k] != XLA_FFI_AttrType_SCALAR || scalar->dtype != XLA_FFI_DataType_S64) return NULL;
        return find(*(const int64_t *)scalar->value);
    }
    return NULL;
}

static size_t entries(const XLA_FFI_Buffer *buffer)
{
    size_t count = 1;
    for (int64_t k = 0; k < buffer->rank; k++) count *= (size_t)buffer->dims[k];
    return count;
}

/* The states of a call; 0 if an array does not fit. */
static int fits(const Function *function, XLA_FFI_Buffer *const *buffers, size_t *states)
{
    *states = function->size[0] == 0 ? 0 : entries(buffers[0]) / function->size[0];
    for (int k = 0; k < function->arrays; k++) {
        const size_t count = entries(buffers[k]);
        if (buffers[k]->dtype != function->type) return 0;
        if (count != (k == function->theta ? 1 : *states) * function->size[k]) return 0;
    }
    return 1;
}

XLA_FFI_Error *psdmc_xla_call(XLA_FFI_CallFrame *frame)
{
    const XLA_FFI_Extension_Base *extension = frame->extension_start;
    if (extension != NULL && extension->type == XLA_FFI_Extension_Metadata) {
        XLA_FFI_Metadata *metadata = ((XLA_FFI_Metadata_Extension *)frame->extension_start)->metadata;
        metadata->api_version.major_version = XLA_FFI_API_MAJOR;
        metadata->api_version.minor_version = XLA_FFI_API_MINOR;
        return NULL;
    }
    const Function *function = named(&frame->attrs);
    if (function == NULL) return refuse(frame, "psdmc: this function was not loaded; call psdmc.jax and the function once in this process");
    if (frame->args.size + frame->rets.size != function->arrays) return refuse(frame, "psdmc: another number of arrays than the function has");
    XLA_FFI_Buffer *buffers[MOST_CALLED] = {NULL};
    void *data[MOST_CALLED];
    for (int k = 0; k < function->arrays; k++) {
        buffers[k] = k < frame->args.size ? frame->args.args[k] : frame->rets.rets[k - frame->args.size];
        data[k] = buffers[k]->data;
    }
    size_t states;
    if (!fits(function, buffers, &states)) return refuse(frame, "psdmc: an array has another shape or dtype than the function's");
    if (states > 0) run(function->batch, function->failures, states, function->arrays, data);
    return NULL;
}
