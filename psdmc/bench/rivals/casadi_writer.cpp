// Writes C for one robot: Pinocchio's algorithms run on CasADi's symbols, printed by CasADi's code generator.
//
// usage: casadi_writer ROBOT.txt NAME FUNCTION...; writes NAME.c, NAME.txt: per function its multiplications and additions, and
// NAME.casadi: forward dynamics as CasADi's own file
#include <pinocchio/autodiff/casadi.hpp>

#include <fstream>
#include <pinocchio/algorithm/aba-derivatives.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include "pinocchio_model.hpp"
#include "serial_joints.hpp"

namespace {

using casadi::SX;

using Model = pinocchio::ModelTpl<SX, 0, SerialJoints>;
using Data = pinocchio::DataTpl<SX, 0, SerialJoints>;
using Vector = Eigen::Matrix<SX, Eigen::Dynamic, 1>;
using Matrix = Eigen::Matrix<SX, Eigen::Dynamic, Eigen::Dynamic>;

/// Row-major, as psdmc puts matrices out.
SX column(const Matrix &matrix) {
  SX all(matrix.size(), 1);
  for (Eigen::Index row = 0; row < matrix.rows(); ++row)
    for (Eigen::Index k = 0; k < matrix.cols(); ++k) all(row * matrix.cols() + k) = matrix(row, k);
  return casadi::SX::densify(all);
}

SX row_major(const SX &matrix) { return casadi::SX::densify(SX::vec(matrix.T())); }

/// The matrix whose upper triangle is given.
Matrix symmetric(Matrix M) {
  for (Eigen::Index i = 0; i < M.rows(); ++i)
    for (Eigen::Index j = 0; j < i; ++j) M(i, j) = M(j, i);
  return M;
}

/// x with A x = b, A symmetric and positive definite: unrolled A = L D L^T, from the last joint to the first.
Vector solved(Matrix A, Vector b) {
  const auto n = A.rows();
  for (Eigen::Index k = n - 1; k > 0; --k)
    for (Eigen::Index i = k - 1; i >= 0; --i) {
      const SX factor = A(i, k) / A(k, k);
      for (Eigen::Index j = i; j >= 0; --j) A(j, i) -= factor * A(j, k);
      b(i) -= factor * b(k);
      A(k, i) = factor;
    }
  for (Eigen::Index i = 0; i < n; ++i) {
    b(i) /= A(i, i);
    for (Eigen::Index j = 0; j < i; ++j) b(i) -= A(i, j) * b(j);
  }
  return b;
}

/// Multiplications, and additions with subtractions and divisions, as psdmc counts its own.
std::string operations(const casadi::Function &f) {
  int mul = 0, add = 0;
  for (casadi_int k = 0; k < f.n_instructions(); ++k) switch (f.instruction_id(k)) {
      case casadi::OP_MUL:
      case casadi::OP_SQ:
        ++mul;
        break;
      case casadi::OP_ADD:
      case casadi::OP_SUB:
      case casadi::OP_TWICE:
      case casadi::OP_DIV:
      case casadi::OP_INV:
        ++add;
    }
  return f.name() + " " + std::to_string(mul) + " " + std::to_string(add);
}

/// The two files that grow function by function.
struct Generated {
  casadi::CodeGenerator code;
  std::ofstream counts;

  explicit Generated(const std::string &name)
      : code(name, {{"with_header", false}, {"casadi_int", "int"}}), counts(name + ".txt") {}

  void add(const casadi::Function &function) {
    code.add(function);
    counts << operations(function) << "\n";
  }

  void generate() { code.generate(); }
};

struct Writer {
  Model model;
  SX q, qd, x, cotangent;
  Vector q_, qd_, x_;

  explicit Writer(std::istream &robot) {
    read_model(robot, model);
    const auto n = model.nv;
    q = SX::sym("q", model.nq), qd = SX::sym("qd", n), x = SX::sym("x", n);
    cotangent = SX::sym("cotangent", n);
    q_.resize(model.nq), qd_.resize(n), x_.resize(n);
    for (int i = 0; i < model.nq; ++i) q_(i) = q(i);
    for (int i = 0; i < n; ++i) qd_(i) = qd(i), x_(i) = x(i);
  }

  casadi::Function function(const std::string &name, const Matrix &output) const { return function(name, column(output)); }

  casadi::Function function(const std::string &name, const SX &output) const {
    return casadi::Function(name, {q, qd, x}, {cse(output)});
  }

