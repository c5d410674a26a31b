// Zero-velocity detector: is the body still? Questions on the newest samples, with stated limits
// (E-20 to E-25). What is asked, and why: inertial/rate/still.py; numpy twin:
// tests/support/still_twin.py.
#pragma once

#include "rate/drift.hpp"
#include "rate/noise.hpp"

namespace gyrofree::rate {

struct StillLimits {
  double spread_limit, quiet_limit, turn_limit, tilt_limit, steady_limit, drift_steady;
  double rate_limit, rate_slack, sure_rate, likely_rate, begin_limit, patience_s;
  double drift, drift_now, drift_tilt, scale;
  int window, short_window, steady_span, brief_span, guard, hold;
};

constexpr int DEPTH = 128;           // samples remembered
constexpr long TOTALS = 2L * DEPTH;  // running sums remembered

struct Verdict {
  bool still;
  int depth;  // when a standstill ends: how many samples ago the turn began
  bool against = false;  // it stands, though the caller's rate excludes it
};

class Watch {
 public:
  // After a gap: the window must fill anew; the reference of the last standstill stays.
  void forget();
  // Of other axes than before: nothing that was learnt of them holds.
  void unlearn();
  // Remember one sample of all axes; s has the configured noise.
  void take(const Sensor& s, const double* a, double dt);
  // Is the sample taken last one of standstill, by the caller's omega and its covariance? s has the
  // measured noise.
  Verdict detect(const Sensor& s, const StillLimits& c, const Vector3& omega, const Matrix3& P, double dt);

  // May a body that never stood be standing, with axes' biases of that variance, (m/s^2)^2?
  bool could_stand(const Sensor& s, const StillLimits& c, double bias);
  // Does a sample of the newest n stand out of its neighbours by far more than noise? s has the measured
  // noise.
  bool rough(const Sensor& s, int n) const;
  bool never_stood() const { return learnt == 0; }
  long newest() const { return count - 1; }
  int filled_samples() const { return filled; }
  int learning_samples() const { return learning; }
  const Measurement& learnt_mean() const { return reference; }
  Measurement y(long sample) const { return ring_y.col(sample % DEPTH); }
  double dt(long sample) const { return ring_dt(sample % DEPTH); }
  // Sum of all y up to a sample of the last 256, but for a constant.
  Measurement total(long sample) const { return ring_total.col((sample + TOTALS) % TOTALS); }
  Measurement mean_of(int window) const;
  // (m/s^2)^2 per s, by which biases of one axis wander more than is configured.
  double wander() const { return 2.0 * walk.possible() * std::clamp(seconds - settled_s, 2.0, 20.0); }
  Noise& noise() { return measured; }
  const Noise& noise() const { return measured; }

 private:
  // y_k - 3 y_(k-1) + 3 y_(k-2) - y_(k-3) up to that sample.
  Measurement third_difference(long last) const { return y(last) - y(last - 3) + 3.0 * (y(last - 2) - y(last - 1)); }
  double scatter(const Sensor& s, int window);
  Measurement mean(int window, int ago = 0) const;
  double moved(const Sensor& s, const StillLimits& c, int window) const;
  double turned(const Sensor& s, int length, double drift) const;
  double tilted(const Sensor& s, int window, double drift) const;
  double swung(const Sensor& s, const StillLimits& c, int span) const;
  bool settled(const Sensor& s, const StillLimits& c, const Vector3& omega, const Matrix3& P, double told) const;
  int began(const Sensor& s, const StillLimits& c) const;
  bool stands(const Sensor& s, const StillLimits& c, const Vector3& omega, const Matrix3& P, double dt);
  bool restless();
  double leant(const Sensor& s, const StillLimits& c, const Measurement& d) const;
  void learn(const Sensor& s, const StillLimits& c);

  Matrix<MEASURED, DEPTH> ring_y = Matrix<MEASURED, DEPTH>::Zero();
  Matrix<MEASURED, TOTALS> ring_total = Matrix<MEASURED, TOTALS>::Zero();
  Vector<DEPTH> ring_dt = Vector<DEPTH>::Zero();
  // Of y in the window: one of them, and sum and sum of squares of what they differ by.
  Measurement offset = Measurement::Zero();
  Measurement sum = Measurement::Zero();
  Measurement sum_of_squares = Measurement::Zero();
  Noise measured;
  Drift walk;
  double seconds = 0.0;    // of all samples
  double settled_s = 0.0;  // when the reference was last learnt
  Measurement reference = Measurement::Zero();  // mean y of the last standstill
  Measurement gathered = Measurement::Zero();   // of this standstill without its newest samples
  long count = 0;       // samples taken
  int filled = 0;       // of them without a gap
  int still_for = 0;    // samples of this standstill
  int quiet_for = 0;    // samples that look still
  int slow_for = 0;     // samples that look still but for biases that have moved
  int learnt = 0;       // samples behind the reference
  int learning = 0;     // of this standstill
  bool told_otherwise = false;  // the caller's rate excluded zero
  int hold = 0;         // samples before there can be a standstill again
};

// Chi-square of zero rate: omega^T (P + slack^2 I)^-1 omega (E-22).
double rate_excludes_zero(const Vector3& omega, const Matrix3& P, double slack);

}  // namespace gyrofree::rate
