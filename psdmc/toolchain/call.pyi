# Written by python -m psdmc.toolchain.stubs from psdmc/functions.
from typing import Generic, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from typing_extensions import TypeVar

from psdmc.toolchain.compiled_functions import CompiledFunctions

RealT = TypeVar("RealT", bound=np.floating, default=np.float64)

class InverseDynamicsDerivatives(NamedTuple, Generic[RealT]):
    dtau_dq: NDArray[RealT]
    dtau_dqd: NDArray[RealT]
    dtau_dqdd: NDArray[RealT]

class ForwardDynamicsDerivatives(NamedTuple, Generic[RealT]):
    qdd: NDArray[RealT]
    dqdd_dq: NDArray[RealT]
    dqdd_dqd: NDArray[RealT]
    dqdd_dtau: NDArray[RealT]

class ForwardKinematics(NamedTuple, Generic[RealT]):
    position: NDArray[RealT]
    rotation: NDArray[RealT]

class InverseDynamicsVjp(NamedTuple, Generic[RealT]):
    tau: NDArray[RealT]
    grad_q: NDArray[RealT]
    grad_qd: NDArray[RealT]
    grad_qdd: NDArray[RealT]

class InverseDynamicsVjpParameters(NamedTuple, Generic[RealT]):
    tau: NDArray[RealT]
    grad_q: NDArray[RealT]
    grad_qd: NDArray[RealT]
    grad_qdd: NDArray[RealT]
    grad_theta_b: NDArray[RealT]

class ForwardDynamicsVjp(NamedTuple, Generic[RealT]):
    qdd: NDArray[RealT]
    grad_q: NDArray[RealT]
    grad_qd: NDArray[RealT]
    grad_tau: NDArray[RealT]

class ForwardDynamicsVjpParameters(NamedTuple, Generic[RealT]):
    qdd: NDArray[RealT]
    grad_q: NDArray[RealT]
    grad_qd: NDArray[RealT]
    grad_tau: NDArray[RealT]
    grad_theta_b: NDArray[RealT]

class InverseDynamicsJvp(NamedTuple, Generic[RealT]):
    tau: NDArray[RealT]
    dtau: NDArray[RealT]

class ForwardDynamicsJvp(NamedTuple, Generic[RealT]):
    qdd: NDArray[RealT]
    dqdd: NDArray[RealT]

class GravityDerivatives(NamedTuple, Generic[RealT]):
    g: NDArray[RealT]
    dg_dq: NDArray[RealT]

class SemiImplicitEuler(NamedTuple, Generic[RealT]):
    q_next: NDArray[RealT]
    qd_next: NDArray[RealT]

class SemiImplicitEulerDerivatives(NamedTuple, Generic[RealT]):
    q_next: NDArray[RealT]
    qd_next: NDArray[RealT]
    A: NDArray[RealT]
    B: NDArray[RealT]

class Rk4Step(NamedTuple, Generic[RealT]):
    q_next: NDArray[RealT]
    qd_next: NDArray[RealT]

class Rk4StepDerivatives(NamedTuple, Generic[RealT]):
    q_next: NDArray[RealT]
    qd_next: NDArray[RealT]
    A: NDArray[RealT]
    B: NDArray[RealT]

class ConstrainedForwardDynamics(NamedTuple, Generic[RealT]):
    qdd: NDArray[RealT]
    forces: NDArray[RealT]

class ConstrainedForwardDynamicsDerivatives(NamedTuple, Generic[RealT]):
    qdd: NDArray[RealT]
    forces: NDArray[RealT]
    dqdd_dq: NDArray[RealT]
    dqdd_dqd: NDArray[RealT]
    dqdd_dtau: NDArray[RealT]
    dqdd_derror: NDArray[RealT]
    dforces_dq: NDArray[RealT]
    dforces_dqd: NDArray[RealT]
    dforces_dtau: NDArray[RealT]
    dforces_derror: NDArray[RealT]

class ConstrainedForwardDynamicsVjp(NamedTuple, Generic[RealT]):
    qdd: NDArray[RealT]
    forces: NDArray[RealT]
    grad_q: NDArray[RealT]
    grad_qd: NDArray[RealT]
    grad_tau: NDArray[RealT]
    grad_error: NDArray[RealT]

