/* Calls a compiled function on NumPy arrays without a detour through Python: one type, DirectCall, for all robots.

   A call whose arrays are exactly what C reads (of the robot's dtype, contiguous, of one leading shape) is made here. Any
   other call, and every error, is left to the `slow` callable, which takes the same arguments. */
#define PY_SSIZE_T_CLEAN
#define NPY_NO_DEPRECATED_API NPY_2_0_API_VERSION
#include <Python.h>
#include <structmember.h>
#include <numpy/arrayobject.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include "called_arrays.h"

enum {
    MOST_ARRAYS = 20,    /* inputs and outputs of one function */
    MOST_AXES = 3,       /* trailing axes of one of them */
    MOST_UNITS = 64,     /* quaternions, and cosines with their sines, in the inputs of one function */
    RELEASE_FROM = 64,   /* states from which the GIL is released: below, giving it up takes longer than the call */
    RAISES = 2           /* of `failures`: `slow` raises an error if a state fails; 1: NaN says so; 0: none can fail */
};

typedef struct {
    int axes;
    npy_intp length[MOST_AXES];
} Tail;

/* Entries `from` to before `to` of a row of an input, whose length must be one. */
typedef struct {
    int input, from, to;
} Unit;

static const double UNIT_SLACK = 0.5e-6;    /* of a length's square: what is further off, Python looks at */

typedef struct {
    PyObject_HEAD
    vectorcallfunc vectorcall;
    PyObject *slow;      /* bound method of the robot, which keeps its library open */
    PyObject *result;    /* class of the named tuple of several outputs, or NULL */
    void (*batch)(void);          /* or NULL, where the robot has no parameters of its own */
    void (*batch_theta)(void);    /* the same with theta_b behind the inputs, or NULL */
    Tail parameters;              /* of theta_b */
    int inputs, outputs, type, failures, units;
    Unit unit[MOST_UNITS];
    Tail tails[MOST_ARRAYS];
} DirectCall;

static PyObject *out_word, *theta_word;    /* "out", "theta_b", interned */

/* What a call gives beside its inputs, borrowed; NULL where it is None or left out. */
typedef struct {
    PyObject *theta, *out;
} Extras;

static int has_tail(PyArrayObject *array, int lead, const Tail *tail)
{
    const npy_intp *shape = PyArray_DIMS(array);
    for (int i = 0; i < tail->axes; i++) {
        if (shape[lead + i] != tail->length[i]) return 0;
    }
    return 1;
}

/* Whether an object is an array that C can read: `lead` axes and `shape` of them as given, then the tail's. */
static int is_plain(PyObject *object, int type, int flags, const Tail *tail, int lead, const npy_intp *shape)
{
    if (!PyArray_CheckExact(object)) return 0;
    PyArrayObject *array = (PyArrayObject *)object;
    return PyArray_TYPE(array) == type && PyArray_CHKFLAGS(array, flags) && PyArray_ISNOTSWAPPED(array)
        && PyArray_NDIM(array) == lead + tail->axes && (lead == 0 || memcmp(PyArray_DIMS(array), shape, (size_t)lead * sizeof *shape) == 0)
        && has_tail(array, lead, tail);
}

static int overlap(PyArrayObject *a, PyArrayObject *b)
{
    const uintptr_t from = (uintptr_t)PyArray_DATA(a), other = (uintptr_t)PyArray_DATA(b);
    return from < other + (uintptr_t)PyArray_NBYTES(b) && other < from + (uintptr_t)PyArray_NBYTES(a);
}

/* theta_b by its place or name, out by its name; 0 where Python must look at them. */
static int take_extras(const DirectCall *self, PyObject *const *args, Py_ssize_t placed, PyObject *names, Extras *extras)
{
    const Py_ssize_t named = names == NULL ? 0 : PyTuple_GET_SIZE(names);
    if (placed != self->inputs && placed != self->inputs + 1) return 0;
    if (placed > self->inputs) extras->theta = args[self->inputs];
    for (Py_ssize_t k = 0; k < named; k++) {
        PyObject *name = PyTuple_GET_ITEM(names, k);
        if (name == out_word) extras->out = args[placed + k];
        else if (name == theta_word && placed == self->inputs) extras->theta = args[placed + k];
        else return 0;
    }
    if (extras->theta != NULL && self->batch_theta == NULL) return 0;
    if (extras->theta == Py_None) extras->theta = NULL;
    if (extras->out == Py_None) extras->out = NULL;
    if (extras->theta == NULL && self->batch == NULL) return 0;
    return extras->theta == NULL || is_plain(extras->theta, self->type, NPY_ARRAY_CARRAY_RO, &self->parameters, 0, NULL);
}

