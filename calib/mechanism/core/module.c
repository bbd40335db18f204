/* calib.mechanism._core: the compiled kinematics as Python sees it (_core.pyi says how to call it).

   It needs neither numpy's headers nor a version of Python: arrays come by the buffer protocol. */

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>

#include "job.h"
#include "tables.h"

#define CAPSULE "calib.mechanism._core.machine"
#define MOST_BUFFERS 16

static const Core *chosen = &core_plain;

/* Buffers that a call holds, released together. */
typedef struct { Py_buffer view[MOST_BUFFERS]; int count; } Held;

static void release(Held *held) {
    while (held->count) PyBuffer_Release(&held->view[--held->count]);
}

static double nothing[1];

static const void *items(Held *held, PyObject *from, char kind, int writable, Py_ssize_t *count) {
    Py_buffer *view = &held->view[held->count];
    const int flags = PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (writable ? PyBUF_WRITABLE : 0);
    if (PyObject_GetBuffer(from, view, flags)) return NULL;
    held->count++;
    if (!view->format || view->format[0] != kind || view->format[1]) {
        PyErr_Format(PyExc_TypeError, "an array of format '%c' is expected", kind);
        return NULL;
    }
    *count = view->len / view->itemsize;
    return view->buf ? view->buf : nothing; /* an empty array may have no address */
}

/* The numbers of an array, of which there must be so many. */
static double *numbers(Held *held, PyObject *from, Py_ssize_t wanted, int writable) {
    Py_ssize_t count;
    const double *got = items(held, from, 'd', writable, &count);
    if (got && count != wanted) {
        PyErr_Format(PyExc_ValueError, "%zd numbers are given, %zd expected", count, wanted);
        return NULL;
    }
    return (double *)got;
}

static int optional(Held *held, PyObject *from, Py_ssize_t wanted, const double **out) {
    *out = NULL;
    return from == Py_None || (*out = numbers(held, from, wanted, 0)) != NULL;
}

static void forget(PyObject *capsule) { free(PyCapsule_GetPointer(capsule, CAPSULE)); }

static PyObject *prepare(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    (void)self;
    Held held = {.count = 0};
    Py_ssize_t int_count, real_count;
    if (count != 2) return PyErr_Format(PyExc_TypeError, "prepare(ints, reals)");
    const int *ints = items(&held, args[0], 'i', 0, &int_count);
    const double *reals = ints ? items(&held, args[1], 'd', 0, &real_count) : NULL;
    Machine *machine = reals ? read_machine(ints, int_count, reals, real_count) : NULL;
    release(&held);
    if (!reals) return NULL;
    if (!machine) return PyErr_Format(PyExc_ValueError, "these are no tables of a machine");
    PyObject *capsule = PyCapsule_New(machine, CAPSULE, forget);
    if (!capsule) free(machine);
    return capsule;
}

static int begin(Held *held, Job *job, PyObject *capsule, PyObject *poses, PyObject *parameters) {
    job->machine = PyCapsule_GetPointer(capsule, CAPSULE);
    if (!job->machine) return 0;
    job->count = PyLong_AsLong(poses);
    if (job->count < 0 || job->count > LONG_MAX / 65536) {
        if (!PyErr_Occurred()) PyErr_SetString(PyExc_ValueError, "so many poses are too many");
        return 0;
    }
    Py_ssize_t given;
    const Py_ssize_t P = job->machine->parameters;
    job->parameters = items(held, parameters, 'd', 0, &given);
    if (!job->parameters) return 0;
    job->each_parameters = given != P;
    if (given == P || given == P * job->count) return 1;
    PyErr_Format(PyExc_ValueError, "%zd parameters are given, %zd expected", given, P);
    return 0;
}

/* position, rotation, passive, extension, strain: of each pose, or of one. */
static int begin_at(Held *held, Job *job, PyObject *const *args) {
    const Machine *m = job->machine;
    Place *at = &job->start;
    Py_ssize_t given;
    at->position = items(held, args[0], 'd', 0, &given);
    if (!at->position) return 0;
    at->each = given != 3;
    const Py_ssize_t n = at->each ? job->count : 1;
    if (given != 3 * n) {
        PyErr_SetString(PyExc_ValueError, "so many poses do not go with the others");
        return 0;
    }
    return (at->rotation = numbers(held, args[1], 9 * n, 0))
        && (at->passive = numbers(held, args[2], m->passives * n, 0))
        && (at->extension = numbers(held, args[3], m->actuators * n, 0))
        && (at->strain = numbers(held, args[4], m->strains * n, 0));
}

static PyObject *finish(Held *held, const Job *job, Run run, int fine) {
    int failed = 0;
    if (fine) {
        Py_BEGIN_ALLOW_THREADS
        failed = run(job);
        Py_END_ALLOW_THREADS
    }
    release(held);
    if (!fine) return NULL;
    if (failed) return PyErr_NoMemory();
    Py_RETURN_NONE;
}

