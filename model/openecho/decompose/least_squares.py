"""Least squares for a baseline and a sum of echoes, one waveform at a time: what all fits have in common, compiled.

y(x) = b + Σ A p((x - c) / w), with p one of `pulses`. Its unknowns are b, and A, c and ln w of each echo, so that no
width is ever negative; they are moved by the method of Levenberg and Marquardt, with analytic derivatives. Amplitudes
stay at 0 or above, centres within a record's length of the record, widths between a third of a bin, or the shape's own
least, and the record's length: a step that leads out ends at the border.

Waveforms come in units of their greatest sample, so that no square overflows or vanishes. Their samples may have
weights: 0 for one that says nothing, as where the digitiser clips.

Noise that is not white is made so: residual and derivatives pass the filter that turns its autocorrelation into that
of white noise, `enhance.whitening`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openecho.compiled import njit
from openecho.decompose.pulses import Pulse

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LEAST_WIDTH = 1 / 3
"""Bins. Of what is narrower all but one sample is about a hundredth at most: its width can't be known."""
STEPS, TRIAL_STEPS = 300, 30
"""Accepted or not, of a fit and of a trial: few echoes need 10; many that overlap creep, and go on when they stay."""
LEAST_GAIN = 1e-9
"""Of a step, as a part of the sum of squares: the last step. What is left to gain then is less by far, for steps grow
shorter each time, and this one is at most a thousandth of a standard error in a thousand samples."""
ROUNDING = 2.0**-104
"""What each sample, of 1 at most, adds to the sum of squares by its rounding: without noise, steps gain no less."""


class Waveform(NamedTuple):
    """A waveform to fit.

    Attributes
    ----------
    samples : float64 (m,)
        In units of the greatest.
    root : float64 (m,) or (0,)
        Square root of the weight of each; empty if all have the same.
    """

    samples: FloatArray
    root: FloatArray


class Problem(NamedTuple):
    """What all waveforms of a batch have in common.

    Attributes
    ----------
    pulse : Pulse
        Shape of the echoes.
    white : float64 (p + 1, p + 1)
        Filter that makes the noise white, from `enhance.whitening`; (1, 1) for white noise.
    tied : bool
        Whether all echoes of a waveform have the same width.
    width : float
        Width that all echoes have, bins; 0 if it is fitted.
    """

    pulse: Pulse
    white: FloatArray
    tied: bool
    width: float


@njit()
def borders(length: int, components: int, problem: Problem) -> tuple[FloatArray, FloatArray]:
    """Least and greatest baseline, and amplitude, centre and ln w of each echo; the greatest sample is 1."""
    low, high = np.empty(3 * components + 1), np.empty(3 * components + 1)
    low[0], high[0] = -1e3, 1e3
    low[1::3], high[1::3] = 0.0, 1e3
    low[2::3], high[2::3] = -float(length), 2.0 * length
    narrowest = max(LEAST_WIDTH, problem.pulse.narrowest)
    widest = max(float(length), 2 * narrowest)
    if problem.width > 0:
        narrowest = widest = problem.width
    low[3::3], high[3::3] = np.log(narrowest), np.log(widest)
    return low, high