class ConstrainedForwardDynamicsVjpParameters(NamedTuple, Generic[RealT]):
    qdd: NDArray[RealT]
    forces: NDArray[RealT]
    grad_q: NDArray[RealT]
    grad_qd: NDArray[RealT]
    grad_tau: NDArray[RealT]
    grad_error: NDArray[RealT]
    grad_theta_b: NDArray[RealT]

class ConstrainedForwardDynamicsJvp(NamedTuple, Generic[RealT]):
    qdd: NDArray[RealT]
    forces: NDArray[RealT]
    dqdd: NDArray[RealT]
    dforces: NDArray[RealT]

class ContactInverseDynamics(NamedTuple, Generic[RealT]):
    tau: NDArray[RealT]
    forces: NDArray[RealT]

class Impulse(NamedTuple, Generic[RealT]):
    qd_after: NDArray[RealT]
    impulses: NDArray[RealT]

class ImpulseDerivatives(NamedTuple, Generic[RealT]):
    qd_after: NDArray[RealT]
    impulses: NDArray[RealT]
    dqd_after_dq: NDArray[RealT]
    dqd_after_dqd_before: NDArray[RealT]
    dimpulses_dq: NDArray[RealT]
    dimpulses_dqd_before: NDArray[RealT]

class ImpulseVjp(NamedTuple, Generic[RealT]):
    qd_after: NDArray[RealT]
    impulses: NDArray[RealT]
    grad_q: NDArray[RealT]
    grad_qd_before: NDArray[RealT]

class ImpulseVjpParameters(NamedTuple, Generic[RealT]):
    qd_after: NDArray[RealT]
    impulses: NDArray[RealT]
    grad_q: NDArray[RealT]
    grad_qd_before: NDArray[RealT]
    grad_theta_b: NDArray[RealT]

class ImpulseJvp(NamedTuple, Generic[RealT]):
    qd_after: NDArray[RealT]
    impulses: NDArray[RealT]
    dqd_after: NDArray[RealT]
    dimpulses: NDArray[RealT]

class FrameAccelerationDerivatives(NamedTuple, Generic[RealT]):
    da_dq: NDArray[RealT]
    da_dqd: NDArray[RealT]
    da_dqdd: NDArray[RealT]

class ComVelocityDerivatives(NamedTuple, Generic[RealT]):
    dv_dq: NDArray[RealT]
    dv_dqd: NDArray[RealT]

class ComAccelerationDerivatives(NamedTuple, Generic[RealT]):
    da_dq: NDArray[RealT]
    da_dqd: NDArray[RealT]
    da_dqdd: NDArray[RealT]

class CentroidalMomentumDerivatives(NamedTuple, Generic[RealT]):
    dh_dq: NDArray[RealT]
    dh_dqd: NDArray[RealT]

class CentroidalMomentumRateDerivatives(NamedTuple, Generic[RealT]):
    dhdot_dq: NDArray[RealT]
    dhdot_dqd: NDArray[RealT]
    dhdot_dqdd: NDArray[RealT]

class ForwardDynamicsWithWrenchesDerivatives(NamedTuple, Generic[RealT]):
    qdd: NDArray[RealT]
    dqdd_dq: NDArray[RealT]
    dqdd_dqd: NDArray[RealT]
    dqdd_dtau: NDArray[RealT]
    dqdd_dwrenches: NDArray[RealT]

class ForwardDynamicsWithWrenchesVjp(NamedTuple, Generic[RealT]):
    qdd: NDArray[RealT]
    grad_q: NDArray[RealT]
    grad_qd: NDArray[RealT]
    grad_tau: NDArray[RealT]
    grad_wrenches: NDArray[RealT]

class ForwardDynamicsWithWrenchesJvp(NamedTuple, Generic[RealT]):
    qdd: NDArray[RealT]
    dqdd: NDArray[RealT]

class InverseDynamicsWithWrenchesDerivatives(NamedTuple, Generic[RealT]):
    dtau_dq: NDArray[RealT]
    dtau_dqd: NDArray[RealT]
    dtau_dqdd: NDArray[RealT]
    dtau_dwrenches: NDArray[RealT]

class InverseDynamicsWithWrenchesVjp(NamedTuple, Generic[RealT]):
    tau: NDArray[RealT]
    grad_q: NDArray[RealT]
    grad_qd: NDArray[RealT]
    grad_qdd: NDArray[RealT]
    grad_wrenches: NDArray[RealT]

