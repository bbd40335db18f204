"""A 6-UPS platform by hand in C, as LinuxCNC's genhexkins does it: the limit to compare with.

Inverse: |t + R P - B| - L0. Forward: Newton on the six lengths, 6 x 6 solved by elimination, from a
given pose. Written anew here (genhexkins is under another licence); compiled when it is asked for.
"""

import ctypes
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from calib.arrays import Array
from calib.mechanism.description import Machine

SOURCE = r"""
#include <math.h>
typedef struct { double B[6][3], P[6][3], L0[6]; } Legs;

static void rotation(const double *a, double R[3][3]) {
    double cx = cos(a[0]), sx = sin(a[0]), cy = cos(a[1]), sy = sin(a[1]);
    double cz = cos(a[2]), sz = sin(a[2]);
    double M[3][3] = {{cz*cy, cz*sy*sx - sz*cx, cz*sy*cx + sz*sx},
                      {sz*cy, sz*sy*sx + cz*cx, sz*sy*cx - cz*sx}, {-sy, cy*sx, cy*cx}};
    for (int i = 0; i < 3; i++) for (int j = 0; j < 3; j++) R[i][j] = M[i][j];
}
static void leg(const Legs *g, int k, const double *t, double R[3][3], double *v, double *arm) {
    for (int i = 0; i < 3; i++) {
        arm[i] = R[i][0]*g->P[k][0] + R[i][1]*g->P[k][1] + R[i][2]*g->P[k][2];
        v[i] = t[i] + arm[i] - g->B[k][i];
    }
}
void inverse(const Legs *g, const double *pose, double *s, long n) {
    for (long p = 0; p < n; p++) {
        double R[3][3], v[3], arm[3];
        rotation(pose + 6*p + 3, R);
        for (int k = 0; k < 6; k++) {
            leg(g, k, pose + 6*p, R, v, arm);
            s[6*p + k] = sqrt(v[0]*v[0] + v[1]*v[1] + v[2]*v[2]) - g->L0[k];
        }
    }
}
static int solve6(double A[6][7]) {
    for (int c = 0; c < 6; c++) {
        int best = c;
        for (int r = c + 1; r < 6; r++) if (fabs(A[r][c]) > fabs(A[best][c])) best = r;
        if (A[best][c] == 0.0) return 0;
        for (int j = c; j < 7; j++) { double x = A[c][j]; A[c][j] = A[best][j]; A[best][j] = x; }
        for (int r = c + 1; r < 6; r++) {
            double f = A[r][c] / A[c][c];
            for (int j = c; j < 7; j++) A[r][j] -= f * A[c][j];
        }
    }
    for (int c = 5; c >= 0; c--) {
        for (int j = c + 1; j < 6; j++) A[c][6] -= A[c][j] * A[j][6];
        A[c][6] /= A[c][c];
    }
    return 1;
}
/* pose: x, y, z, rx, ry, rz; holds where to begin, and the answer. Returns steps taken in all. */
long forward(const Legs *g, const double *s, double *pose, long n) {
    long steps = 0;
    for (long p = 0; p < n; p++) {
        double *t = pose + 6*p, R[3][3];
        for (int it = 0; it < 20; it++) {
            double A[6][7], most = 0.0;
            rotation(t + 3, R);
            double cy = cos(t[4]), sy = sin(t[4]), cz = cos(t[5]), sz = sin(t[5]);
            for (int k = 0; k < 6; k++) {
                double v[3], a[3];
                leg(g, k, t, R, v, a);
                double L = sqrt(v[0]*v[0] + v[1]*v[1] + v[2]*v[2]);
                double m[3] = {(a[1]*v[2] - a[2]*v[1])/L, (a[2]*v[0] - a[0]*v[2])/L,
                               (a[0]*v[1] - a[1]*v[0])/L};
                for (int i = 0; i < 3; i++) A[k][i] = v[i]/L;
                A[k][3] = cz*cy*m[0] + sz*cy*m[1] - sy*m[2];
                A[k][4] = cz*m[1] - sz*m[0];
                A[k][5] = m[2];
                A[k][6] = s[6*p + k] + g->L0[k] - L;
            }
            steps++;
            if (!solve6(A)) return -1;
            for (int i = 0; i < 6; i++) { t[i] += A[i][6]; most = fmax(most, fabs(A[i][6])); }
            if (most < 1e-9) break;
        }
    }
    return steps;
}
"""


class ClosedFormInC:
    """Kinematics of a ``stewart`` machine; poses and extensions pose after pose, (N, 6)."""

    def __init__(self, machine: Machine) -> None:
        compiler = shutil.which("cc")
        if compiler is None:
            raise SystemExit("the closed form in C needs a C compiler (cc)")
        with tempfile.TemporaryDirectory() as folder:
            source, library = Path(folder) / "legs.c", Path(folder) / "legs.so"
            source.write_text(SOURCE, encoding="utf-8")
            command = [compiler, "-O3", "-shared", "-fPIC", str(source), "-o", str(library), "-lm"]
            subprocess.run(command, check=True)
            self._code = ctypes.CDLL(str(library))
        self._code.forward.restype = ctypes.c_long
        values = dict(zip((p.name for p in machine.parameters), machine.nominal, strict=True))
        legs = [f"leg{k}" for k in range(1, 7)]
        B, P = ([[values[f"{leg}.{end}_{a}"] for a in "xyz"] for leg in legs] for end in "BP")
        L0 = [values[f"{leg}.L0"] for leg in legs]
        self._legs = np.concatenate([np.ravel(B), np.ravel(P), L0])

    def inverse(self, poses: Array, out: Array) -> None:
        """Extensions (N, 6) of poses (N, 6)."""
        self._code.inverse(_at(self._legs), _at(poses), _at(out), ctypes.c_long(len(poses)))

    def forward(self, extension: Array, poses: Array) -> int:
        """Poses (N, 6) of extensions, from those that are there; Newton steps in all."""
        count = ctypes.c_long(len(poses))
        return int(self._code.forward(_at(self._legs), _at(extension), _at(poses), count))


def _at(array: Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
