// Does a sample say anything of the body? Not where an axis is at the end of its range, where no axis
// changes any more, where one jumps and comes back, or where somebody withholds them; unknown is then
// all that can be said.
#pragma once

#include "rate/sensor.hpp"

namespace gyrofree::rate {

constexpr int BRIDGED_SAMPLES = 3;  // that may be missing without anything being forgotten

class Intake {
 public:
  // Must this sample of all axes be passed over? noisy: the axes are known to scatter.
  bool refuses(const Sensor& s, const double* a, double dt, bool noisy);
  void withhold(bool on) { withheld_ = on; }
  // Somebody says that the axes do not fit one motion: samples are taken, what they say is not valid.
  void doubt(bool on) { doubted_ = on; }
  bool doubted() const { return doubted_; }
  // Samples passed over in a row, and all of them.
  int missing() const { return missing_; }
  long refused() const { return refused_; }
  // What readings are rounded to, m/s^2, where that hides their noise; 0 where it does not (H-14).
  double resolution(const Sensor& s);

 private:
  static constexpr double FROZEN_S = 1.0;  // s in which no axis changes
  bool usable(const Sensor& s, const double* a, double dt, bool noisy);
  bool spikes(const Sensor& s, const double* a);

  Vector<MOST_AXES> last_ = Vector<MOST_AXES>::Zero();
  Vector<MOST_AXES> change_ = Vector<MOST_AXES>::Zero();  // the smallest of each axis, 0: none yet
  double resolution_ = 0.0;
  bool changed_ = false;  // change_, since that was found
  bool heard_ = false;    // a sample
  Vector<MOST_AXES> taken_ = Vector<MOST_AXES>::Zero();  // the newest sample that was no spike
  int calm_ = 0;    // samples without a jump
  int spike_ = 0;   // samples of a jump that may come back
  double same_s_ = 0.0;  // in which no axis changed
  int missing_ = 0;
  long refused_ = 0;
  bool withheld_ = false;
  bool doubted_ = false;
};

}  // namespace gyrofree::rate