class InverseDynamicsWithWrenchesJvp(NamedTuple, Generic[RealT]):
    tau: NDArray[RealT]
    dtau: NDArray[RealT]

class PassiveMotion(NamedTuple, Generic[RealT]):
    qd_closed: NDArray[RealT]
    qdd_closed: NDArray[RealT]

class LoopInverseDynamics(NamedTuple, Generic[RealT]):
    tau: NDArray[RealT]
    loop_forces: NDArray[RealT]

class ConstrainedSemiImplicitEuler(NamedTuple, Generic[RealT]):
    q_next: NDArray[RealT]
    qd_next: NDArray[RealT]
    forces: NDArray[RealT]

class ConstrainedSemiImplicitEulerDerivatives(NamedTuple, Generic[RealT]):
    q_next: NDArray[RealT]
    qd_next: NDArray[RealT]
    forces: NDArray[RealT]
    A: NDArray[RealT]
    B: NDArray[RealT]
    B_error: NDArray[RealT]
    dforces_dq: NDArray[RealT]
    dforces_dqd: NDArray[RealT]
    dforces_dtau: NDArray[RealT]
    dforces_derror: NDArray[RealT]

class ConstrainedRk4Step(NamedTuple, Generic[RealT]):
    q_next: NDArray[RealT]
    qd_next: NDArray[RealT]
    forces: NDArray[RealT]

