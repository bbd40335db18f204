/* calib.noise._filter: the steps of the Kalman filter that whitens readings (_filter.pyi, filtering.py).

   Arrays come by the buffer protocol; neither numpy's headers nor one version of Python are needed. */

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pass.h"

#define MOST_BUFFERS 10
typedef struct { Py_buffer view[MOST_BUFFERS]; int count; } Held;

static void release(Held *held) {
    while (held->count) PyBuffer_Release(&held->view[--held->count]);
}

static double nothing[1];

/* The items of an array, of which there must be so many, each as long as a double. */
static void *items(Held *held, PyObject *from, const char *kinds, Py_ssize_t wanted, int writable) {
    Py_buffer *view = &held->view[held->count];
    const int flags = PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (writable ? PyBUF_WRITABLE : 0);
    if (PyObject_GetBuffer(from, view, flags)) return NULL;
    held->count++;
    if (!view->format || view->format[1] || !strchr(kinds, view->format[0]) || view->itemsize != 8) {
        PyErr_Format(PyExc_TypeError, "an array of format %s is expected", kinds);
        return NULL;
    }
    if (view->len / 8 != wanted) {
        PyErr_Format(PyExc_ValueError, "%zd numbers are given, %zd expected", view->len / 8, wanted);
        return NULL;
    }
    return view->buf ? view->buf : nothing;
}

/* Sizes given as integers; each at least `least`, their product far from what overflows. */
static int sizes(PyObject *const *args, int count, Py_ssize_t least, Py_ssize_t *out) {
    double product = 1.0;
    for (int i = 0; i < count; i++) {
        out[i] = PyLong_AsSsize_t(args[i]);
        if (out[i] < least) {
            if (!PyErr_Occurred()) PyErr_SetString(PyExc_ValueError, "a size is too small");
            return 0;
        }
        product *= (double)(out[i] + 1);
    }
    if (product < 1e12) return 1;
    PyErr_SetString(PyExc_ValueError, "so many numbers are too many");
    return 0;
}

static PyObject *gains(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    (void)self;
    Py_ssize_t size[3];
    Held held = {.count = 0};
    if (count != 10) return PyErr_Format(PyExc_TypeError, "gains(T, B, n, 4 arrays, 3 to fill)");
    if (!sizes(args, 3, 1, size)) return NULL;
    const Py_ssize_t T = size[0], B = size[1], n = size[2];
    const double *seen, *fade, *fresh, *noise;
    double *gain, *white, *spread, *room = NULL;
    const int fine = (seen = items(&held, args[3], "d", T * B * 3 * n, 0))
        && (fade = items(&held, args[4], "d", T * B * n, 0))
        && (fresh = items(&held, args[5], "d", T * B * n, 0))
        && (noise = items(&held, args[6], "d", T * B, 0))
        && (gain = items(&held, args[7], "d", T * B * n * 3, 1))
        && (white = items(&held, args[8], "d", T * B * 9, 1))
        && (spread = items(&held, args[9], "d", T * B * 3, 1))
        && ((room = malloc((size_t)(n * (n + 3)) * sizeof(double))) || !!PyErr_NoMemory());
    if (fine) {
        Py_BEGIN_ALLOW_THREADS
        for (Py_ssize_t b = 0; b < B; b++) {
            memset(room, 0, (size_t)(n * n) * sizeof(double));
            for (Py_ssize_t at = b; at < T * B; at += B)
                narrowed(n, seen + at * 3 * n, fade + at * n, fresh + at * n, noise[at], room,
                         room + n * n, gain + at * n * 3, white + at * 9, spread + at * 3);
        }
        Py_END_ALLOW_THREADS
    }
    free(room);
    release(&held);
    if (!fine) return NULL;
    Py_RETURN_NONE;
}

/* What a block of k <= BLOCK columns of one reading holds that was not predicted, whitened; the
   state x (n, BLOCK) goes on to the next reading. */
static void told(Py_ssize_t n, Py_ssize_t k, Py_ssize_t stride, const double *seen,
                 const double *gain, const double *white, const double *next, const double *row,
                 double *out, double *x) {
    double v[3][BLOCK];
    for (int r = 0; r < 3; r++) {
        for (Py_ssize_t c = 0; c < k; c++) v[r][c] = row[r * stride + c];
        for (Py_ssize_t i = 0; i < n; i++) {
            const double h = seen[r * n + i];
            if (h != 0.0)
                for (Py_ssize_t c = 0; c < k; c++) v[r][c] -= h * x[i * BLOCK + c];
        }
    }
    for (int r = 0; r < 3; r++)
        for (Py_ssize_t c = 0; c < k; c++) {
            double sum = 0.0;
            for (int s = 0; s <= r; s++) sum += white[r * 3 + s] * v[s][c];
            out[r * stride + c] = sum;
        }
    if (!next) return;
    for (Py_ssize_t i = 0; i < n; i++) {
        const double a = gain[i * 3], b = gain[i * 3 + 1], g = gain[i * 3 + 2];
        for (Py_ssize_t c = 0; c < k; c++)
            x[i * BLOCK + c] = next[i] * (x[i * BLOCK + c] + a * v[0][c] + b * v[1][c] + g * v[2][c]);
    }
}

