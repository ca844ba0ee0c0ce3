// Dynamics with contacts: psdmc's C and Pinocchio's C++, in one program. benchmarks/contacts.py writes the input and
// compiles this file with the package `robot`.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <functional>
#include <iostream>
#include <vector>

#include <pinocchio/algorithm/constrained-dynamics-derivatives.hpp>
#include <pinocchio/algorithm/constrained-dynamics.hpp>
#include <pinocchio/algorithm/contact-dynamics.hpp>
#include <pinocchio/algorithm/proximal.hpp>

#include "pinocchio_model.hpp"

// The functions of the package, of a robot that the C++ compiler need not know.
extern "C" int robot_constrained_forward_dynamics(const double *q, const double *qd, const double *tau, const double *active,
                                                  const double *mu, const double *kp, const double *kd,
                                                  const double *error, double *qdd, double *forces);
extern "C" int robot_constrained_forward_dynamics_derivatives(
    const double *q, const double *qd, const double *tau, const double *active, const double *mu, const double *kp,
    const double *kd, const double *error, double *qdd, double *forces, double *dqdd_dq, double *dqdd_dqd,
    double *dqdd_dtau, double *dqdd_derror, double *dforces_dq, double *dforces_dqd, double *dforces_dtau,
    double *dforces_derror);

namespace pin = pinocchio;
using Clock = std::chrono::steady_clock;
using Contacts = std::vector<pin::RigidConstraintModel, Eigen::aligned_allocator<pin::RigidConstraintModel>>;
using Datas = std::vector<pin::RigidConstraintData, Eigen::aligned_allocator<pin::RigidConstraintData>>;

constexpr std::size_t BLOCK = 512;

struct Own {
  std::vector<double> qdd, forces, qdd_q, qdd_qd, qdd_tau, qdd_error, forces_q, forces_qd, forces_tau, forces_error;
};

/// The state and the results of Pinocchio for one choice of active contacts.
struct Theirs {
  pin::Model &model;
  pin::Data data;
  Contacts contacts;
  Datas datas;
  pin::ProximalSettings settings{1e-12, 0.0, 1};

  Theirs(pin::Model &robot, Contacts active) : model(robot), data(robot), contacts(std::move(active)) {
    for (const auto &each : contacts) datas.emplace_back(each);
    pin::initConstraintDynamics(model, data, contacts, datas);
  }
  void values(const Eigen::VectorXd &q, const Eigen::VectorXd &v, const Eigen::VectorXd &tau) {
    pin::constraintDynamics(model, data, q, v, tau, contacts, datas, settings);
  }
  void derivatives(const Eigen::VectorXd &q, const Eigen::VectorXd &v, const Eigen::VectorXd &tau) {
    values(q, v, tau);
    pin::computeConstraintDynamicsDerivatives(model, data, contacts, datas, settings);
  }
};

/// The median, over blocks of all rounds, of nanoseconds per call.
double median(std::vector<double> times) {
  std::nth_element(times.begin(), times.begin() + times.size() / 2, times.end());
  return times[times.size() / 2];
}

void timed(std::size_t count, std::vector<double> &times, const std::function<void(std::size_t)> &call) {
  for (std::size_t first = 0; first + BLOCK <= count; first += BLOCK) {
    const auto start = Clock::now();
    for (std::size_t k = first; k < first + BLOCK; ++k) call(k);
    times.push_back(std::chrono::duration<double, std::nano>(Clock::now() - start).count() / BLOCK);
  }
}

