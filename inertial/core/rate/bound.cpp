#include "rate/bound.hpp"

namespace gyrofree::rate {
namespace {

constexpr int EVERY_BOUND = 8;        // samples
constexpr double KNOWN_RATE = 1e-10;  // (rad/s)^2, of a body known to stand
constexpr double NO_GATE = std::numeric_limits<double>::infinity();

// -C_bn g_n: what a body at rest feels.
Vector3 felt_at_rest(const Quaternion& q_nb) {
  return to_matrix(q_nb).transpose() * Vector3(0.0, 0.0, -GRAVITY);
}

StateVector state_of(const Vector3& omega, const Vector3& up) {
  StateVector x = StateVector::Zero();
  x.segment<3>(OMEGA) = omega;
  x.segment<3>(LIFT) = up;
  return x;
}

// Information alone: what is seen is what was expected.
template <int M>
void inform(Covariance& P, Seen<M> seen) {
  StateVector x = StateVector::Zero();
  seen.y.setZero();
  absorb(x, P, seen, NO_GATE);
}

}  // namespace

// What is known after the first standstill; tilt and bias of p are known together, not apart.
void Bound::begin(const Sensor& s, const Knowledge& what, const Vector3& up) {
  const Matrix3 across = Matrix3::Identity() - up * up.transpose() / (GRAVITY * GRAVITY);
  P_.setZero();
  add_to_biases(P_, s.drift, what.biases);
  P_.block<3, 3>(OMEGA, OMEGA) = KNOWN_RATE * Matrix3::Identity();
  P_.block<3, 3>(PIVOT, PIVOT) = what.pivot * Matrix3::Identity();
  P_.block<3, 3>(LIFT, LIFT) = what.tilt * across;
  P_.block<3, 3>(BIAS_FORCE, BIAS_FORCE) = what.bias * s.drift.block<3, 3>(FORCE_M, FORCE_M);
  Seen<3> together;  // of u and the bias of p, which are not tied to anything else yet
  together.y.setZero();
  together.PHt.setZero();
  together.PHt.middleRows<3>(LIFT) = P_.block<3, 3>(LIFT, LIFT);
  together.PHt.middleRows<3>(BIAS_FORCE) = P_.block<3, 3>(BIAS_FORCE, BIAS_FORCE);
  together.C = P_.block<3, 3>(LIFT, LIFT) + P_.block<3, 3>(BIAS_FORCE, BIAS_FORCE) + s.R_p * what.share;
  inform(P_, together);
  known_ = true;
}

void Bound::move(const Sensor& s, const Knowledge& what, const Motion& motion, const Vector3& up) {
  const bool fixed = square_of(motion.omega_b) > what.axis_from, turning = !motion.still;
  const double dt = EVERY_BOUND * motion.dt;
  const Drive drive{motion.alpha_b, along_axis(motion.omega_b, fixed, turning), dt, turning, Vector3::Zero()};
  StateVector x = state_of(motion.omega_b, up);
  predict(x, P_, drive, s);
  if (!turning) return;
  const Matrix3& N = drive.along.N;  // noise of all samples between two steps
  P_.block<3, 3>(OMEGA, OMEGA) += EVERY_BOUND * motion.dt * motion.dt * (N * s.R_alpha * N) +
                                  what.wander * dt * (Matrix3::Identity() - N);
}

void Bound::see(const Sensor& s, const Knowledge& what, const Motion& motion, const Vector3& up) {
  const double share = 1.0 / EVERY_BOUND;
  const StateVector x = state_of(motion.omega_b, up);
  if (s.m > 0) inform(P_, see_products(P_, motion.omega_b, s, share));
  Seen<3> force = see_force(x, P_, up, motion.alpha_b, s, share);
  if (!motion.still)
    for (int i = 0; i < 3; ++i) force.C(i, i) += what.centre * share;
  inform(P_, force);
  if (motion.still) inform(P_, see_standstill(P_, s, KNOWN_RATE, share));
}

void Bound::step(const Sensor& s, const Knowledge& what, const Motion& motion) {
  ++count_;
  if (count_ % EVERY_BOUND != 0 || (!known_ && !motion.still)) return;
  const Vector3 up = felt_at_rest(motion.q_nb);
  if (!known_) begin(s, what, up);
  move(s, what, motion, up);
  see(s, what, motion, up);
  for (int i = 0; i < 3; ++i) sigma_(i) = std::sqrt(P_(OMEGA + i, OMEGA + i));
}

}  // namespace gyrofree::rate
