// How fast the axes' biases walk away, measured while the body stands (E-54).
#pragma once

#include "rate/sensor.hpp"

namespace gyrofree::rate {

class Drift {
 public:
  // A standstill begins: its own slope is looked for anew.
  void begin();
  // One more sample y of it, at t_s (s). s has the measured noise.
  void learn(const Sensor& s, const Measurement& y, double t_s);
  // Mean y of two standstills differ by d, of variance `noise` of one axis, seconds apart.
  void moved(const Sensor& s, const Measurement& d, double noise, double seconds);
  // Variance of one axis' slope, (m/s^2)^2 per s^2; 0 where none can be told from noise.
  double variance() const { return variance_; }
  // The same with what may hide in the noise: what the filter must allow for.
  double possible() const { return possible_; }

 private:
  static double of_one_axis(const Sensor& s, const Measurement& y);
  void told(double found, double noise);

  double variance_ = 0.0;
  double possible_ = 0.0;
  double known_ = 0.0;  // the noise it was told from
  // Of the samples of this standstill: how many, and sums of time, its square, y, and both.
  double count_ = 0.0, times_ = 0.0, squares_ = 0.0, begin_s_ = 0.0;
  Measurement sum_ = Measurement::Zero();
  Measurement moment_ = Measurement::Zero();
};

}  // namespace gyrofree::rate