class CompiledRobot(CompiledFunctions, Generic[RealT]):
    def inverse_dynamics(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def inverse_dynamics_derivatives(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> InverseDynamicsDerivatives[RealT]: ...
    def forward_dynamics(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def forward_dynamics_derivatives(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> ForwardDynamicsDerivatives[RealT]: ...
    def mass_matrix(self, q: ArrayLike, theta_b: ArrayLike | None = None, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def mass_matrix_packed(self, q: ArrayLike, theta_b: ArrayLike | None = None, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def nonlinear_effects(self, q: ArrayLike, qd: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def coriolis_matrix(self, q: ArrayLike, qd: ArrayLike, theta_b: ArrayLike | None = None, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def gravity(self, q: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def regressor(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, gravity: ArrayLike | None = None, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def regressor_packed(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, gravity: ArrayLike | None = None, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def regressor_slotine_li(self, q: ArrayLike, qd: ArrayLike, qd_r: ArrayLike, qdd_r: ArrayLike, *, gravity: ArrayLike | None = None, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def jacobian(self, q: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def forward_kinematics(self, q: ArrayLike, *, out: tuple[NDArray[RealT], ...] | None = None) -> ForwardKinematics[RealT]: ...
    def frame_jacobian(self, q: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def jacobian_dot_qd(self, q: ArrayLike, qd: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def kinetic_energy(self, q: ArrayLike, qd: ArrayLike, theta_b: ArrayLike | None = None, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def potential_energy(self, q: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def momentum(self, q: ArrayLike, qd: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def inverse_dynamics_with_wrenches(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, wrenches: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def centre_of_mass(self, q: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def com_jacobian(self, q: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def centroidal_momentum_matrix(self, q: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def inverse_dynamics_vjp(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, cotangent: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> InverseDynamicsVjp[RealT]: ...
    def inverse_dynamics_vjp_parameters(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, cotangent: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> InverseDynamicsVjpParameters[RealT]: ...
    def forward_dynamics_vjp(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, cotangent: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> ForwardDynamicsVjp[RealT]: ...
    def forward_dynamics_vjp_parameters(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, cotangent: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> ForwardDynamicsVjpParameters[RealT]: ...
    def inverse_dynamics_jvp(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, dq: ArrayLike, dqd: ArrayLike, dqdd: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> InverseDynamicsJvp[RealT]: ...
    def forward_dynamics_jvp(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, dq: ArrayLike, dqd: ArrayLike, dtau: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> ForwardDynamicsJvp[RealT]: ...
    def mass_matrix_inverse(self, q: ArrayLike, theta_b: ArrayLike | None = None, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def gravity_derivatives(self, q: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> GravityDerivatives[RealT]: ...
    def frame_velocity_derivatives(self, q: ArrayLike, qd: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def inverse_dynamics_second_derivatives(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, cotangent: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def inverse_dynamics_second_derivatives_packed(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, cotangent: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def semi_implicit_euler(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, dt: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> SemiImplicitEuler[RealT]: ...
    def semi_implicit_euler_derivatives(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, dt: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> SemiImplicitEulerDerivatives[RealT]: ...
    def rk4_step(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, dt: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> Rk4Step[RealT]: ...
    def rk4_step_derivatives(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, dt: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> Rk4StepDerivatives[RealT]: ...
    def forward_dynamics_second_derivatives(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, cotangent: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def forward_dynamics_second_derivatives_packed(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, cotangent: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def neutral(self, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def integrate(self, q: ArrayLike, v: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def difference(self, q0: ArrayLike, q1: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def tangent_map(self, q: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def operational_space_inertia(self, q: ArrayLike, mu: ArrayLike, theta_b: ArrayLike | None = None, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def contact_jacobian(self, q: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def contact_jacobian_local(self, q: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def contact_drift(self, q: ArrayLike, qd: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def contact_drift_local(self, q: ArrayLike, qd: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def delassus(self, q: ArrayLike, theta_b: ArrayLike | None = None, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def contact_space_inertia(self, q: ArrayLike, active: ArrayLike, mu: ArrayLike = 0.0, theta_b: ArrayLike | None = None, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def constrained_forward_dynamics(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, active: ArrayLike, mu: ArrayLike = 0.0, kp: ArrayLike = 0.0, kd: ArrayLike = 0.0, error: ArrayLike = 0.0, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> ConstrainedForwardDynamics[RealT]: ...
    def constrained_forward_dynamics_derivatives(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, active: ArrayLike, mu: ArrayLike = 0.0, kp: ArrayLike = 0.0, kd: ArrayLike = 0.0, error: ArrayLike = 0.0, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> ConstrainedForwardDynamicsDerivatives[RealT]: ...
    def constrained_forward_dynamics_vjp(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, active: ArrayLike, cotangent_qdd: ArrayLike, cotangent_forces: ArrayLike, mu: ArrayLike = 0.0, kp: ArrayLike = 0.0, kd: ArrayLike = 0.0, error: ArrayLike = 0.0, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> ConstrainedForwardDynamicsVjp[RealT]: ...
    def constrained_forward_dynamics_vjp_parameters(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, active: ArrayLike, cotangent_qdd: ArrayLike, cotangent_forces: ArrayLike, mu: ArrayLike = 0.0, kp: ArrayLike = 0.0, kd: ArrayLike = 0.0, error: ArrayLike = 0.0, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> ConstrainedForwardDynamicsVjpParameters[RealT]: ...
    def constrained_forward_dynamics_jvp(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, active: ArrayLike, dq: ArrayLike, dqd: ArrayLike, dtau: ArrayLike, derror: ArrayLike, mu: ArrayLike = 0.0, kp: ArrayLike = 0.0, kd: ArrayLike = 0.0, error: ArrayLike = 0.0, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> ConstrainedForwardDynamicsJvp[RealT]: ...
    def contact_inverse_dynamics(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, active: ArrayLike, mu: ArrayLike = 0.0, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> ContactInverseDynamics[RealT]: ...
    def impulse(self, q: ArrayLike, qd_before: ArrayLike, active: ArrayLike, restitution: ArrayLike = 0.0, mu: ArrayLike = 0.0, theta_b: ArrayLike | None = None, *, out: tuple[NDArray[RealT], ...] | None = None) -> Impulse[RealT]: ...
    def impulse_derivatives(self, q: ArrayLike, qd_before: ArrayLike, active: ArrayLike, restitution: ArrayLike = 0.0, mu: ArrayLike = 0.0, theta_b: ArrayLike | None = None, *, out: tuple[NDArray[RealT], ...] | None = None) -> ImpulseDerivatives[RealT]: ...
    def impulse_vjp(self, q: ArrayLike, qd_before: ArrayLike, active: ArrayLike, cotangent_qd_after: ArrayLike, cotangent_impulses: ArrayLike, restitution: ArrayLike = 0.0, mu: ArrayLike = 0.0, theta_b: ArrayLike | None = None, *, out: tuple[NDArray[RealT], ...] | None = None) -> ImpulseVjp[RealT]: ...
    def impulse_vjp_parameters(self, q: ArrayLike, qd_before: ArrayLike, active: ArrayLike, cotangent_qd_after: ArrayLike, cotangent_impulses: ArrayLike, restitution: ArrayLike = 0.0, mu: ArrayLike = 0.0, theta_b: ArrayLike | None = None, *, out: tuple[NDArray[RealT], ...] | None = None) -> ImpulseVjpParameters[RealT]: ...
    def impulse_jvp(self, q: ArrayLike, qd_before: ArrayLike, active: ArrayLike, dq: ArrayLike, dqd_before: ArrayLike, restitution: ArrayLike = 0.0, mu: ArrayLike = 0.0, theta_b: ArrayLike | None = None, *, out: tuple[NDArray[RealT], ...] | None = None) -> ImpulseJvp[RealT]: ...
    def frame_jacobian_local(self, q: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def frame_acceleration(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def frame_acceleration_derivatives(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, out: tuple[NDArray[RealT], ...] | None = None) -> FrameAccelerationDerivatives[RealT]: ...
    def com_velocity(self, q: ArrayLike, qd: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def com_velocity_derivatives(self, q: ArrayLike, qd: ArrayLike, *, out: tuple[NDArray[RealT], ...] | None = None) -> ComVelocityDerivatives[RealT]: ...
    def com_acceleration(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def com_acceleration_derivatives(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, out: tuple[NDArray[RealT], ...] | None = None) -> ComAccelerationDerivatives[RealT]: ...
    def centroidal_momentum(self, q: ArrayLike, qd: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def centroidal_momentum_derivatives(self, q: ArrayLike, qd: ArrayLike, *, out: tuple[NDArray[RealT], ...] | None = None) -> CentroidalMomentumDerivatives[RealT]: ...
    def centroidal_momentum_rate(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def centroidal_momentum_rate_derivatives(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, out: tuple[NDArray[RealT], ...] | None = None) -> CentroidalMomentumRateDerivatives[RealT]: ...
    def forward_dynamics_with_wrenches(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, wrenches: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def forward_dynamics_with_wrenches_derivatives(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, wrenches: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> ForwardDynamicsWithWrenchesDerivatives[RealT]: ...
    def forward_dynamics_with_wrenches_vjp(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, wrenches: ArrayLike, cotangent: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> ForwardDynamicsWithWrenchesVjp[RealT]: ...
    def forward_dynamics_with_wrenches_jvp(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, wrenches: ArrayLike, dq: ArrayLike, dqd: ArrayLike, dtau: ArrayLike, dwrenches: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> ForwardDynamicsWithWrenchesJvp[RealT]: ...
    def inverse_dynamics_with_wrenches_derivatives(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, wrenches: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> InverseDynamicsWithWrenchesDerivatives[RealT]: ...
    def inverse_dynamics_with_wrenches_vjp(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, wrenches: ArrayLike, cotangent: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> InverseDynamicsWithWrenchesVjp[RealT]: ...
    def inverse_dynamics_with_wrenches_jvp(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, wrenches: ArrayLike, dq: ArrayLike, dqd: ArrayLike, dqdd: ArrayLike, dwrenches: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> InverseDynamicsWithWrenchesJvp[RealT]: ...
    def loop_error(self, q: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def loop_jacobian(self, q: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def loop_drift(self, q: ArrayLike, qd: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def passive_motion(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, out: tuple[NDArray[RealT], ...] | None = None) -> PassiveMotion[RealT]: ...
    def loop_inverse_dynamics(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> LoopInverseDynamics[RealT]: ...
    def assemble(self, q_guess: ArrayLike, *, out: NDArray[RealT] | None = None) -> NDArray[RealT]: ...
    def constrained_semi_implicit_euler(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, dt: ArrayLike, active: ArrayLike, mu: ArrayLike = 0.0, kp: ArrayLike = 0.0, kd: ArrayLike = 0.0, error: ArrayLike = 0.0, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> ConstrainedSemiImplicitEuler[RealT]: ...
    def constrained_semi_implicit_euler_derivatives(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, dt: ArrayLike, active: ArrayLike, mu: ArrayLike = 0.0, kp: ArrayLike = 0.0, kd: ArrayLike = 0.0, error: ArrayLike = 0.0, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> ConstrainedSemiImplicitEulerDerivatives[RealT]: ...
    def constrained_rk4_step(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, dt: ArrayLike, active: ArrayLike, mu: ArrayLike = 0.0, kp: ArrayLike = 0.0, kd: ArrayLike = 0.0, error: ArrayLike = 0.0, theta_b: ArrayLike | None = None, *, gravity: ArrayLike | None = None, out: tuple[NDArray[RealT], ...] | None = None) -> ConstrainedRk4Step[RealT]: ...