static PyObject *solve(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    (void)self;
    Held held = {.count = 0};
    Job job = {0};
    if (count != 9 && count != 13)
        return PyErr_Format(PyExc_TypeError, "solve takes 9 or 13 arguments, not %zd", count);
    int fine = begin(&held, &job, args[0], args[1], args[2]);
    if (fine) {
        const Machine *m = job.machine;
        const Py_ssize_t n = job.count;
        fine = optional(&held, args[3], m->actuators * n, &job.extension)
            && optional(&held, args[5], 9 * n, &job.goal)
            && optional(&held, args[4], (job.goal ? 3 : m->tasks) * n, &job.target)
            && optional(&held, args[6], SERIES_NUMBERS(m, job.extension != NULL), &job.series)
            && (job.out = numbers(&held, args[7], SOLUTION_ROWS(m) * n, 1)) != NULL
            && (args[8] == Py_None) == (count == 9)
            && (count == 9 || begin_at(&held, &job, args + 8));
        if (fine && (!job.extension == !job.target || (!job.series && count == 9))) {
            PyErr_SetString(PyExc_ValueError, "extensions or a target, and where to start");
            fine = 0;
        }
        if (!fine && !PyErr_Occurred()) PyErr_SetString(PyExc_ValueError, "where to start?");
    }
    return finish(&held, &job, chosen->solve, fine);
}

static PyObject *differentiate(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    (void)self;
    Held held = {.count = 0};
    Job job = {0};
    if (count != 10) return PyErr_Format(PyExc_TypeError, "differentiate takes 10 arguments");
    int fine = begin(&held, &job, args[0], args[1], args[2]) && begin_at(&held, &job, args + 3);
    if (fine) {
        const Machine *m = job.machine;
        fine = (job.out = numbers(&held, args[8], 6 * m->parameters * job.count, 1))
            && (job.out_actuators = numbers(&held, args[9], 6 * m->actuators * job.count, 1));
    }
    return finish(&held, &job, chosen->differentiate, fine);
}

static PyObject *lock(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    (void)self;
    Held held = {.count = 0};
    Job job = {0};
    if (count != 10) return PyErr_Format(PyExc_TypeError, "lock takes 10 arguments");
    int fine = begin(&held, &job, args[0], args[1], args[2]) && begin_at(&held, &job, args + 3);
    if (fine) {
        const Machine *m = job.machine;
        Py_ssize_t given = 0;
        job.place = items(&held, args[8], 'i', 0, &given);
        job.places = (int)(given / 2);
        fine = job.place && (job.out = numbers(&held, args[9], 6 * job.places * job.count, 1));
        for (int k = 0; fine && k < job.places; k++) {
            const int limb = job.place[2 * k], element = job.place[2 * k + 1];
            fine = limb >= 0 && limb < m->limbs && element >= 0 && element < m->limb[limb].elements;
            if (!fine) PyErr_SetString(PyExc_IndexError, "there is no such limb or element");
        }
    }
    return finish(&held, &job, chosen->differentiate, fine);
}

static PyObject *rows(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    (void)self;
    Held held = {.count = 0};
    Job job = {0};
    if (count != 9) return PyErr_Format(PyExc_TypeError, "rows takes 9 arguments");
    int fine = begin(&held, &job, args[0], args[1], args[2]) && begin_at(&held, &job, args + 3)
        && (job.out = numbers(&held, args[8], 7 * job.machine->rows * job.count, 1));
    return finish(&held, &job, chosen->rows, fine);
}

static int has_avx2(void) {
#if defined(__GNUC__) && defined(__x86_64__)
    __builtin_cpu_init();
    return __builtin_cpu_supports("avx2");
#else
    return 0;
#endif
}

static PyObject *processor(PyObject *self, PyObject *unused) {
    (void)self;
    (void)unused;
    return PyUnicode_FromString(chosen->name);
}

static PyObject *choose(PyObject *self, PyObject *name) {
    (void)self;
    if (!PyUnicode_Check(name)) return PyErr_Format(PyExc_TypeError, "choose takes a name");
    if (!PyUnicode_CompareWithASCIIString(name, "plain")) chosen = &core_plain;
    else if (!PyUnicode_CompareWithASCIIString(name, "avx2") && has_avx2()) chosen = &core_avx2;
    else return PyErr_Format(PyExc_ValueError, "this processor has no core %R", name);
    Py_RETURN_NONE;
}

static PyMethodDef methods[] = {
    {"prepare", (PyCFunction)(void (*)(void))prepare, METH_FASTCALL, NULL},
    {"solve", (PyCFunction)(void (*)(void))solve, METH_FASTCALL, NULL},
    {"differentiate", (PyCFunction)(void (*)(void))differentiate, METH_FASTCALL, NULL},
    {"lock", (PyCFunction)(void (*)(void))lock, METH_FASTCALL, NULL},
    {"rows", (PyCFunction)(void (*)(void))rows, METH_FASTCALL, NULL},
    {"processor", processor, METH_NOARGS, NULL},
    {"choose", choose, METH_O, NULL},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, .m_name = "calib.mechanism._core", .m_size = -1, .m_methods = methods};

PyMODINIT_FUNC PyInit__core(void) {
    const char *wish = getenv("PKMCAL_COMPILED");
    if (wish && !strcmp(wish, "off")) {
        PyErr_SetString(PyExc_ImportError, "PKMCAL_COMPILED=off");
        return NULL;
    }
    if (has_avx2()) chosen = &core_avx2;
    PyObject *module = PyModule_Create(&definition);
    if (module && PyModule_AddIntConstant(module, "VERSION", TABLES_VERSION)) {
        Py_DECREF(module);
        return NULL;
    }
    return module;
}
