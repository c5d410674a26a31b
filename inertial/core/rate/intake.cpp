#include "rate/intake.hpp"

#include <algorithm>

namespace gyrofree::rate {
namespace {

constexpr double AT_THE_END = 0.995;   // of the range
constexpr double NEAR_THE_END = 0.9;   // of it: an axis that does not change there is at an end as well
constexpr double JUMP = 10.0;          // m/s^2 from sample to sample: no body that is turned on a table does that
constexpr double COARSE = 2.0;         // times the noise of an axis
constexpr int CALM = 8;                // samples without a jump, before one is taken for damage

}  // namespace

// Does an axis jump, and is it a spike? One that has not come back after BRIDGED_SAMPLES was a motion.
bool Intake::spikes(const Sensor& s, const double* a) {
  bool jumps = false;
  for (int i = 0; i < s.n; ++i)
    if (s.used(i) != 0.0 && std::fabs(a[i] - taken_(i)) > JUMP) jumps = true;
  const bool damage = jumps && (spike_ > 0 ? spike_ < BRIDGED_SAMPLES : calm_ >= CALM);
  if (damage) {
    ++spike_;
    return true;
  }
  spike_ = 0;
  calm_ = jumps ? 0 : calm_ + 1;
  for (int i = 0; i < s.n; ++i) taken_(i) = a[i];
  return false;
}

bool Intake::usable(const Sensor& s, const double* a, double dt, bool noisy) {
  bool changes = false, inside = true;
  for (int i = 0; i < s.n; ++i) {
    if (s.used(i) == 0.0) continue;
    const double size = std::fabs(a[i]), limit = s.limit(i);
    const bool same = a[i] == last_(i);
    changes = changes || !same;
    if (heard_ && !same) {
      const double change = std::fabs(a[i] - last_(i));
      if (change_(i) == 0.0 || change < change_(i)) {
        change_(i) = change;
        changed_ = true;
      }
    }
    if (limit > 0.0 && (size >= AT_THE_END * limit || (same && size >= NEAR_THE_END * limit))) inside = false;
    last_(i) = a[i];
  }
  heard_ = true;
  same_s_ = changes ? 0.0 : same_s_ + dt;
  const bool spike = spikes(s, a);
  return inside && !spike && !withheld_ && !(noisy && same_s_ >= FROZEN_S);
}

double Intake::resolution(const Sensor& s) {
  if (!changed_) return resolution_;
  changed_ = false;
  double found[MOST_AXES];
  int axes = 0, used = 0;
  for (int i = 0; i < s.n; ++i) {
    if (s.used(i) != 0.0) ++used;
    if (s.used(i) != 0.0 && change_(i) > 0.0) found[axes++] = change_(i);
  }
  std::sort(found, found + axes);
  const double middle = axes > 0 && 2 * axes >= used ? 0.5 * (found[(axes - 1) / 2] + found[axes / 2]) : 0.0;
  resolution_ = square(middle) > square(COARSE) * s.axis_variance() ? middle : 0.0;
  return resolution_;
}

bool Intake::refuses(const Sensor& s, const double* a, double dt, bool noisy) {
  if (usable(s, a, dt, noisy)) {
    missing_ = 0;
    return false;
  }
  ++missing_;
  ++refused_;
  return true;
}

}  // namespace gyrofree::rate
