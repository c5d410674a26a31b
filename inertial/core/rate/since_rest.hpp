// What every axis read at the last standstill and since, in blocks of a few samples.
//
// When axes are left out, everything that was made with them is in doubt: the rate, the biases, the
// attitude. The axes that stay were right all the time, so the filter begins anew at the last standstill
// and goes through these blocks with what is left (E-89).
#pragma once

#include <array>

#include "rate/filter.hpp"

namespace gyrofree::rate {

// Readings of all axes over some samples, summed.
struct Block {
  Vector<MOST_AXES> sum = Vector<MOST_AXES>::Zero();  // m/s^2
  double seconds = 0.0;
  int samples = 0;

  void add(const Block& other);
  Vector<MOST_AXES> mean() const { return sum / samples; }
};

class SinceRest {
 public:
  void forget() { *this = SinceRest(); }
  // One sample of all axes, dt s after the last; f: the state after that, still: it is at rest.
  void take(const Sensor& s, const double* a, double dt, bool still, const Filter& f);

  // Is there a standstill behind, long enough to begin at?
  bool known() const { return rest_.samples >= FEWEST_AT_REST; }
  const Block& rest() const { return rest_; }
  double angle() const { return angle_; }  // rad, of z when it ended
  double angle_variance() const { return angle_variance_; }
  const Quaternion& q_nb() const { return q_nb_; }
  int blocks() const { return count_; }
  const Block& block(int k) const { return blocks_[k]; }

 private:
  static constexpr int FEWEST_AT_REST = 32;
  static constexpr int MOST_BLOCKS = 128;
  static constexpr int GUARD_BLOCKS = 16;  // before a turn is noticed it has begun
  static constexpr double LONGEST_S = 0.4;  // of a block; a rate may change much in a longer one

  void fold();
  void coarsen();

  Block rest_;
  std::array<Block, MOST_BLOCKS> blocks_;
  int count_ = 0;
  int length_ = 8;  // samples of a block
  bool standing_ = false;
  double angle_ = 0.0;
  double angle_variance_ = 0.0;
  Quaternion q_nb_;
};

}  // namespace gyrofree::rate