@njit()
def minimise(
    waveform: Waveform, u: FloatArray, low: FloatArray, high: FloatArray, problem: Problem, steps: int
) -> tuple[FloatArray, float, bool]:
    """Move `u` to the least sum of squares; return the normal matrix there, the sum, and whether it is the least."""
    unknowns = len(u)
    u[:] = np.minimum(np.maximum(u, low), high)
    if problem.tied:
        u[6::3] = u[3]
    normal, gradient = np.empty((unknowns, unknowns)), np.empty(unknowns)
    tried_normal, tried_gradient = np.empty_like(normal), np.empty_like(gradient)
    damped, step, tried = np.empty_like(normal), np.empty(unknowns), np.empty(unknowns)
    length = len(waveform.samples)
    slopes, residual = np.empty((unknowns, length)), np.empty(length)
    squares = evaluate(waveform, u, problem, slopes, residual, normal, gradient)
    damping = 1e-3
    for _ in range(steps):
        damped[:] = normal
        step[:] = gradient
        for i in range(unknowns):
            damped[i, i] += damping * normal[i, i] + 1e-300
            # On its border, and drawn out of it: stays.
            if (u[i] <= low[i] and gradient[i] < 0) or (u[i] >= high[i] and gradient[i] > 0):
                hold(damped, i)
                step[i] = 0.0
        gain = -1.0
        if solve(damped, step):
            if problem.tied:
                step[6::3] = step[3]
            for i in range(unknowns):
                tried[i] = min(max(u[i] + step[i], low[i]), high[i])
            if damping <= 1e-3 and step @ gradient <= LEAST_GAIN * squares + ROUNDING * length:
                u[:] = tried
                return normal, squares, True
            gain = squares - evaluate(waveform, tried, problem, slopes, residual, tried_normal, tried_gradient)
        if gain >= 0:
            u[:] = tried
            normal, tried_normal = tried_normal, normal
            gradient, tried_gradient = tried_gradient, gradient
            squares -= gain
            damping = max(0.1 * damping, 1e-12)
        elif damping > 1e8:
            # No way down at any length: the rounding of the sum of squares is all that is left.
            return normal, squares, True
        else:
            damping *= 10
    return normal, squares, False


@njit()
def hold(matrix: FloatArray, i: int) -> None:
    """Take an unknown out of a symmetric system."""
    matrix[i, :] = 0.0
    matrix[:, i] = 0.0
    matrix[i, i] = 1.0


@njit(fastmath={"reassoc", "contract"})
def evaluate(
    waveform: Waveform,
    u: FloatArray,
    problem: Problem,
    slopes: FloatArray,
    residual: FloatArray,
    normal: FloatArray,
    gradient: FloatArray,
) -> float:
    """Sum of squares at `u`, and its normal matrix and half of its negative gradient."""
    length, unknowns = len(waveform.samples), len(u)
    begins, ends = np.zeros(unknowns, np.int64), np.full(unknowns, length)
    residual[:] = waveform.samples - u[0]
    slopes[0] = 1.0
    for k in range(1, unknowns, 3):
        begin, end = add_slopes(u[k], u[k + 1], np.exp(u[k + 2]), problem.pulse, slopes[k : k + 3])
        begins[k : k + 3], ends[k : k + 3] = begin, end
        amplitude = u[k]
        for x in range(begin, end):
            residual[x] -= amplitude * slopes[k, x]
    if len(waveform.root) > 0:
        residual *= waveform.root
        slopes *= waveform.root
    if len(problem.white) > 1:
        whiten(residual, 0, length, problem.white)
        for i in range(unknowns):
            ends[i] = whiten(slopes[i], begins[i], ends[i], problem.white)
    squares = 0.0
    for x in range(length):
        squares += residual[x] * residual[x]
    gradient[0], normal[0, 0] = products(slopes[0], residual, slopes[0], 0, length)
    for i in range(1, unknowns, 3):
        for k in range(i, i + 3):
            gradient[k], normal[k, 0] = products(slopes[k], residual, slopes[0], begins[i], ends[i])
            normal[0, k] = normal[k, 0]
        for j in range(1, i + 1, 3):
            begin, end = max(begins[i], begins[j]), min(ends[i], ends[j])
            add_block(slopes[i : i + 3], slopes[j : j + 3], begin, end, normal, i, j)
    if problem.tied:
        tie(normal, gradient)
    return squares