/* The outputs that a caller gave, borrowed, into arrays[inputs...]; 0 where Python must look at them. */
static int take_outputs(const DirectCall *self, const Extras *extras, int lead, const npy_intp *shape, PyArrayObject **arrays)
{
    PyObject *out = extras->out;
    if (self->outputs > 1 && (!PyTuple_Check(out) || PyTuple_GET_SIZE(out) != self->outputs)) return 0;
    for (int k = 0; k < self->outputs; k++) {
        PyObject *own = self->outputs > 1 ? PyTuple_GET_ITEM(out, k) : out;
        const int place = self->inputs + k;
        if (!is_plain(own, self->type, NPY_ARRAY_CARRAY, &self->tails[place], lead, shape)) return 0;
        arrays[place] = (PyArrayObject *)own;
        for (int i = 0; i < place; i++) {
            if (overlap(arrays[i], arrays[place])) return 0;
        }
        if (extras->theta != NULL && overlap((PyArrayObject *)extras->theta, arrays[place])) return 0;
    }
    return 1;
}

static PyObject *new_output(const DirectCall *self, int place, int lead, const npy_intp *shape)
{
    npy_intp whole[NPY_MAXDIMS];
    const Tail *tail = &self->tails[place];
    if (lead > 0) memcpy(whole, shape, (size_t)lead * sizeof *shape);
    for (int i = 0; i < tail->axes; i++) whole[lead + i] = tail->length[i];
    return PyArray_SimpleNew(lead + tail->axes, whole, self->type);
}

static PyObject *named(const DirectCall *self, PyObject *plain)
{
    PyObject *given = PyTuple_Pack(1, plain);
    Py_DECREF(plain);
    if (given == NULL) return NULL;
    PyObject *found = PyTuple_Type.tp_new((PyTypeObject *)self->result, given, NULL);
    Py_DECREF(given);
    return found;
}

/* New outputs into arrays[inputs...]; what the call returns, or NULL with an exception. */
static PyObject *make_outputs(const DirectCall *self, int lead, const npy_intp *shape, PyArrayObject **arrays)
{
    PyObject *made = self->outputs > 1 ? PyTuple_New(self->outputs) : NULL;
    if (self->outputs > 1 && made == NULL) return NULL;
    for (int k = 0; k < self->outputs; k++) {
        PyObject *own = new_output(self, self->inputs + k, lead, shape);
        if (own == NULL) {
            Py_XDECREF(made);
            return NULL;
        }
        arrays[self->inputs + k] = (PyArrayObject *)own;
        if (made == NULL) return own;
        PyTuple_SET_ITEM(made, k, own);
    }
    return named(self, made);
}

/* Whether every part of the inputs that must be of length one is; NaN is not. */
static int are_units(const DirectCall *self, PyArrayObject **arrays, npy_intp count)
{
    for (int k = 0; k < self->units; k++) {
        const Unit *unit = &self->unit[k];
        const npy_intp row = self->tails[unit->input].length[0];
        const void *data = PyArray_DATA(arrays[unit->input]);
        for (npy_intp i = 0; i < count; i++) {
            double square = 0.0;
            for (npy_intp j = i * row + unit->from; j < i * row + unit->to; j++) {
                const double entry = self->type == NPY_FLOAT ? (double)((const float *)data)[j] : ((const double *)data)[j];
                square += entry * entry;
            }
            if (!(square >= 1.0 - UNIT_SLACK && square <= 1.0 + UNIT_SLACK)) return 0;
        }
    }
    return 1;
}

static PyObject *call(PyObject *object, PyObject *const *args, size_t nargsf, PyObject *names)
{
    DirectCall *self = (DirectCall *)object;
    Extras extras = {NULL, NULL};
    PyArrayObject *arrays[MOST_ARRAYS];
    if (!take_extras(self, args, PyVectorcall_NARGS(nargsf), names, &extras)) goto slow;
    if (!PyArray_CheckExact(args[0])) goto slow;
    const int lead = PyArray_NDIM((PyArrayObject *)args[0]) - self->tails[0].axes;
    const npy_intp *shape = PyArray_DIMS((PyArrayObject *)args[0]);
    if (lead < 0 || lead + MOST_AXES > NPY_MAXDIMS) goto slow;
    for (int i = 0; i < self->inputs; i++) {
        if (!is_plain(args[i], self->type, NPY_ARRAY_CARRAY_RO, &self->tails[i], lead, shape)) goto slow;
        arrays[i] = (PyArrayObject *)args[i];
    }
    npy_intp count = 1;
    for (int i = 0; i < lead; i++) count *= shape[i];
    if (!are_units(self, arrays, count)) goto slow;
    PyObject *result;
    if (extras.out == NULL) {
        result = make_outputs(self, lead, shape, arrays);
        if (result == NULL) return NULL;
    } else {
        if (!take_outputs(self, &extras, lead, shape, arrays)) goto slow;
        result = self->outputs > 1 ? named(self, Py_NewRef(extras.out)) : Py_NewRef(extras.out);
        if (result == NULL) return NULL;
    }
    void *data[MOST_ARRAYS];
    int all = 0;
    for (int i = 0; i < self->inputs; i++) data[all++] = PyArray_DATA(arrays[i]);
    if (extras.theta != NULL) data[all++] = PyArray_DATA((PyArrayObject *)extras.theta);
    for (int i = 0; i < self->outputs; i++) data[all++] = PyArray_DATA(arrays[self->inputs + i]);
    void (*batch)(void) = extras.theta != NULL ? self->batch_theta : self->batch;
    size_t failed;
    if (count < RELEASE_FROM) {
        failed = run(batch, self->failures, (size_t)count, all, data);
    } else {
        Py_BEGIN_ALLOW_THREADS
        failed = run(batch, self->failures, (size_t)count, all, data);
        Py_END_ALLOW_THREADS
    }
    if (failed == 0 || self->failures < RAISES) return result;
    Py_DECREF(result);
slow:
    return PyObject_Vectorcall(self->slow, args, nargsf & ~PY_VECTORCALL_ARGUMENTS_OFFSET, names);
}