  /// Reverse mode: `output`, and the gradients of cotangent . output by q, qd and x.
  casadi::Function vjp(const std::string &name, const Vector &output) const {
    const SX value = column(output);
    std::vector<SX> all{value};
    for (const SX &input : {q, qd, x}) all.push_back(SX::jtimes(value, input, cotangent, true));
    return casadi::Function(name, {q, qd, x, cotangent}, {cse(SX::vertcat(all))});
  }

  /// The derivatives of `output` by each of `inputs`, behind each other.
  static SX jacobians(const Vector &output, const std::vector<SX> &inputs) {
    std::vector<SX> all;
    for (const SX &input : inputs) all.push_back(row_major(SX::jacobian(column(output), input)));
    return SX::vertcat(all);
  }

  /// CasADi differentiates Pinocchio's rnea.
  SX inverse_dynamics_jacobian() const {
    Data data(model);
    return jacobians(pinocchio::rnea(model, data, q_, qd_, x_), {q, qd, x});
  }

  /// Pinocchio's own recursion on CasADi's symbols.
  SX inverse_dynamics_recursion() const {
    Data data(model);
    pinocchio::computeRNEADerivatives(model, data, q_, qd_, x_);
    return SX::vertcat({column(data.dtau_dq), column(data.dtau_dv), column(symmetric(data.M))});
  }

  SX forward_dynamics_jacobian() const {
    const Vector accelerations = solved(mass_matrix(), x_ - nonlinear_effects());
    return SX::vertcat({column(accelerations), jacobians(accelerations, {q, qd, x})});
  }

  SX forward_dynamics_recursion() const {
    Data data(model);
    pinocchio::computeABADerivatives(model, data, q_, qd_, x_);
    const Matrix by_q = data.ddq_dq, by_qd = data.ddq_dv;
    return SX::vertcat({column(data.ddq), column(by_q), column(by_qd), column(symmetric(data.Minv))});
  }

  Matrix mass_matrix() const {
    Data data(model);
    pinocchio::crba(model, data, q_, pinocchio::Convention::LOCAL);
    return symmetric(data.M);
  }

  Matrix inverse_of_mass_matrix() const {
    Data data(model);
    pinocchio::computeMinverse(model, data, q_);
    return symmetric(data.Minv);
  }

  Vector nonlinear_effects() const {
    Data data(model);
    return pinocchio::nonLinearEffects(model, data, q_, qd_);
  }

  /// One function by its name.
  casadi::Function made(const std::string &name) const {
    Data data(model);
    if (name == "inverse_dynamics") return function(name, pinocchio::rnea(model, data, q_, qd_, x_));
    if (name == "forward_dynamics_aba") return function(name, pinocchio::aba(model, data, q_, qd_, x_));
    if (name == "forward_dynamics_ldl") return function(name, solved(mass_matrix(), x_ - nonlinear_effects()));
    if (name == "mass_matrix") return function(name, mass_matrix());
    if (name == "mass_matrix_inverse") return function(name, inverse_of_mass_matrix());
    if (name == "nonlinear_effects") return function(name, nonlinear_effects());
    if (name == "gravity") return function(name, pinocchio::computeGeneralizedGravity(model, data, q_));
    if (name == "regressor") return function(name, pinocchio::computeJointTorqueRegressor(model, data, q_, qd_, x_));
    if (name == "inverse_dynamics_derivatives_jacobian") return function(name, inverse_dynamics_jacobian());
    if (name == "inverse_dynamics_derivatives_recursion") return function(name, inverse_dynamics_recursion());
    if (name == "forward_dynamics_derivatives_jacobian") return function(name, forward_dynamics_jacobian());
    if (name == "forward_dynamics_derivatives_recursion") return function(name, forward_dynamics_recursion());
    if (name == "inverse_dynamics_vjp") return vjp(name, pinocchio::rnea(model, data, q_, qd_, x_));
    if (name == "forward_dynamics_vjp_aba") return vjp(name, pinocchio::aba(model, data, q_, qd_, x_));
    if (name == "forward_dynamics_vjp_ldl") return vjp(name, solved(mass_matrix(), x_ - nonlinear_effects()));
    throw std::invalid_argument("no function " + name);
  }

  void write(const std::string &name, const std::vector<std::string> &wanted) const {
    Data data(model);
    Generated code(name);
    for (const auto &each : wanted) code.add(made(each));
    code.generate();
    function("forward_dynamics", Matrix(pinocchio::aba(model, data, q_, qd_, x_))).save(name + ".casadi");
  }
};

}  // namespace

int main(int count, char **arguments) {
  if (count < 3) return 2;
  std::ifstream text(arguments[1]);
  Writer(text).write(arguments[2], {arguments + 3, arguments + count});
  return 0;
}
