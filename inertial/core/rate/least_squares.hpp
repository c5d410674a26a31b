// The paper's way: angular acceleration by least squares, Runge-Kutta to rate and angle (E-3 to E-8).
// numpy twin: tests/inertial/test_least_squares.py.
#pragma once

#include "rate/intake.hpp"
#include "rate/row.hpp"
#include "rate/still.hpp"

namespace gyrofree::rate {

// Segments of what is integrated, y.
enum Integrated { I_OMEGA = 0, I_Q_NB = 3, I_ANGLE = 7, I_V_N = 8, I_P_N = 11, INTEGRATED = 14 };
using IntegralVector = Vector<INTEGRATED>;

// [omega'; p] of the axes, without their biases.
enum Driven { D_ALPHA = 0, D_FORCE = 3, DRIVEN = 6 };
using DriveVector = Vector<DRIVEN>;

// dy/dt for u = S a - bias (E-6).
IntegralVector derivative(const IntegralVector& y, const DriveVector& u, const Sensor& s);
// One step over dt (s) with u linear between two samples (E-6).
IntegralVector runge_kutta(const IntegralVector& y, const DriveVector& before, const DriveVector& after,
                           const Sensor& s, double dt);

struct LeastSquaresLimits {
  int shortest_standstill;  // samples that biases need
  double longest_step_s;    // s; a longer silence is a gap
  StillLimits still;
};

class LeastSquares {
 public:
  LeastSquares();
  void advance(const Sensor& s, const LeastSquaresLimits& c, double t_s, const double* a);
  void gap() { watch_.forget(); }
  // Other axes are in use.
  void exchange_axes();
  Intake& intake() { return intake_; }
  void write(const Sensor& s, Row& row) const;

 private:
  const Sensor& believed(const Sensor& s);
  Measurement newest() const { return watch_.newest() < 0 ? Measurement(Measurement::Zero()) : watch_.y(watch_.newest()); }
  void restart();
  void align();
  Matrix3 covariance(const Sensor& s) const;

  Watch watch_;
  Intake intake_;
  Sensor measured_;
  IntegralVector y_ = IntegralVector::Zero();
  DriveVector bias_ = DriveVector::Zero();
  DriveVector u_ = DriveVector::Zero();  // S a - bias of the last sample
  Matrix3 P_ = Matrix3::Zero();          // of omega
  double noise_ = 1.0;  // of omega', measured over configured: the largest since the standstill
  int samples_ = 0;                      // of the standstill that gave the biases
  bool still_ = false;
  double last_s_ = std::numeric_limits<double>::quiet_NaN();
  double dt_ = 0.01;
  double moving_s_ = 0.0;  // integrated
};

}  // namespace gyrofree::rate