@njit(fastmath={"reassoc", "contract"})
def add_slopes(amplitude: float, centre: float, width: float, pulse: Pulse, slopes: FloatArray) -> tuple[int, int]:
    """Derivatives of an echo by its amplitude, which is its shape, centre and ln w (3, m); samples where there are any.

    A node is looked up for each sample, between the rows of the table as Lagrange's cubic has it.
    """
    length, nodes = slopes.shape[1], pulse.table.shape[1]
    scale = pulse.density / width
    origin = centre * scale + pulse.first * pulse.density  # in nodes, as x * scale
    begin = int(min(max(np.ceil(origin / scale), 0.0), float(length)))
    end = int(min(max(np.floor((origin + nodes - 1) / scale), begin - 1.0), length - 1.0)) + 1
    if len(pulse.table) == 1:
        for x in range(begin, end):
            place = x * scale - origin
            slopes[0, x], slopes[1, x] = interpolated(pulse.table[0], place, pulse.density)
            slopes[2, x] = 0.0
    else:
        slopes[:, begin:end] = 0.0
        row, weights, changes = row_weights(width, pulse)
        for x in range(begin, end):
            for r in range(len(weights)):
                height, slope = interpolated(pulse.table[row + r], x * scale - origin, pulse.density)
                slopes[0, x] += weights[r] * height
                slopes[1, x] += weights[r] * slope
                slopes[2, x] += changes[r] * height
    for x in range(begin, end):
        slopes[2, x] = amplitude * (slopes[2, x] - (x - centre) / width * slopes[1, x])
        slopes[1, x] *= -amplitude / width
    return begin, end


@njit()
def residual(y: FloatArray, u: FloatArray, pulse: Pulse) -> FloatArray:
    """What baseline and echoes leave of a waveform."""
    left: FloatArray = y - u[0]
    slopes = np.empty((3, len(y)))
    for k in range(1, len(u), 3):
        begin, end = add_slopes(u[k], u[k + 1], np.exp(u[k + 2]), pulse, slopes)
        for x in range(begin, end):
            left[x] -= u[k] * slopes[0, x]
    return left


@njit(fastmath={"reassoc", "contract"})
def products(a: FloatArray, b: FloatArray, c: FloatArray, begin: int, end: int) -> tuple[float, float]:
    """Σ a b and Σ a c over a range."""
    ab = ac = 0.0
    for x in range(begin, end):
        ab += a[x] * b[x]
        ac += a[x] * c[x]
    return ab, ac


@njit(fastmath={"reassoc", "contract"})
def add_block(a: FloatArray, b: FloatArray, begin: int, end: int, normal: FloatArray, i: int, j: int) -> None:
    """All nine products of the derivatives of two echoes, in one pass."""
    p = q = r = s = t = u = v = w = z = 0.0
    for x in range(begin, end):
        p += a[0, x] * b[0, x]
        q += a[0, x] * b[1, x]
        r += a[0, x] * b[2, x]
        s += a[1, x] * b[0, x]
        t += a[1, x] * b[1, x]
        u += a[1, x] * b[2, x]
        v += a[2, x] * b[0, x]
        w += a[2, x] * b[1, x]
        z += a[2, x] * b[2, x]
    normal[i, j] = normal[j, i] = p
    normal[i, j + 1] = normal[j + 1, i] = q
    normal[i, j + 2] = normal[j + 2, i] = r
    normal[i + 1, j] = normal[j, i + 1] = s
    normal[i + 1, j + 1] = normal[j + 1, i + 1] = t
    normal[i + 1, j + 2] = normal[j + 2, i + 1] = u
    normal[i + 2, j] = normal[j, i + 2] = v
    normal[i + 2, j + 1] = normal[j + 1, i + 2] = w
    normal[i + 2, j + 2] = normal[j + 2, i + 2] = z


@njit(fastmath={"reassoc", "contract"})
def interpolated(row: FloatArray, place: float, density: float) -> tuple[float, float]:
    """Height and slope at a place in nodes, with Hermite's cubic."""
    node = min(max(int(place), 0), len(row) - 2)
    f = place - node
    g = 1.0 - f
    rise, left, right = row[node + 1, 0] - row[node, 0], row[node, 1], row[node + 1, 1]
    height = row[node, 0] + f * f * (3.0 - 2.0 * f) * rise + f * g * (g * left - f * right) / density
    slope = 6.0 * f * g * density * rise + (1.0 - 3.0 * f) * g * left + f * (3.0 * f - 2.0) * right
    return height, slope