static PyObject *innovations(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    (void)self;
    Py_ssize_t size[5];
    Held held = {.count = 0};
    if (count != 12)
        return PyErr_Format(PyExc_TypeError, "innovations(T, B, n, A, k, 6 arrays, 1 to fill)");
    if (!sizes(args, 5, 0, size)) return NULL;
    const Py_ssize_t T = size[0], B = size[1], n = size[2], A = size[3], K = size[4];
    const double *seen, *fade, *gain, *white, *rows;
    const long long *reading;
    double *out, *x = NULL;
    int fine = (reading = items(&held, args[5], "lq", T * B, 0))
        && (seen = items(&held, args[6], "d", T * B * 3 * n, 0))
        && (fade = items(&held, args[7], "d", T * B * n, 0))
        && (gain = items(&held, args[8], "d", T * B * n * 3, 0))
        && (white = items(&held, args[9], "d", T * B * 9, 0))
        && (rows = items(&held, args[10], "d", A * 3 * K, 0))
        && (out = items(&held, args[11], "d", A * 3 * K, 1))
        && ((x = malloc((size_t)(n + 1) * BLOCK * sizeof(double))) || !!PyErr_NoMemory());
    for (Py_ssize_t at = 0; fine && at < T * B; at++)
        if (reading[at] >= A) {
            PyErr_SetString(PyExc_ValueError, "there is no such reading");
            fine = 0;
        }
    if (fine) {
        Py_BEGIN_ALLOW_THREADS
        for (Py_ssize_t b = 0; b < B; b++)
            for (Py_ssize_t first = 0; first < K; first += BLOCK) {
                const Py_ssize_t k = K - first < BLOCK ? K - first : BLOCK;
                memset(x, 0, (size_t)(n + 1) * BLOCK * sizeof(double));
                for (Py_ssize_t t = 0, at = b; t < T && reading[at] >= 0; t++, at += B)
                    told(n, k, K, seen + at * 3 * n, gain + at * n * 3, white + at * 9,
                         t + 1 < T ? fade + (at + B) * n : NULL, rows + reading[at] * 3 * K + first,
                         out + reading[at] * 3 * K + first, x);
            }
        Py_END_ALLOW_THREADS
    }
    free(x);
    release(&held);
    if (!fine) return NULL;
    Py_RETURN_NONE;
}

static PyObject *products(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    (void)self;
    Py_ssize_t size[7];
    Held held = {.count = 0};
    if (count != 18)
        return PyErr_Format(
            PyExc_TypeError, "products(T, B, n, ties, A, k, W, 3 numbers, 6 arrays, 2 to fill)");
    if (!sizes(args, 7, 0, size)) return NULL;
    Pass p = {.T = size[0], .B = size[1], .n = size[2], .ties = size[3], .k = size[5]};
    const Py_ssize_t A = size[4], W = size[6];
    p.K = (p.k + ALONGSIDE - 1) / ALONGSIDE * ALONGSIDE;
    p.variance = PyFloat_AsDouble(args[7]);
    p.share = PyFloat_AsDouble(args[8]);
    p.visit = PyFloat_AsDouble(args[9]);
    if (PyErr_Occurred()) return NULL;
    if (p.ties > p.n || W > 1) {
        PyErr_SetString(PyExc_ValueError, "sizes do not go together");
        return NULL;
    }
    const Py_ssize_t n = p.n, K = p.K;
    double *out, *room = NULL;
    int fine = (p.reading = items(&held, args[10], "lq", p.T * p.B, 0))
        && (p.begun = items(&held, args[11], "lq", p.T * p.B, 0))
        && (p.seen = items(&held, args[12], "d", p.T * p.B * 3 * n, 0))
        && (p.rho = items(&held, args[13], "d", p.ties ? A : 0, 0))
        && (p.own = items(&held, args[14], "d", W * A * 9, 0))
        && (p.rows = items(&held, args[15], "d", A * 3 * p.k, 0))
        && (p.spread = items(&held, args[16], "d", p.T * p.B * 3, 1))
        && (out = items(&held, args[17], "d", p.k * p.k, 1));
    for (Py_ssize_t at = 0; fine && at < p.T * p.B; at++)
        if (p.reading[at] >= A) {
            PyErr_SetString(PyExc_ValueError, "there is no such reading");
            fine = 0;
        }
    const size_t wanted = (size_t)(n * n + n * K + 3 * READ * K + K * K + 11 * n + 3 * K + 1);
    if (fine && !(room = calloc(wanted, sizeof(double)))) fine = !PyErr_NoMemory();
    if (fine) {
        if (!W) p.own = NULL;
        p.P = room, p.x = p.P + n * n, p.block = p.x + n * K;
        p.sums = p.block + 3 * READ * K;
        Py_BEGIN_ALLOW_THREADS
        gone_through(&p, p.sums + K * K);
        for (Py_ssize_t i = 0; i < p.k; i++)
            for (Py_ssize_t j = i; j < p.k; j++)
                out[i * p.k + j] = out[j * p.k + i] = p.sums[i * K + j];
        Py_END_ALLOW_THREADS
    }
    free(room);
    release(&held);
    if (!fine) return NULL;
    Py_RETURN_NONE;
}

static PyMethodDef methods[] = {
    {"gains", (PyCFunction)(void (*)(void))gains, METH_FASTCALL, NULL},
    {"innovations", (PyCFunction)(void (*)(void))innovations, METH_FASTCALL, NULL},
    {"products", (PyCFunction)(void (*)(void))products, METH_FASTCALL, NULL},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, .m_name = "calib.noise._filter", .m_size = -1, .m_methods = methods};

PyMODINIT_FUNC PyInit__filter(void) {
    const char *wish = getenv("PKMCAL_COMPILED");
    if (wish && !strcmp(wish, "off")) {
        PyErr_SetString(PyExc_ImportError, "PKMCAL_COMPILED=off");
        return NULL;
    }
    PyObject *module = PyModule_Create(&definition);
    if (module && PyModule_AddIntConstant(module, "VERSION", 2)) {
        Py_DECREF(module);
        return NULL;
    }
    return module;
}
