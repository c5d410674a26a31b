// Do innovations bear the filter out? Those of a filter that is right are white and of the size it says;
// one that believes a wrong bias or direction is wrong the same way for a while (E-59).
#pragma once

#include "rate/filter.hpp"

namespace gyrofree::rate {

class Agreement {
 public:
  // One sample's correction by m products, dt s after the last.
  void observe(const Said& said, int m, double dt);
  void forget() { *this = Agreement(); }
  // Mean square of innovations averaged over MEAN_S, over what it should be: 1 for a filter that is right.
  double slow() const { return slow_; }
  // NIS per degree of freedom over a second.
  double fast() const { return fast_; }
  // By how much, 1/s, the filter should forget.
  double forgetting() const { return std::max(0.0, RATE * (std::min(slow_, MOST) - SURE)); }

 private:
  static constexpr double MEAN_S = 0.2, OVER_S = 0.5, NIS_S = 1.0;  // s
  static constexpr double SURE = 2.0;   // of slow: by chance once in minutes
  static constexpr double MOST = 20.0;  // of slow that counts
  static constexpr double RATE = 1.0;   // 1/s

  Products mean_ = Products::Zero();
  double slow_ = 1.0;
  double fast_ = 1.0;
};

}  // namespace gyrofree::rate
