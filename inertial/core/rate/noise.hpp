// How noisy the axes are, measured: never less than what is configured (E-58).
//
// What a body does is smooth from sample to sample, what sensors add is not: third differences of
// y = [omega', c, p] are noise nearly alone, and clipped ones forgive a jolt. Sensors' noise and the
// table's shaking are kept apart: shaking moves all axes alike, so it is in p and in nothing else.
// Counted by samples: how they are batched changes no bit. numpy twin: tests/support/noise_twin.py.
#pragma once

#include "rate/sensor.hpp"

namespace gyrofree::rate {

constexpr int DIFFERENCED = 4;  // samples of one third difference

// Mean square of a third difference of omega' and c over what configured noise makes of it.
double quiet_ratio(const Sensor& s, const Measurement& third_difference);

class Noise {
 public:
  // y0 - 3 y1 + 3 y2 - y3 of samples in a row, by the configured noise of s.
  void observe(const Sensor& s, const Measurement& third_difference);
  // Variances over the configured ones, at least 1: of omega' and c, and of p.
  double quiet() const { return std::max(least_, quiet_.believed(QUIET_SLACK)); }
  double force() const { return std::max(least_, force_.believed(FORCE_SLACK)); }
  // Readings are rounded to so much, m/s^2: equal ones scatter by that all the same (H-14).
  void rounded(double step, const Sensor& s) { least_ = 1.0 + square(step) / (12.0 * s.axis_variance()); }
  // Variance of what of a turn is not noticed yet, over that of axes as configured: it is seen by omega'
  // and by p, and p may scatter so much that it shows nothing.
  double unnoticed() const { return as_configured() ? 1.0 : quiet() * std::clamp(force() / quiet(), 2.4, 4.0); }
  // Do the axes scatter at all? Those of a model without noise do not.
  bool any() const { return quiet_.value > 0.05; }
  bool as_configured() const { return quiet() == 1.0 && force() == 1.0; }

 private:
  // By what chance alone exceeds 1 over MEMORY samples, and over fewer by more: less is as configured.
  static constexpr double QUIET_SLACK = 0.3, FORCE_SLACK = 0.5;
  static constexpr int MEMORY = 128;  // samples
  struct Mean {
    double value = 0.0;
    long count = 0;
    void add(double ratio);
    double believed(double slack) const;
  };

  Mean quiet_, force_;
  double least_ = 1.0;
};

// The sensor with the noise that was measured.
void apply(const Noise& noise, const Sensor& configured, Sensor& out);

}  // namespace gyrofree::rate
