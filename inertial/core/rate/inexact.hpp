// What errors of the axes' scales, directions and places do to a products filter: how its state follows
// them, how large they are by its innovations, and what that makes of the rate's covariance (E-90).
//
// An error of an axis lasts: its sensing vector is off by e, and it reads e . f more, f the specific
// force at its place. No noise of single samples is like that, and no bias, which does not change with
// the rate. So the derivative of the state by all these errors is carried along the estimate, a step for
// every eighth sample, through the filter's own gains. Checked by
// differences in tests/inertial/test_inexact.py.
#pragma once

#include "rate/agreement.hpp"

namespace gyrofree::rate {

constexpr int ERRORS_OF_AXIS = 3;  // of its sensing vector
constexpr int MOST_ERRORS = ERRORS_OF_AXIS * MOST_AXES;

template <int Rows>
using ByErrors = Eigen::Matrix<double, Rows, Eigen::Dynamic, Eigen::ColMajor, Rows, MOST_ERRORS>;
using Errors = VectorUpTo<MOST_ERRORS>;

// Samples that one step stands for.
struct Stretch {
  const Measurement& mean;  // of y over them
  double dt;                // s, of one sample
  int samples;
  bool turning;
  bool fixed;  // about an axis that keeps its direction
};

class Inexact {
 public:
  void forget() { *this = Inexact(); }
  // The state begins anew; how inexact the axes are is still known.
  void begin_anew();
  // Another state than before is gone on with.
  void jumped(const Filter& f) {
    P_ = f.P;
    level_ = f.level;  // biases do not move by a jump
  }
  // One sample's correction by products.
  void observe(const Said& said);
  // The state f after some samples.
  void step(const Filter& f, const Sensor& s, const Tuning& t, const Stretch& stretch);

  // Innovations of the samples that the last step stood for.
  const Heard& heard() const { return last_; }

  // Variance of an axis' error, of 1, by the innovations and by the offsets at rest; 0: as configured.
  double seen() const { return std::max({0.0, carried_, by_offsets_, by_innovations(0.0)}); }
  // Variance beyond what the filter's own P allows for, and what it makes of omega's.
  double beyond(const Tuning& t) const;
  Matrix3 of_rate(const Tuning& t) const { return beyond(t) * unit_of_rate(); }
  // Covariance of omega for errors of variance 1, and its derivative by them.
  Matrix3 unit_of_rate() const;
  ByErrors<3> rate() const { return by_.middleRows<3>(OMEGA); }

 private:
  static constexpr int SETTLES = 48;  // steps, one at rest counts six times
  double by_innovations(double expected) const;

  void begin(const Filter& f, const Sensor& s);
  void follow_biases(const Filter& f, bool turning);
  void move(const Filter& f, const Sensor& s, const Tuning& t, const Stretch& stretch, const ByErrors<MEASURED>& Y);
  void correct(const Filter& f, const Sensor& s, const Tuning& t, const Stretch& stretch,
               const ByErrors<MEASURED>& Y);
  void learn(const ByErrors<6>& E);
  template <int M>
  void absorb_errors(const Seen<M>& seen, const ByErrors<M>& E);

  ByErrors<STATES> by_;                  // d x / d errors
  ByErrors<MEASURED> at_rest_;           // of the biases, at the last standstill
  Measurement level_ = Measurement::Zero();
  Covariance P_ = Covariance::Zero();    // of the state before these samples
  UpTo<MOST_ERRORS> information_;        // of the errors by the innovations
  Errors told_;
  int settling_ = SETTLES;               // steps until the biases know what the errors do to gravity
  double carried_ = 0.0;                 // of 1, squared: seen before the state began anew
  double by_offsets_ = 0.0;              // seen at rest
  double by_noise_ = 0.0;                // mean of |told|^2 were there noise only
  Heard now_;   // since the last step
  Heard last_;  // of it
};

}  // namespace gyrofree::rate