/* (numbers...) into a tail; 0 with an exception where they are none. */
static int read_tail(PyObject *lengths, Tail *tail)
{
    if (!PyTuple_Check(lengths) || PyTuple_GET_SIZE(lengths) > MOST_AXES) {
        PyErr_SetString(PyExc_ValueError, "a tail is a tuple of at most three lengths");
        return 0;
    }
    tail->axes = (int)PyTuple_GET_SIZE(lengths);
    for (int i = 0; i < tail->axes; i++) {
        tail->length[i] = PyLong_AsSsize_t(PyTuple_GET_ITEM(lengths, i));
        if (PyErr_Occurred()) return 0;
    }
    return 1;
}

static int read_tails(DirectCall *self, PyObject *inputs, PyObject *outputs)
{
    self->inputs = (int)PyTuple_GET_SIZE(inputs);
    self->outputs = (int)PyTuple_GET_SIZE(outputs);
    const int all = self->inputs + self->outputs;
    if (self->inputs < 1 || self->outputs < 1 || all < LEAST_CALLED || all > MOST_CALLED) {
        PyErr_Format(PyExc_ValueError, "%d arrays, expected %d to %d", all, LEAST_CALLED, MOST_CALLED);
        return 0;
    }
    for (int i = 0; i < all; i++) {
        PyObject *own = i < self->inputs ? PyTuple_GET_ITEM(inputs, i) : PyTuple_GET_ITEM(outputs, i - self->inputs);
        if (!read_tail(own, &self->tails[i])) return 0;
    }
    return 1;
}

/* ((input, from, to), ...) */
static int read_units(DirectCall *self, PyObject *units)
{
    const Py_ssize_t count = PyTuple_GET_SIZE(units);
    if (count > MOST_UNITS) {
        PyErr_Format(PyExc_ValueError, "%zd parts of length one, expected up to %d", count, MOST_UNITS);
        return 0;
    }
    for (Py_ssize_t k = 0; k < count; k++) {
        Unit *unit = &self->unit[k];
        PyObject *own = PyTuple_GET_ITEM(units, k);
        if (!PyTuple_Check(own) || !PyArg_ParseTuple(own, "iii", &unit->input, &unit->from, &unit->to)) {
            if (!PyErr_Occurred()) PyErr_SetString(PyExc_TypeError, "a part of length one is three numbers");
            return 0;
        }
        const int known = unit->input >= 0 && unit->input < self->inputs && self->tails[unit->input].axes == 1;
        if (!known || unit->from < 0 || unit->from > unit->to || unit->to > self->tails[unit->input].length[0]) {
            PyErr_SetString(PyExc_ValueError, "a part of length one lies in no input");
            return 0;
        }
    }
    self->units = (int)count;
    return 1;
}

/* The function that takes theta_b, too; 0 with an exception where that is one array more than `run` knows. */
static int read_theta(DirectCall *self, unsigned long long address, Py_ssize_t parameters)
{
    if (address == 0) return 1;
    if (parameters < 0 || self->inputs + 1 + self->outputs > MOST_CALLED) {
        PyErr_SetString(PyExc_ValueError, "theta_b does not fit");
        return 0;
    }
    self->batch_theta = (void (*)(void))(uintptr_t)address;
    self->parameters.axes = 1;
    self->parameters.length[0] = parameters;
    return 1;
}