@njit()
def row_weights(width: float, pulse: Pulse) -> tuple[int, FloatArray, FloatArray]:
    """From which row of the table on four are mixed, how much of each, and the change of that with ln w."""
    weights, changes = np.zeros(4), np.zeros(4)
    pure = min(pulse.narrowest / width, 1.0) ** 2
    steps = len(pulse.table) - 1
    first = min(max(int((1 - pure) * steps) - 1, 0), steps - 3)
    t = (1 - pure) * steps - first
    for r in range(4):
        weight, change = 1.0, 0.0
        for other in range(4):
            if other != r:
                change = (change * (t - other) + weight) / (r - other)
                weight *= (t - other) / (r - other)
        weights[r] = weight
        changes[r] = change * 2 * pure * steps
    return first, weights, changes


@njit()
def whiten(values: FloatArray, begin: int, end: int, white: FloatArray) -> int:
    """Filter values that are 0 outside of a range in place; return the new end of the range."""
    order = len(white) - 1
    last = min(end + order, len(values))
    values[end:last] = 0.0
    for x in range(last - 1, begin - 1, -1):
        row = min(x, order)
        total = 0.0
        for j in range(min(x - begin, row) + 1):
            total += white[row, j] * values[x - j]
        values[x] = total
    return last


@njit()
def tie(normal: FloatArray, gradient: FloatArray) -> None:
    """Make one unknown of all widths: the first stands for all, and the others are held."""
    for i in range(6, len(gradient), 3):
        normal[3, :] += normal[i, :]
        normal[:, 3] += normal[:, i]
        gradient[3] += gradient[i]
        gradient[i] = 0.0
        hold(normal, i)


@njit()
def solve(matrix: FloatArray, right: FloatArray) -> bool:
    """Solve a symmetric system in place; false if the matrix is not positive definite."""
    if not factor(matrix):
        return False
    substitute(matrix, right)
    return True


@njit()
def factor(matrix: FloatArray) -> bool:
    """Cholesky's lower triangle in place; false if the matrix is not positive definite."""
    for i in range(len(matrix)):
        for j in range(i + 1):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            if i == j:
                if not value > 0.0:
                    return False
                matrix[i, i] = np.sqrt(value)
            else:
                matrix[i, j] = value / matrix[j, j]
    return True


@njit()
def substitute(triangle: FloatArray, right: FloatArray) -> None:
    """Solve in place with the triangle of `factor`."""
    size = len(right)
    for i in range(size):
        for k in range(i):
            right[i] -= triangle[i, k] * right[k]
        right[i] /= triangle[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            right[i] -= triangle[k, i] * right[k]
        right[i] /= triangle[i, i]


@njit()
def inverse(
    normal: FloatArray, u: FloatArray, low: FloatArray, high: FloatArray, tied: bool
) -> tuple[FloatArray, FloatArray]:
    """Covariance of the unknowns at a noise of 1, and their standard errors.

    0 for what lies on its border; the error is infinite for what the data do not see (where is what has no height?),
    and for all if the rest can't be told apart.
    """
    size = len(u)
    covariance, error = np.zeros((size, size)), np.zeros(size)
    free, triangle = np.ones(size, np.bool_), normal.copy()
    for i in range(size):
        border, unseen = u[i] <= low[i] or u[i] >= high[i], not normal[i, i] > 0.0
        follows = tied and i > 3 and i % 3 == 0
        free[i] = not (border or unseen or follows)
        if unseen and not border:
            error[i] = np.inf
        if not free[i]:
            hold(triangle, i)
    if not factor(triangle):
        error[free] = np.inf
        free[:] = False
    for i in range(size):
        if free[i]:
            covariance[i, i] = 1.0
            substitute(triangle, covariance[i])
            error[i] = np.sqrt(covariance[i, i])
    if tied:
        for i in range(6, size, 3):
            covariance[i, :] = covariance[3, :]
            error[i] = error[3]
        for i in range(6, size, 3):
            covariance[:, i] = covariance[:, 3]
    return covariance, error
