# Written by python -m psdmc.toolchain.stubs from psdmc/functions.
from typing import Any, NamedTuple

from numpy.typing import ArrayLike, NDArray

from psdmc.toolchain.compiled_functions import CompiledFunctions

Array = NDArray[Any]

class InverseDynamicsDerivatives(NamedTuple):
    dtau_dq: Array
    dtau_dqd: Array
    dtau_dqdd: Array

class ForwardDynamicsDerivatives(NamedTuple):
    qdd: Array
    dqdd_dq: Array
    dqdd_dqd: Array
    dqdd_dtau: Array

class ForwardKinematics(NamedTuple):
    position: Array
    rotation: Array

class InverseDynamicsVjp(NamedTuple):
    tau: Array
    grad_q: Array
    grad_qd: Array
    grad_qdd: Array

class InverseDynamicsVjpParameters(NamedTuple):
    tau: Array
    grad_q: Array
    grad_qd: Array
    grad_qdd: Array
    grad_theta_b: Array

class ForwardDynamicsVjp(NamedTuple):
    qdd: Array
    grad_q: Array
    grad_qd: Array
    grad_tau: Array

class ForwardDynamicsVjpParameters(NamedTuple):
    qdd: Array
    grad_q: Array
    grad_qd: Array
    grad_tau: Array
    grad_theta_b: Array

class InverseDynamicsJvp(NamedTuple):
    tau: Array
    dtau: Array

class ForwardDynamicsJvp(NamedTuple):
    qdd: Array
    dqdd: Array

class GravityDerivatives(NamedTuple):
    g: Array
    dg_dq: Array

class SemiImplicitEuler(NamedTuple):
    q_next: Array
    qd_next: Array

class SemiImplicitEulerDerivatives(NamedTuple):
    q_next: Array
    qd_next: Array
    A: Array
    B: Array

class Rk4Step(NamedTuple):
    q_next: Array
    qd_next: Array

class Rk4StepDerivatives(NamedTuple):
    q_next: Array
    qd_next: Array
    A: Array
    B: Array

class CompiledRobot(CompiledFunctions):
    def inverse_dynamics(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, theta_b: ArrayLike | None = None) -> Array: ...
    def inverse_dynamics_derivatives(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, theta_b: ArrayLike | None = None) -> InverseDynamicsDerivatives: ...
    def forward_dynamics(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, theta_b: ArrayLike | None = None) -> Array: ...
    def forward_dynamics_derivatives(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, theta_b: ArrayLike | None = None) -> ForwardDynamicsDerivatives: ...
    def mass_matrix(self, q: ArrayLike, theta_b: ArrayLike | None = None) -> Array: ...
    def nonlinear_effects(self, q: ArrayLike, qd: ArrayLike, theta_b: ArrayLike | None = None) -> Array: ...
    def coriolis_matrix(self, q: ArrayLike, qd: ArrayLike, theta_b: ArrayLike | None = None) -> Array: ...
    def gravity(self, q: ArrayLike, theta_b: ArrayLike | None = None) -> Array: ...
    def regressor(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array: ...
    def regressor_slotine_li(self, q: ArrayLike, qd: ArrayLike, qd_r: ArrayLike, qdd_r: ArrayLike) -> Array: ...
    def jacobian(self, q: ArrayLike) -> Array: ...
    def forward_kinematics(self, q: ArrayLike) -> ForwardKinematics: ...
    def frame_jacobian(self, q: ArrayLike) -> Array: ...
    def jacobian_dot_qd(self, q: ArrayLike, qd: ArrayLike) -> Array: ...
    def kinetic_energy(self, q: ArrayLike, qd: ArrayLike, theta_b: ArrayLike | None = None) -> Array: ...
    def potential_energy(self, q: ArrayLike, theta_b: ArrayLike | None = None) -> Array: ...
    def momentum(self, q: ArrayLike, qd: ArrayLike) -> Array: ...
    def inverse_dynamics_with_wrenches(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, wrenches: ArrayLike, theta_b: ArrayLike | None = None) -> Array: ...
    def centre_of_mass(self, q: ArrayLike) -> Array: ...
    def com_jacobian(self, q: ArrayLike) -> Array: ...
    def centroidal_momentum_matrix(self, q: ArrayLike) -> Array: ...
    def inverse_dynamics_vjp(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, cotangent: ArrayLike, theta_b: ArrayLike | None = None) -> InverseDynamicsVjp: ...
    def inverse_dynamics_vjp_parameters(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, cotangent: ArrayLike, theta_b: ArrayLike | None = None) -> InverseDynamicsVjpParameters: ...
    def forward_dynamics_vjp(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, cotangent: ArrayLike, theta_b: ArrayLike | None = None) -> ForwardDynamicsVjp: ...
    def forward_dynamics_vjp_parameters(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, cotangent: ArrayLike, theta_b: ArrayLike | None = None) -> ForwardDynamicsVjpParameters: ...
    def inverse_dynamics_jvp(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, dq: ArrayLike, dqd: ArrayLike, dqdd: ArrayLike, theta_b: ArrayLike | None = None) -> InverseDynamicsJvp: ...
    def forward_dynamics_jvp(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, dq: ArrayLike, dqd: ArrayLike, dtau: ArrayLike, theta_b: ArrayLike | None = None) -> ForwardDynamicsJvp: ...
    def mass_matrix_inverse(self, q: ArrayLike, theta_b: ArrayLike | None = None) -> Array: ...
    def gravity_derivatives(self, q: ArrayLike, theta_b: ArrayLike | None = None) -> GravityDerivatives: ...
    def frame_velocity_derivatives(self, q: ArrayLike, qd: ArrayLike) -> Array: ...
    def semi_implicit_euler(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, dt: ArrayLike, theta_b: ArrayLike | None = None) -> SemiImplicitEuler: ...
    def semi_implicit_euler_derivatives(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, dt: ArrayLike, theta_b: ArrayLike | None = None) -> SemiImplicitEulerDerivatives: ...
    def rk4_step(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, dt: ArrayLike, theta_b: ArrayLike | None = None) -> Rk4Step: ...
    def rk4_step_derivatives(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, dt: ArrayLike, theta_b: ArrayLike | None = None) -> Rk4StepDerivatives: ...
