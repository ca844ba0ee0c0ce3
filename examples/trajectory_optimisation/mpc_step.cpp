// A model-predictive controller's step for a 1 kHz loop, on an emitted package: no allocation, nothing but the package.
//
//     psdmc emit-c kr6.npz -o package --name robot --functions gravity,forward_dynamics,forward_dynamics_derivatives
//     make -C package NATIVE=1
//     g++ -std=c++17 -O3 -march=native -Ipackage/include mpc_step.cpp package/build/librobot.a -lm -o mpc && ./mpc
//
// Every millisecond one Gauss-Newton iteration from the measured state: the last inputs are rolled out, one batch call gives
// the Jacobians of all nodes, a Riccati recursion gives better inputs, the first is applied.
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdio>

#include <robot/robot.hpp>

using robot::Robot;
constexpr std::size_t n = Robot::dof, nodes = 20;
constexpr double node_seconds = 0.01, tick_seconds = 0.001;

template <std::size_t rows, std::size_t columns>
struct Matrix {
    std::array<double, rows * columns> values{};
    double &operator()(std::size_t i, std::size_t j) { return values[i * columns + j]; }
    double operator()(std::size_t i, std::size_t j) const { return values[i * columns + j]; }
};

/// to += a b, or a^T b where `transposed`.
template <bool transposed = false, std::size_t r, std::size_t c, std::size_t ar, std::size_t ac, std::size_t br>
void add_product(const Matrix<ar, ac> &a, const Matrix<br, c> &b, Matrix<r, c> &to) {
    for (std::size_t i = 0; i < r; ++i)
        for (std::size_t k = 0; k < br; ++k) {
            const double factor = transposed ? a(k, i) : a(i, k);
            for (std::size_t j = 0; j < c; ++j) to(i, j) += factor * b(k, j);
        }
}

/// b = A^-1 b, A symmetric and positive definite; both are overwritten.
template <std::size_t c>
void solve(Matrix<n, n> &A, Matrix<n, c> &b) {
    for (std::size_t k = 0; k < n; ++k)
        for (std::size_t i = k + 1; i < n; ++i) {
            const double factor = A(i, k) / A(k, k);
            for (std::size_t j = k; j < n; ++j) A(i, j) -= factor * A(k, j);
            for (std::size_t j = 0; j < c; ++j) b(i, j) -= factor * b(k, j);
        }
    for (std::size_t k = n; k-- > 0;)
        for (std::size_t j = 0; j < c; ++j) {
            for (std::size_t i = k + 1; i < n; ++i) b(k, j) -= A(k, i) * b(i, j);
            b(k, j) /= A(k, k);
        }
}

using Joints = std::array<double, n>;
using State = Matrix<2 * n, 1>;  // q, then qd

/// One step of semi-implicit Euler; false where the mass matrix is not positive definite.
bool advance(State &x, const Joints &tau, double dt) {
    Joints qdd;
    if (Robot::forward_dynamics(x.values.data(), x.values.data() + n, tau.data(), qdd.data())) return false;
    for (std::size_t i = 0; i < n; ++i) {
        x(n + i, 0) += dt * qdd[i];
        x(i, 0) += dt * x(n + i, 0);
    }
    return true;
}

struct Controller {
    State goal;
    Joints holding;                    // torques that hold the goal
    std::array<Joints, nodes> inputs;  // of the last step
    double position = 100.0, rate = 0.5, effort = 1e-3, final = 1.0;

    explicit Controller(const Joints &where) {
        for (std::size_t i = 0; i < n; ++i) goal(i, 0) = where[i];
        Robot::gravity(where.data(), holding.data());
        inputs.fill(holding);
    }

    double weight(std::size_t i) const { return i < n ? position : rate; }

