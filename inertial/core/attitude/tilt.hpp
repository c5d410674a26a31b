// The fixed-weight tilt filter, as published and in vector form (E-70 to E-76 of
// docs/equations-attitude.md). R is the direction of the specific force: up, for a body at rest.
// numpy twin: tests/support/twins/tilt.py.
#pragma once

#include "common/rotation.hpp"

namespace gyrofree::attitude {

constexpr double ILL_CONDITIONED = 0.1;  // |R_z| below which the projection angles are not used (E-74)

// q_nb of a direction of up in b, without any heading of its own: the shortest turn.
Quaternion upright_from(const Vector3& up_b);

// q_nb turned by a part of the way that brings f_b's direction onto n's up; heading stays (E-76). The
// part is that of the blend (R_accel + w R_gyro) / (1 + w) with part = 1 / (1 + w): a chord, not an arc.
Quaternion pulled_up(const Quaternion& q_nb, const Vector3& f_b, double part);

// R of the two projection angles, rad; its z has the sign given, for the angles' own is lost (E-73).
Vector3 from_projection_angles(double xz, double yz, double sign_z);

// The article's arithmetic in its frame a, which reads +1 g on z when the board lies level (E-72 to E-75).
struct PublishedTilt {
  double period = 0.0;   // s
  double w_gyro = 0.0;   // weight of the gyros against the accelerometer's 1
  bool started = false;
  double rate_xz = 0.0;  // of the sample before, rad/s
  double rate_yz = 0.0;
  Vector3 R_a = Vector3::Zero();

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("period", s.period), v("w_gyro", s.w_gyro), v("started", s.started);
    v("rate_xz", s.rate_xz), v("rate_yz", s.rate_yz), v("R_a", s.R_a);
  }

  // q_nb after a sample. One without any specific force has no direction: the gyros alone carry R.
  Quaternion step(const Vector3& f_b, const Vector3& omega_b);

 private:
  Vector3 turned(double next_xz, double next_yz) const;
};

// The same weighting on whole rotations, with all three gyros (E-76).
struct VectorTilt {
  double period = 0.0;  // s
  double w_gyro = 0.0;  // weight of the gyros against the accelerometer's 1
  bool started = false;
  Quaternion q_nb;
  Vector3 omega_b = Vector3::Zero();  // of the sample before, rad/s

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("period", s.period), v("w_gyro", s.w_gyro), v("started", s.started);
    v("q_nb", s.q_nb), v("omega_b", s.omega_b);
  }

  // q_nb after a sample, heading by the gyro alone.
  Quaternion step(const Vector3& f_b, const Vector3& omega_b);
};

}  // namespace gyrofree::attitude