int main(int, char **arguments) {
  std::ifstream text(arguments[1]);
  pin::Model model;
  read_model(text, model);
  std::size_t number, count, rounds;
  text >> number;
  Contacts all;
  std::vector<std::size_t> rows;
  for (std::size_t k = 0; k < number; ++k) {
    std::size_t joint, own;
    Eigen::Matrix3d rotation;
    Eigen::Vector3d translation;
    text >> joint >> own;
    for (int i = 0; i < 9; ++i) text >> rotation(i / 3, i % 3);
    for (int i = 0; i < 3; ++i) text >> translation(i);
    const auto type = own == 3 ? pin::CONTACT_3D : pin::CONTACT_6D;
    all.emplace_back(type, model, joint, pin::SE3(rotation, translation), pin::LOCAL);
    rows.push_back(own);
  }
  text >> count >> rounds;
  std::vector<Eigen::VectorXd> q, v, tau;
  const auto read = [&text](std::vector<Eigen::VectorXd> &to, Eigen::Index size) {
    to.emplace_back(size);
    for (Eigen::Index i = 0; i < size; ++i) text >> to.back()[i];
  };
  for (std::size_t k = 0; k < count; ++k) read(q, model.nq), read(v, model.nv), read(tau, model.nv);
  if (!text) return 1;

  std::size_t m = 0;
  for (const auto own : rows) m += own;
  const std::size_t n = model.nv;
  Own o{std::vector<double>(n), std::vector<double>(m), std::vector<double>(n * n), std::vector<double>(n * n),
        std::vector<double>(n * n), std::vector<double>(n * m), std::vector<double>(m * n), std::vector<double>(m * n),
        std::vector<double>(m * n), std::vector<double>(m * m)};
  const std::vector<double> error(m, 0.0);
  const double zero = 0.0;
  // All contacts, every second, none.
  for (int mask = 0; mask < 3; ++mask) {
    std::vector<double> active(number, 0.0);
    Contacts chosen;
    for (std::size_t k = 0; k < number; ++k)
      if (mask == 0 || (mask == 1 && k % 2 == 0)) active[k] = 1.0, chosen.push_back(all[k]);
    Theirs theirs(model, chosen);
    const auto own_values = [&](std::size_t k) {
      robot_constrained_forward_dynamics(q[k].data(), v[k].data(), tau[k].data(), active.data(), &zero, &zero, &zero,
                                         error.data(), o.qdd.data(), o.forces.data());
    };
    const auto own_derivatives = [&](std::size_t k) {
      robot_constrained_forward_dynamics_derivatives(
          q[k].data(), v[k].data(), tau[k].data(), active.data(), &zero, &zero, &zero, error.data(), o.qdd.data(),
          o.forces.data(), o.qdd_q.data(), o.qdd_qd.data(), o.qdd_tau.data(), o.qdd_error.data(), o.forces_q.data(),
          o.forces_qd.data(), o.forces_tau.data(), o.forces_error.data());
    };
    // Pinocchio prescribes the spatial acceleration of a surface, psdmc the classical one: they are equal at rest.
    const bool at_rest = std::any_of(rows.begin(), rows.end(), [](std::size_t own) { return own == 6; });
    double worst = 0.0, worst_slope = 0.0;
    for (std::size_t k = 0; k < count; k += 37) {
      const Eigen::VectorXd kept = v[k];
      if (at_rest) v[k].setZero();
      own_derivatives(k);
      theirs.derivatives(q[k], v[k], tau[k]);
      v[k] = kept;
      const Eigen::Map<Eigen::VectorXd> qdd(o.qdd.data(), n);
      using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
      const Eigen::Map<RowMajor> slope(o.qdd_q.data(), n, n);
      worst = std::max(worst, (qdd - theirs.data.ddq).cwiseAbs().maxCoeff() / theirs.data.ddq.cwiseAbs().maxCoeff());
      worst_slope = std::max(worst_slope, (slope - theirs.data.ddq_dq).cwiseAbs().maxCoeff() /
                                              theirs.data.ddq_dq.cwiseAbs().maxCoeff());
    }
    std::vector<double> times[4];
    for (std::size_t round = 0; round < rounds; ++round) {
      timed(count, times[0], own_values);
      timed(count, times[1], [&](std::size_t k) { theirs.values(q[k], v[k], tau[k]); });
      timed(count, times[2], own_derivatives);
      timed(count, times[3], [&](std::size_t k) { theirs.derivatives(q[k], v[k], tau[k]); });
    }
    std::printf("%d %.17g %.17g", mask, worst, worst_slope);
    for (auto &each : times) std::printf(" %.17g", median(each));
    std::printf("\n");
  }
  return 0;
}
