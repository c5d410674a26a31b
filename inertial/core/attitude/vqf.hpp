// VQF of Laidig and Seel (Information Fusion 91, 2023) without magnetometer (E-79c to E-79i of
// docs/equations-attitude.md). Frames: b body; g nearly inertial, where b is by the gyros alone;
// e east-north-up but for heading. Its authors' package is the twin in the tests.
#pragma once

#include "common/rotation.hpp"

namespace gyrofree::attitude {

// Published settings.
struct VqfSettings {
  double tau_accel = 3.0;         // s, of the low-pass of the specific force in g
  double tau_rest = 0.5;          // s, of the low-passes that tell rest
  double rest_s = 1.5;            // s that rest must have lasted
  double rest_omega = 2.0;        // deg/s, largest deviation of a rate at rest
  double rest_f = 0.5;            // m/s^2, largest deviation of a force at rest
  double bias_most = 2.0;         // deg/s, of a bias and of one disagreement with it
  double sigma_first = 0.5;       // deg/s, of the bias before any sample
  double sigma_motion = 0.1;      // deg/s, to which it is found in motion
  double sigma_rest = 0.03;       // deg/s, to which it is found at rest
  double forgetting_s = 100.0;    // s in which its sigma grows from 0 to 0.1 deg/s
  double vertical_part = 1e-4;    // weight of the pull to zero about the vertical, in motion
};

// Low-pass of second order by Butterworth (E-79d).
struct Butterworth {
  double b0 = 1.0, b1 = 0.0, b2 = 0.0;
  double a1 = 0.0, a2 = 0.0;

  Butterworth() = default;
  Butterworth(double tau, double period);

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("b0", s.b0), v("b1", s.b1), v("b2", s.b2), v("a1", s.a1), v("a2", s.a2);
  }
};

// What a low-pass remembers of N signals. It begins with their mean over its time constant.
template <int N>
struct LowPass {
  double samples = 0.0;  // taken into the mean
  bool settled = false;
  Vector<N> sum = Vector<N>::Zero();
  Vector<N> now = Vector<N>::Zero();   // memory for the next sample
  Vector<N> next = Vector<N>::Zero();  // and for the one after it

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("samples", s.samples), v("settled", s.settled), v("sum", s.sum), v("now", s.now), v("next", s.next);
  }

  Vector<N> step(const Vector<N>& x, const Butterworth& c, double tau, double period) {
    if (settled) {
      Vector<N> y = c.b0 * x + now;
      now = c.b1 * x - c.a1 * y + next;
      next = c.b2 * x - c.a2 * y;
      return y;
    }
    samples += 1.0;
    sum += x;
    Vector<N> mean = sum / samples;
    if (samples * period >= tau) {
      settled = true;
      now = (1.0 - c.b0) * mean;
      next = (c.b2 - c.a2) * mean;
    }
    return mean;
  }
};

struct Vqf {
  static constexpr VqfSettings SETTINGS{};

  double period = 0.0;             // s
  Butterworth smooth, smooth_rest;
  Quaternion q_gb, q_eg;           // by the gyros; the correction of the inclination
  LowPass<3> f_g;
  Vector3 bias_b = Vector3::Zero();  // of the gyros, rad/s
  Matrix3 P = Matrix3::Zero();       // its covariance, (0.01 deg/s)^2
  LowPass<9> C_eb;                   // row by row
  LowPass<2> bias_e;                 // east and north
  bool resting = false;
  double rested = 0.0;               // s
  LowPass<3> rest_omega, rest_f;
  Vector3 mean_omega_b = Vector3::Zero();  // rad/s

  Vqf() = default;
  explicit Vqf(double period);

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("period", s.period), v("smooth", s.smooth), v("smooth_rest", s.smooth_rest);
    v("q_gb", s.q_gb), v("q_eg", s.q_eg), v("f_g", s.f_g), v("bias_b", s.bias_b), v("P", s.P);
    v("C_eb", s.C_eb), v("bias_e", s.bias_e), v("resting", s.resting), v("rested", s.rested);
    v("rest_omega", s.rest_omega), v("rest_f", s.rest_f), v("mean_omega_b", s.mean_omega_b);
  }

  // q_nb after a sample, n = north-east-down but for heading.
  Quaternion step(const Vector3& f_b, const Vector3& omega_b);

 private:
  void watch_rate(const Vector3& omega_b);
  void watch_force(const Vector3& f_b);
  Vector3 incline(const Vector3& f_b);
  void estimate_bias(const Vector3& up_e);
  void correct_bias(const Matrix3& H, const Vector3& misfit, const Vector3& noise);
};

}  // namespace gyrofree::attitude
