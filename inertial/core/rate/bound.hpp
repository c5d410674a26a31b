// The posterior Cramer-Rao bound of the rate along an estimate, one step for EVERY samples by the
// filter's own model (E-48). By whole matrices: inertial/rate/bound.py.
#pragma once

#include "rate/filter.hpp"

namespace gyrofree::rate {

// bound.Knowledge in squares.
struct Knowledge {
  double biases = 0.0;  // (m/s^2)^2 of one axis after the first standstill
  double tilt = 0.0;    // (m/s^2)^2
  double bias = 0.0;    // (m/s^2)^2, of one axis before it
  double centre = 0.0;  // (m/s^2)^2
  double pivot = 0.0;   // m^2
  double wander = 0.0;  // (rad/s)^2 per s
  double axis_from = 0.0;  // (rad/s)^2
  double share = 0.0;      // 1 / samples of the first standstill
};

// The estimate that a bound is along.
struct Motion {
  Vector3 omega_b;
  Vector3 alpha_b;
  Quaternion q_nb;
  bool still;
  double dt;  // s, since the sample before
};

class Bound {
 public:
  void step(const Sensor& s, const Knowledge& what, const Motion& motion);
  bool known() const { return known_; }
  const Vector3& sigma() const { return sigma_; }  // rad/s; zero before the first standstill

 private:
  void begin(const Sensor& s, const Knowledge& what, const Vector3& up);
  void move(const Sensor& s, const Knowledge& what, const Motion& motion, const Vector3& up);
  void see(const Sensor& s, const Knowledge& what, const Motion& motion, const Vector3& up);

  Covariance P_ = Covariance::Zero();
  Vector3 sigma_ = Vector3::Zero();
  long count_ = 0;
  bool known_ = false;  // there was a standstill
};

}  // namespace gyrofree::rate