/* DirectCall(slow, address, failures, is_single, inputs, outputs, result, units, theta_address, parameters) */
static PyObject *new(PyTypeObject *type, PyObject *args, PyObject *named_args)
{
    PyObject *slow, *inputs, *outputs, *result, *units;
    unsigned long long address, theta;
    Py_ssize_t parameters;
    int failures, is_single;
    if (named_args != NULL && PyDict_GET_SIZE(named_args) > 0) {
        PyErr_SetString(PyExc_TypeError, "DirectCall() takes no keyword arguments");
        return NULL;
    }
    if (!PyArg_ParseTuple(args, "OKipO!O!OO!Kn", &slow, &address, &failures, &is_single, &PyTuple_Type, &inputs,
                          &PyTuple_Type, &outputs, &result, &PyTuple_Type, &units, &theta, &parameters)) return NULL;
    DirectCall *self = (DirectCall *)type->tp_alloc(type, 0);
    if (self == NULL) return NULL;
    self->vectorcall = call;
    self->type = is_single ? NPY_FLOAT : NPY_DOUBLE;
    self->failures = failures;
    self->batch = (void (*)(void))(uintptr_t)address;
    self->slow = Py_NewRef(slow);
    self->result = result == Py_None ? NULL : Py_NewRef(result);
    const int is_class = result == Py_None || (PyType_Check(result) && PyType_IsSubtype((PyTypeObject *)result, &PyTuple_Type));
    if (!is_class || !read_tails(self, inputs, outputs) || !read_units(self, units) || !read_theta(self, theta, parameters)
        || (self->outputs > 1) != (self->result != NULL)) {
        if (!PyErr_Occurred()) PyErr_SetString(PyExc_ValueError, "several outputs have a class of tuples, one has none");
        Py_DECREF(self);
        return NULL;
    }
    return (PyObject *)self;
}

/* Nothing is cleared, as of a tuple: circles end at the robot's own dictionary, and `slow` keeps the library open until then. */
static int traverse(PyObject *object, visitproc visit, void *arg)
{
    Py_VISIT(Py_TYPE(object));
    Py_VISIT(((DirectCall *)object)->slow);
    Py_VISIT(((DirectCall *)object)->result);
    return 0;
}

static void dealloc(PyObject *object)
{
    DirectCall *self = (DirectCall *)object;
    PyTypeObject *type = Py_TYPE(object);
    PyObject_GC_UnTrack(object);
    Py_XDECREF(self->slow);
    Py_XDECREF(self->result);
    type->tp_free(object);
    Py_DECREF(type);
}

/* Attributes are those of the method that it stands for (name, documentation, robot, class): it is described, inspected and
   pickled as that method. */
static PyObject *getattro(PyObject *object, PyObject *name)
{
    PyObject *found = PyObject_GetAttr(((DirectCall *)object)->slow, name);
    if (found != NULL || !PyErr_ExceptionMatches(PyExc_AttributeError)) return found;
    PyErr_Clear();
    return PyObject_GenericGetAttr(object, name);
}

static PyObject *repr(PyObject *object)
{
    return PyObject_Repr(((DirectCall *)object)->slow);
}

static PyMemberDef members[] = {
    {"__vectorcalloffset__", T_PYSSIZET, offsetof(DirectCall, vectorcall), READONLY, NULL},
    {NULL, 0, 0, 0, NULL},
};

static PyType_Slot slots[] = {
    {Py_tp_doc, "A function of a compiled robot, called without a detour through Python."},
    {Py_tp_new, new},
    {Py_tp_call, PyVectorcall_Call},
    {Py_tp_traverse, traverse},
    {Py_tp_dealloc, dealloc},
    {Py_tp_getattro, getattro},
    {Py_tp_repr, repr},
    {Py_tp_members, members},
    {0, NULL},
};

static PyType_Spec spec = {
    "psdmc_direct_call.DirectCall", sizeof(DirectCall), 0,
    Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_GC | Py_TPFLAGS_HAVE_VECTORCALL | Py_TPFLAGS_IMMUTABLETYPE, slots,
};

static int fill(PyObject *module)
{
    if (PyArray_ImportNumPyAPI() < 0) return -1;
    out_word = PyUnicode_InternFromString("out");
    theta_word = PyUnicode_InternFromString("theta_b");
    PyObject *type = PyType_FromSpec(&spec);
    if (out_word == NULL || theta_word == NULL || type == NULL) return -1;
    const int failed = PyModule_AddObjectRef(module, "DirectCall", type);
    Py_DECREF(type);
    return failed;
}

static PyModuleDef_Slot module_slots[] = {
    {Py_mod_exec, fill},
#ifdef Py_GIL_DISABLED
    {Py_mod_gil, Py_MOD_GIL_NOT_USED},
#endif
    {0, NULL},
};

static PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "psdmc_direct_call", NULL, 0, NULL, module_slots, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit_psdmc_direct_call(void)
{
    return PyModuleDef_Init(&module);
}
