"""Time per sample of FilterPy's filters on the chain of benches/filters.rs.

    pip install filterpy==2.0.0 numpy scipy
    OPENBLAS_NUM_THREADS=1 python crates/lynkeus-run/benches/filterpy_chain.py

The plant is written with NumPy's vectors; x goes over a sample by one Runge-Kutta step, F by the exponential of the
Jacobian (scipy.linalg.expm), which for FilterPy's EKF is what a user writes.
"""

import platform
import time

import filterpy
import numpy as np
import scipy
from filterpy.kalman import ExtendedKalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter
from scipy.linalg import expm

STEP, U = 0.1, 0.7


def rate(x):
    flow = 2.5 * x / (1 + 1.5 * x)
    dx = -flow
    dx[0] += U
    dx[1:] += flow[:-1]
    return dx


def flown(x, h=STEP):
    k1 = rate(x)
    k2 = rate(x + 0.5 * h * k1)
    k3 = rate(x + 0.5 * h * k2)
    k4 = rate(x + h * k3)
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def transition(x):
    slope = 2.5 / (1 + 1.5 * x) ** 2
    return expm(STEP * (np.diag(-slope) + np.diag(slope[:-1], -1)))


class Chain(ExtendedKalmanFilter):
    def predict_x(self, u=0):
        self.x = flown(self.x)


def ekf(n):
    f = Chain(dim_x=n, dim_z=1)
    f.x, f.P, f.Q, f.R = np.full(n, 0.5), 1e-4 * np.eye(n), 1e-6 * STEP * np.eye(n), np.array([[4e-4]])
    row = np.zeros((1, n))
    row[0, -1] = 1

    def sample(y):
        f.F = transition(f.x)
        f.predict()
        f.update(np.array([y]), lambda x: row, lambda x: x[-1:])

    return sample


def ukf(n):
    points = MerweScaledSigmaPoints(n, alpha=1.0, beta=0.0, kappa=0.0)
    f = UnscentedKalmanFilter(dim_x=n, dim_z=1, dt=STEP, hx=lambda x: x[-1:], fx=lambda x, dt: flown(x), points=points)
    f.x, f.P, f.Q, f.R = np.full(n, 0.5), 1e-4 * np.eye(n), 1e-6 * STEP * np.eye(n), np.array([[4e-4]])

    def sample(y):
        f.predict()
        f.update(np.array([y]))

    return sample


def microseconds(sample):
    for k in range(10):
        sample(0.5 + 0.1 * np.sin(STEP * k))
    times = []
    begun = time.perf_counter()
    while len(times) < 100 and time.perf_counter() - begun < 20:
        start = time.perf_counter()
        sample(0.5 + 0.1 * np.sin(STEP * len(times)))
        times.append(time.perf_counter() - start)
    return 1e6 * float(np.median(times))


print(f"Python {platform.python_version()}, FilterPy {filterpy.__version__}, NumPy {np.__version__}, SciPy {scipy.__version__}")
for name, make in (("ekf", ekf), ("ukf", ukf)):
    for n in (2, 8, 25, 61, 200):
        print(f"{name} n = {n}: {microseconds(make(n)):.1f} us per sample", flush=True)
