// Attitude of a body at rest, and the filter's first state there (E-11, E-36).
#include "rate/start.hpp"

namespace gyrofree::rate {
Quaternion level(const Vector3& up) {
  const Vector3 ahead = std::fabs(up.x()) < 0.999 ? Vector3(1.0, 0.0, 0.0) : Vector3(0.0, 0.0, 1.0);
  Vector3 north = ahead - dot(ahead, up) * up;
  north /= norm_of(north);
  Matrix3 C;
  C.row(0) = north.transpose();
  C.row(1) = cross(north, up).transpose();
  C.row(2) = -up.transpose();
  return from_matrix(C);
}

void begin_still(Filter& f, const Sensor& s, const Tuning& t, const Measurement& mean) {
  f = Filter();
  const Vector3 force = mean.segment<3>(FORCE_M);
  const Vector3 up = force / norm_of(force);
  const Matrix3 along = up * up.transpose();
  f.x.segment<3>(LIFT) = GRAVITY * up;
  add_to_biases(f.P, s.drift, t.bias);
  f.P.block<3, 3>(OMEGA, OMEGA) = t.first_still_rate * Matrix3::Identity();
  f.P.block<3, 3>(PIVOT, PIVOT) = t.pivot * Matrix3::Identity();
  f.P.block<3, 3>(LIFT, LIFT) = t.gravity * along + t.tilt * (Matrix3::Identity() - along);
  f.alpha_m = f.alpha_late = mean.segment<3>(ALPHA_M);
  f.sign_variance = t.first_still_rate;
  f.q_nb = level(up);
  f.rest_variance = f.level = bias_variances(f.P);
  f.rest_reading = product(s.theta_b, f.x.segment<3>(LIFT));
}

}  // namespace gyrofree::rate