    /// The torques for the next millisecond.
    Joints step(const State &measured) {
        std::array<State, nodes + 1> x{measured};
        std::array<double, nodes * n> q, qd, tau, qdd;
        for (std::size_t k = 0; k < nodes; ++k) {
            for (std::size_t i = 0; i < n; ++i)
                q[k * n + i] = x[k](i, 0), qd[k * n + i] = x[k](n + i, 0), tau[k * n + i] = inputs[k][i];
            x[k + 1] = x[k];
            if (!advance(x[k + 1], inputs[k], node_seconds)) return holding;
        }
        static thread_local std::array<double, nodes * n * n> by_q, by_qd, by_tau;
        if (Robot::forward_dynamics_derivatives_batch(nodes, q.data(), qd.data(), tau.data(), qdd.data(), by_q.data(),
                                                      by_qd.data(), by_tau.data()))
            return holding;

        Matrix<2 * n, 2 * n> curve;
        State slope;
        for (std::size_t i = 0; i < 2 * n; ++i) {
            curve(i, i) = final * weight(i);
            slope(i, 0) = curve(i, i) * (x[nodes](i, 0) - goal(i, 0));
        }
        for (std::size_t k = nodes; k-- > 0;) {
            Matrix<2 * n, 2 * n> A;
            Matrix<2 * n, n> B;
            for (std::size_t i = 0; i < n; ++i)
                for (std::size_t j = 0; j < n; ++j) {
                    const std::size_t at = (k * n + i) * n + j;
                    const double same = i == j ? 1.0 : 0.0, dt = node_seconds;
                    A(n + i, j) = dt * by_q[at], A(n + i, n + j) = same + dt * by_qd[at], B(n + i, j) = dt * by_tau[at];
                    A(i, j) = same + dt * A(n + i, j), A(i, n + j) = dt * A(n + i, n + j), B(i, j) = dt * B(n + i, j);
                }
            Matrix<2 * n, n> half;
            Matrix<2 * n, 2 * n> full, after;
            add_product(curve, B, half);
            add_product(curve, A, full);
            Matrix<n, n> uu;
            Matrix<n, 2 * n> back;
            Matrix<n, 1> feed;
            for (std::size_t i = 0; i < n; ++i) {
                uu(i, i) = node_seconds * effort;
                feed(i, 0) = uu(i, i) * (inputs[k][i] - holding[i]);
            }
            add_product<true>(B, half, uu);
            add_product<true>(half, A, back);
            add_product<true>(B, slope, feed);
            const Matrix<n, 2 * n> ux = back;
            const Matrix<n, n> kept = uu;
            solve(uu, back);
            uu = kept;
            solve(uu, feed);
            for (std::size_t i = 0; i < 2 * n; ++i) after(i, i) = node_seconds * weight(i);
            add_product<true>(A, full, after);
            State before;
            for (std::size_t i = 0; i < 2 * n; ++i) {
                before(i, 0) = node_seconds * weight(i) * (x[k](i, 0) - goal(i, 0));
                for (std::size_t a = 0; a < n; ++a) {
                    before(i, 0) -= ux(a, i) * feed(a, 0);
                    for (std::size_t j = 0; j < 2 * n; ++j) after(i, j) -= ux(a, i) * back(a, j);
                }
            }
            add_product<true>(A, slope, before);
            curve = after;
            slope = before;
            feeds[k] = feed;
            backs[k] = back;
        }
        State now = measured;
        for (std::size_t k = 0; k < nodes; ++k) {
            for (std::size_t i = 0; i < n; ++i) {
                inputs[k][i] -= feeds[k](i, 0);
                for (std::size_t j = 0; j < 2 * n; ++j) inputs[k][i] -= backs[k](i, j) * (now(j, 0) - x[k](j, 0));
            }
            if (!advance(now, inputs[k], node_seconds)) return holding;
        }
        return inputs[0];
    }

  private:
    std::array<Matrix<n, 1>, nodes> feeds;
    std::array<Matrix<n, 2 * n>, nodes> backs;
};

int main() {
    Joints goal;
    for (std::size_t i = 0; i < n; ++i) goal[i] = i % 2 ? -0.3 : 0.3;
    static Controller controller(goal);
    State x;
    double slowest = 0.0, total = 0.0;
    constexpr int ticks = 1500;
    for (int tick = 0; tick < ticks; ++tick) {
        const auto begin = std::chrono::steady_clock::now();
        const Joints tau = controller.step(x);
        const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - begin;
        total += took.count();
        slowest = took.count() > slowest ? took.count() : slowest;
        if (!advance(x, tau, tick_seconds)) return 1;
    }
    double away = 0.0;
    for (std::size_t i = 0; i < n; ++i) away = std::fmax(away, std::fabs(x(i, 0) - goal[i]));
    std::printf("largest error after %.1f s: %.2e rad\n", ticks * tick_seconds, away);
    std::printf("a step: %.1f us on average, %.1f us at most\n", total / ticks, slowest);
    return away < 1e-3 ? 0 : 1;
}
